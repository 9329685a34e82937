"""Which sphere is which: the mirror's picture of the light must explain the two others.

Each way to give the three names is tried. The sphere taken for the mirror is read as the light, and
a matte silver and a diffuse sphere are lit by it (equation 1) and compared with the pictures
of the two others. Light that is clipped in the mirror may be as bright as suits best, but it is one
light for both. How fine the detail is that a sphere shows counts too: most in the mirror, least in
the diffuse one.
"""

from dataclasses import dataclass
from itertools import permutations

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.camera_response import decode, encode
from deeplight.capture.conic import Cone
from deeplight.frames import looking_at, turned
from deeplight.mappings import mirror_ball
from deeplight.sphere import SPHERES, SphereView

SIZE = 16  # pixels along crops and light: naming needs no more
_FINE = 4  # samples along each of them
_CLIPPED = 248  # grey levels from here on may stand for any brightness
_WEIGHT = 10.0  # of the logarithm of the error: half the error makes a name 2^10 times as likely
_ERROR_FLOOR = 0.003  # of pixel values: smaller errors say nothing
_LEVELS = (0.75, 1.35)  # how far the mirror's reflectivity may be from the paper's
_ROUNDS = 300  # of the search for the brightness of clipped light
_SETTLED = 1e-4  # share by which it still changes when the search stops

# Natural logarithm of how much more detail one sphere shows than the next, and its spread.
_MIRROR_TO_SILVER = (0.9, 0.45)
_SILVER_TO_DIFFUSE = (0.9, 0.5)
_CONTRADICTED = -0.1  # of silver to diffuse: one in fifty true ones comes to -0.02
_DOUBTFUL = 0.1  # error from which on a contradiction by the detail counts
_DETAIL_FLOOR = 1.0  # grey levels: flat, white spheres differ by nothing but noise


@dataclass(frozen=True)
class Naming:
    """The names of three spheres.

    Attributes:
        names: one of `SPHERES` for each, in the order given.
        confidence: how likely these names are against all other ways to give them, 0 to 1.
        error: mean absolute error of pixel values with which the mirror explains the others.
    """

    names: tuple[str, ...]
    confidence: float
    error: float


@dataclass(frozen=True, eq=False)
class SphereLook:
    """One sphere in some frames, as its ideal camera sees it.

    Attributes:
        radiance: linear, relative to the camera's white.
        clipped: pixels in which something is clipped, so brighter than it looks.
        detail: how much brightness changes from pixel to pixel.
        view: the ideal camera.
    """

    radiance: Float[np.ndarray, "frames pixels 3"]
    clipped: Bool[np.ndarray, "frames pixels"]
    detail: float
    view: SphereView


def name_spheres(
    cones: list[Cone], frames: list[UInt8[np.ndarray, "height width 3"]], camera: PinholeCamera
) -> Naming:
    """Distinguish three spheres by their materials."""
    looks = [look_at(cone, frames, camera) for cone in cones]
    bases = _bases(looks)
    ways = list(permutations(SPHERES))
    errors, total = [], np.empty(len(ways))
    for i, way in enumerate(ways):
        mirror, silver, diffuse = (way.index(name) for name in SPHERES)
        others = [(looks[silver], bases[mirror, silver, "matte_silver"])]
        others.append((looks[diffuse], bases[mirror, diffuse, "diffuse"]))
        errors.append(unexplained(looks[mirror], others))
        # Logarithms are averaged: a hand in some frames does not outvote the rest.
        total[i] = _WEIGHT * np.log(errors[i] + _ERROR_FLOOR).mean()
        total[i] += _odd(looks[mirror], looks[silver], _MIRROR_TO_SILVER)
        total[i] += _odd(looks[silver], looks[diffuse], _SILVER_TO_DIFFUSE)
    best = int(total.argmin())
    sure, error = float(1 / np.exp(total[best] - total).sum()), float(np.median(errors[best]))
    finer, flatter = (looks[ways[best].index(name)].detail for name in SPHERES[1:])
    if error > _DOUBTFUL and np.log(finer / flatter) < _CONTRADICTED:
        sure = min(sure, 0.5)  # one lamp that a sphere does not see turns the two round
    return Naming(ways[best], sure, error)


def _odd(one: SphereLook, other: SphereLook, expected: tuple[float, float]) -> float:
    """How unusual it is for `one` to show so much more detail than `other`."""
    ratio = np.clip(np.log(one.detail / other.detail), -3.0, expected[0])  # more is never odd
    return float(0.5 * ((ratio - expected[0]) / expected[1]) ** 2)


def look_at(
    cone: Cone, frames: list[UInt8[np.ndarray, "height width 3"]], camera: PinholeCamera
) -> SphereLook:
    """Cut a sphere out of frames with its ideal camera."""
    view = SphereView(looking_at(cone.direction), cone.angular_radius_rad, SIZE)
    u, v = mirror_ball.grid(SIZE, _FINE)
    tangent = np.tan(cone.angular_radius_rad)
    rays = np.stack([u * tangent, v * tangent, np.full_like(u, -1.0)], axis=-1)
    row, column = camera.pixel_of_directions(turned(rays, view.ball_from_camera.T))
    row, column = row.astype(np.float32), column.astype(np.float32)
    border = cv2.BORDER_REPLICATE
    cut = np.stack([cv2.remap(f, column, row, cv2.INTER_LINEAR, borderMode=border) for f in frames])
    linear = decode(cut / np.float32(255))
    shape = (len(frames), SIZE, _FINE, SIZE, _FINE, 3)
    clipped = (cut >= _CLIPPED).reshape(shape).any(axis=(2, 4, 5)).reshape(len(frames), -1)
    radiance = linear.reshape(shape).mean(axis=(2, 4)).reshape(len(frames), -1, 3)
    return SphereLook(radiance, clipped, _detail(cut), view)


def _detail(cut: UInt8[np.ndarray, "frames n n 3"]) -> float:
    """Mean bend of the pixel values, well inside the sphere."""
    size = 2 * SIZE
    within = np.hypot(*mirror_ball.grid(size)) < 0.8
    bends = []
    for frame in cut:
        grey = cv2.resize(frame, (size, size), interpolation=cv2.INTER_AREA).mean(axis=2)
        bends.append(np.abs(cv2.Laplacian(grey, cv2.CV_64F))[within].mean())
    return float(np.median(bends)) + _DETAIL_FLOOR


def _bases(
    looks: list[SphereLook],
) -> dict[tuple[int, int, str], Float[np.ndarray, "pixels lights"]]:
    """For every (mirror, other, material) the other in the light that the mirror shows."""
    bases = {}
    for mirror, other in permutations(range(len(looks)), 2):
        # The mirror's own frame stands for the camera's here, so its crop is the light as it is.
        turn = looks[other].view.ball_from_camera @ looks[mirror].view.ball_from_camera.T
        seen_from = SphereView(turn, looks[other].view.angular_radius_rad, SIZE)
        for material in SPHERES[1:]:
            bases[mirror, other, material] = _coarse_basis(material, seen_from)
    return bases


def _coarse_basis(material: str, view: SphereView) -> Float[np.ndarray, "pixels lights"]:
    """A sphere under each pixel of light, coarser and much faster than `analytic_basis`."""
    directions, inside = mirror_ball.subpixels(SIZE, 2)
    weight = inside / np.maximum(inside.sum(axis=1, keepdims=True), 1)
    weight = weight * mirror_ball.solid_angles(SIZE).reshape(-1, 1)
    normals, views = (a.reshape(-1, 3) for a in (view.normals(), view.views()))
    n_l = normals @ directions.reshape(-1, 3).T
    if material == "diffuse":
        each = brdf.lambertian(n_l)
    else:
        n_v = (normals * views).sum(axis=1, keepdims=True)
        each = brdf.rough_specular(n_l, n_v, views @ directions.reshape(-1, 3).T)
    basis = (each * weight.ravel()).reshape(len(normals), SIZE**2, -1).sum(axis=2)
    white = np.maximum(basis.sum(axis=1, keepdims=True), 1e-9)
    basis *= brdf.REFLECTIVITY[material] / white
    basis[~view.mask().ravel()] = 0
    return basis


def unexplained(
    mirror: SphereLook, others: list[tuple[SphereLook, Float[np.ndarray, "pixels lights"]]]
) -> Float[np.ndarray, "frames"]:
    """Mean absolute error of pixel values of two spheres in the mirror's light, each frame."""
    parts = [(look, basis, basis.any(axis=1)) for look, basis in others]
    bases = np.concatenate([basis[shown] for _, basis, shown in parts])
    errors = []
    for i, radiance in enumerate(mirror.radiance):
        seen = np.concatenate([look.radiance[i][shown] for look, _, shown in parts])
        clipped = np.concatenate([look.clipped[i][shown] for look, _, shown in parts])
        light = radiance / brdf.REFLECTIVITY["mirror"]
        made = brightest(bases, light, mirror.clipped[i], seen, clipped)
        off = encode(np.minimum(made, 1.0)) - encode(np.minimum(seen, 1.0))
        off[clipped[:, None] & (off > 0)] = 0
        errors.append(np.abs(off).mean())
    return np.array(errors)


def brightest(
    basis: Float[np.ndarray, "pixels lights"],
    light: Float[np.ndarray, "lights 3"],
    free: Bool[np.ndarray, "lights"],
    seen: Float[np.ndarray, "pixels 3"],
    clipped: Bool[np.ndarray, "pixels"],
) -> Float[np.ndarray, "pixels 3"]:
    """The spheres under the light that explains them best, its `free` pixels as bright as suits.

    Errors count as errors of pixel values, and a sphere's own clipped pixels may be brighter than
    they look. Projected gradient with momentum that starts anew where it overshoots (Beck &
    Teboulle 2009; O'Donoghue & Candes 2015): a sun in one pixel takes hundreds of plain steps.
    """
    slope = 1 / np.maximum(seen, 0.02) ** 0.55
    known, columns = basis @ light, basis[:, free]
    weighted = known * slope**2
    weight = max(float((weighted * known).sum()), 1e-9)
    power = (slope**2).max() * max(_largest_power(columns), 1e-9) if free.any() else 1.0
    extra = ahead = np.zeros((columns.shape[1], 3))
    level, momentum = 1.0, 1.0
    for _ in range(_ROUNDS):
        made = columns @ ahead
        target = np.where(clipped[:, None], np.maximum(seen, level * known + made), seen)
        level = float(np.clip((weighted * (target - made)).sum() / weight, *_LEVELS))
        off = (level * known + made - target) * slope**2
        new = np.maximum(ahead - columns.T @ off / power, 0)
        step, back = new - extra, float(((ahead - new) * (new - extra)).sum())
        extra = new
        if np.abs(step).max(initial=0) <= _SETTLED * np.abs(new).max(initial=0):
            break
        following = 1.0 if back > 0 else (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = new if back > 0 else new + (momentum - 1) / following * step
        momentum = following
    return level * known + columns @ extra


def _largest_power(columns: Float[np.ndarray, "pixels lights"]) -> float:
    """Square of the largest singular value, by power iteration: no entry is negative, so that
    it settles in a few rounds; a decomposition costs a hundred times as much."""
    along = np.ones(columns.shape[1])
    for _ in range(10):
        along = columns.T @ (columns @ along)
        along /= max(float(np.linalg.norm(along)), 1e-30)
    return float(np.linalg.norm(columns @ along)) ** 2
