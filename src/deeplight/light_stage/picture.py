"""A measured basis to look at: furnace, single lights, and relit next to the analytic sphere."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, UInt8

from deeplight import brdf
from deeplight.camera_response import CameraResponse
from deeplight.dataset.contact_sheet import column, enlarged, label, row
from deeplight.frames import turned
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball
from deeplight.reflectance import ReflectanceBasis, analytic_basis
from deeplight.relight import relight

Picture = UInt8[np.ndarray, "_ _ 3"]  # any height and width

TILE = 96
GAP = 4
LIGHTS_BALL = (  # in the sphere's own frame: front, right, up, left, down, four from behind
    (0.0, 0.0, 1.0), (1.0, 0.0, 0.3), (0.0, 1.0, 0.3), (-1.0, 0.0, 0.3), (0.0, -1.0, 0.3),
    (0.9, 0.5, -0.5), (-0.9, 0.5, -0.5), (0.0, 0.6, -0.8),
)  # fmt: skip
_RESPONSE = CameraResponse()


def basis_picture(bases: Mapping[str, ReflectanceBasis]) -> Picture:
    """One strip a sphere: furnace, made-up light by this basis and by the analytic one, lights."""
    return column([_strip(name, basis) for name, basis in bases.items()], 2 * GAP)


def made_up_light(size: int) -> Lighting:
    """A sky, a floor, two coloured windows and a small lamp: no symmetry to hide a flip."""
    directions = mirror_ball.pixel_directions(size)
    radiance = np.maximum(0.25 + 0.2 * directions[..., 1:2], 0) * np.array([0.7, 0.9, 1.0])
    for towards, half_angle_deg, colour in (
        ((-0.9, 0.2, 0.4), 30, (1.5, 0.9, 0.4)),
        ((0.6, 0.1, 0.8), 20, (0.05, 0.2, 0.9)),
        ((0.5, 0.8, 0.3), 7, (20.0, 18.0, 15.0)),
    ):
        cosine = directions @ (np.array(towards) / np.linalg.norm(towards))
        radiance = radiance + (cosine > np.cos(np.radians(half_angle_deg)))[..., None] * colour
    return Lighting(radiance.astype(np.float32))


def _strip(name: str, basis: ReflectanceBasis) -> Picture:
    light = made_up_light(basis.light_size)
    furnace = np.repeat(basis.furnace()[..., None], 3, axis=2)
    tiles = [_tile(furnace, "furnace"), _tile(relight(basis, light), "relit")]
    if name in brdf.REFLECTIVITY:
        analytic = relight(analytic_basis(name, basis.view, basis.light_size), light)
        tiles.append(_tile(analytic, "analytic"))
    tiles += [_tile(lit, f"light {n + 1}") for n, lit in enumerate(_single_lights(basis))]
    return column([label(name, TILE), row(tiles, GAP)])


def _single_lights(basis: ReflectanceBasis) -> list[Float[np.ndarray, "size size 3"]]:
    """Basis images as lit by one light whose irradiance is pi: a white diffuser shows 1."""
    directions = np.array(LIGHTS_BALL) / np.linalg.norm(LIGHTS_BALL, axis=1, keepdims=True)
    camera = turned(directions, basis.view.ball_from_camera.T)
    pixels = mirror_ball.pixel_of_directions(camera, basis.light_size)
    solid_angle = mirror_ball.solid_angles(basis.light_size).ravel()
    size = basis.view.size
    images = []
    for pixel in pixels:
        image = basis.weights[:, pixel].reshape(size, size, 1) * np.pi / solid_angle[pixel]
        images.append(np.repeat(image, 3, axis=2).astype(np.float32))
    return images


def _tile(radiance: Float[np.ndarray, "size size 3"], text: str) -> Picture:
    pixels = _RESPONSE.pixel_from_radiance(radiance.astype(np.float32))
    picture = np.floor(pixels * 255 + 0.5).astype(np.uint8)
    return column([enlarged(picture, TILE), label(text, TILE)])
