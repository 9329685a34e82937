"""From the stage's lights to the pixels of the mirror ball, by the paper's Phong lobe.

Section 3.3 accumulates the photographs for each direction of the ball with a Phong lobe of
exponent 64, on 4 x 4 directions a pixel. Lights are not spread evenly, so the lobe's weights are
multiplied with each light's own share of the sphere and made to sum to 1 for every direction:
constants come out exact. The lobe is as wide as the lights are apart and blurs what is
photographed; `passes` of more than one put back what the lobe took from the photographs
themselves, which is our choice: see docs/reflectance.md for what it is worth.
"""

import numpy as np
from jaxtyping import Float

from deeplight.mappings import mirror_ball

EXPONENT = 64  # section 3.3
SUPERSAMPLE = 4  # section 3.3: a 4 x 4 grid of directions
PASSES = 2
NOTHING = 1e-30  # weights below it change no sum

Lights = Float[np.ndarray, "lights 3"]


def light_shares(lights: Lights) -> Float[np.ndarray, "lights"]:
    """Solid angle of the directions to which each light is the nearest; they sum to 4 pi."""
    directions, solid_angle = _fine_ball(128)
    nearest = np.concatenate(
        [(some @ lights.T).argmax(axis=1) for some in np.array_split(directions, 16)]
    )
    return np.bincount(nearest, solid_angle, len(lights))


def lobe_weights(
    directions: Float[np.ndarray, "directions 3"], lights: Lights, passes: int = PASSES
) -> Float[np.ndarray, "directions lights"]:
    """How much each light's photograph counts for each direction; rows sum to 1.

    Args:
        passes: 1 is the paper's lobe alone; each further one adds what the lobe still takes
            from the photographs (Landweber's iteration).
    """
    shares = light_shares(lights)
    taken = np.eye(len(lights)) - _lobe(lights, lights, shares)
    put_back, left = np.eye(len(lights)), np.eye(len(lights))
    for _ in range(passes - 1):
        left = left @ taken
        put_back += left
    return _cleared(_lobe(directions, lights, shares) @ put_back.astype(np.float32))


def basis_weights(
    photographs: Float[np.ndarray, "pixels lights"],
    lights: Lights,
    light_size: int,
    passes: int = PASSES,
    parallax: Float[np.ndarray, "pixels 3"] | None = None,
) -> Float[np.ndarray, "pixels light_pixels"]:
    """The basis: reflected radiance of each crop pixel per unit of radiance in a ball pixel.

    Args:
        photographs: radiance per unit of irradiance at each pixel's own place.
        parallax: place of each pixel on the sphere, from its centre, in units of the lights'
            distance; left out, the lights are far away.
    """
    fine = SUPERSAMPLE * light_size
    grid = mirror_ball.pixel_directions(fine).reshape(-1, 3)
    response = photographs.astype(np.float32) @ lobe_weights(grid, lights, passes).T
    directions, inside = mirror_ball.subpixels(light_size, SUPERSAMPLE)
    share = inside / np.maximum(inside.sum(axis=1, keepdims=True), 1)
    solid_angle = share * mirror_ball.solid_angles(light_size).reshape(-1, 1)
    flat = directions.reshape(-1, 3).astype(np.float32)
    weights = np.zeros((len(photographs), light_size**2))
    taps = _taps(flat, fine)
    for pixel in np.flatnonzero(photographs.any(axis=1)):
        if parallax is not None:
            taps = _taps(_seen_from_centre(flat, parallax[pixel].astype(np.float32)), fine)
        values = sum(response[pixel].take(index) * weight for index, weight in taps)
        weights[pixel] = (values.reshape(solid_angle.shape) * solid_angle).sum(axis=1)
    return _without_negatives(weights)


def uncovered_share(lights: Lights) -> float:
    """Share of the sphere farther from every light than 1.5 times their usual spacing."""
    cosines = lights @ lights.T
    np.fill_diagonal(cosines, -1)
    spacing = np.median(np.arccos(np.clip(cosines.max(axis=1), -1, 1)))
    directions, solid_angle = _fine_ball(64)
    nearest = np.arccos(np.clip((directions @ lights.T).max(axis=1), -1, 1))
    return float(solid_angle[nearest > 1.5 * spacing].sum() / solid_angle.sum())


def _lobe(directions: np.ndarray, lights: np.ndarray, shares: np.ndarray) -> np.ndarray:
    weights = np.empty((len(directions), len(lights)), np.float32)
    for some in np.array_split(np.arange(len(directions)), max(1, len(directions) // 2048)):
        cosine = directions[some] @ lights.T
        # Relative to the nearest light, so that far from all of them it is not 0 / 0.
        relative = np.maximum(cosine, 1e-6) / np.maximum(cosine.max(axis=1, keepdims=True), 1e-6)
        weights[some] = relative**EXPONENT * shares
    return _cleared(weights / weights.sum(axis=1, keepdims=True))


def _cleared(weights: np.ndarray) -> np.ndarray:
    """The weights, in place, without those that change no sum.

    A processor takes 25 times as long to multiply numbers near float32's smallest.
    """
    weights[np.abs(weights) < NOTHING] = 0
    return weights


def _seen_from_centre(directions: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Where the light that a place sees in `directions` stands, as seen from the centre."""
    along = directions @ place
    reach = np.sqrt(1 - place @ place + along * along) - along
    seen: np.ndarray = place + directions * reach[:, None]
    return seen


def _taps(directions: np.ndarray, size: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Four (pixel, weight) pairs per direction, bilinear on a fine ball."""
    u, v = mirror_ball.uv_from_directions(directions)
    column = np.clip((u + 1) * (size / 2) - 0.5, 0, size - 1)
    row = np.clip((1 - v) * (size / 2) - 0.5, 0, size - 1)
    left, top = np.minimum(column.astype(int), size - 2), np.minimum(row.astype(int), size - 2)
    right, down = (column - left).astype(np.float32), (row - top).astype(np.float32)
    corner, up = top * size + left, 1 - down
    return [
        (corner + dr * size + dc, wr * wc)
        for dr, wr in ((0, up), (1, down))
        for dc, wc in ((0, 1 - right), (1, right))
    ]


def _without_negatives(weights: np.ndarray) -> np.ndarray:
    """No light takes light away: what noise and the later passes left below 0, energy kept."""
    kept = np.maximum(weights, 0)
    before = np.maximum(weights.sum(axis=1, keepdims=True), 0)
    after = kept.sum(axis=1, keepdims=True)
    scaled: np.ndarray = kept * np.divide(before, after, out=np.zeros_like(after), where=after > 0)
    return scaled


def _fine_ball(size: int) -> tuple[np.ndarray, np.ndarray]:
    directions, solid_angle = mirror_ball.pixel_directions(size), mirror_ball.solid_angles(size)
    return directions.reshape(-1, 3), solid_angle.ravel()
