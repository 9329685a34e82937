"""The surface that objects stand on: how much it reflects, and what the photo shows of it.

An object sees the surface as a plane. Around the objects that plane carries the photo's own pixels,
projected onto it from the camera, so that a mirror reflects them and light bounces off them; where
the photo shows nothing of it, it has the mean colour.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera_response import LUMINANCE
from deeplight.compose.composite import radiance_of
from deeplight.compose.ground import Viewpoint
from deeplight.compose.scene import Colour, Solid, Texture, irradiance_on_plane

ALBEDO_LIMITS = (0.03, 0.90)  # from fresh asphalt to fresh snow
_PATCH = 0.8  # radius of the surface looked at for its albedo, in sizes of the object
_REACH = 4.0  # half the side of the square that has a texture, in sizes of the group of objects
_TEXELS = 320  # along that side
_FADING = 0.12  # of the photo's shorter side and of the square: where the texture gives way


@dataclass(frozen=True, eq=False)
class Surface:
    """What the photo says of the surface.

    Attributes:
        albedo: of the plane, its luminance within `ALBEDO_LIMITS`.
        measured: the same as measured.
        radiance: median of the photo's pixels around the objects.
    """

    albedo: Colour
    measured: Colour
    radiance: Colour


def surface_of(
    photo: UInt8[np.ndarray, "height width 3"],
    light: Float[np.ndarray, "rows columns 3"],
    viewpoint: Viewpoint,
    solids: Sequence[Solid],
) -> Surface:
    """Measure the surface around where the objects stand.

    The median of the photo's own pixels there, over the light that falls there:
    albedo = pi x radiance / irradiance.
    """
    around = np.concatenate([_footprint(solid) for solid in solids])
    pixels = np.floor(viewpoint.pixels(around))
    height, width, _ = photo.shape
    seen = (pixels >= 0).all(1) & (pixels < [width, height]).all(1)  # false for nan
    columns, rows = pixels[seen].astype(int).T
    patch = photo[rows, columns][None] if len(rows) else photo[-1:, :]
    radiance: Colour = np.median(radiance_of(patch)[0], axis=0)
    irradiance = np.maximum(irradiance_on_plane(light, viewpoint), 1e-9)
    measured = np.pi * radiance / irradiance
    return Surface(limited(measured), measured, radiance)


def limited(albedo: Colour) -> Colour:
    """The albedo brought into `ALBEDO_LIMITS` by one factor, so that it keeps its colour.

    A limit for each channel would make a dark red surface throw purple light.
    """
    low, high = ALBEDO_LIMITS
    luminance = max(float(albedo @ LUMINANCE), 1e-9)
    factor = np.clip(luminance, low, high) / luminance
    factor = min(factor, high / max(float(albedo.max()), 1e-9))
    return albedo * factor


def texture_of(
    photo: UInt8[np.ndarray, "height width 3"],
    viewpoint: Viewpoint,
    solids: Sequence[Solid],
    surface: Surface,
) -> Texture:
    """Project the photo onto the plane around the objects.

    What the photo does not show has the surface's albedo, and towards there the texture fades.
    """
    points = np.concatenate([solid.vertices for solid in solids])
    low, high = points.min(0), points.max(0)
    half_side = _REACH * float(np.linalg.norm(high - low))
    centre = ((low + high) / 2)[[0, 2]]
    fine = 2 * _TEXELS
    steps = ((np.arange(fine) + 0.5) / fine * 2 - 1) * half_side
    x, z = np.meshgrid(centre[0] + steps, centre[1] - steps)  # the first row is the nearest
    seen = viewpoint.pixels(np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3))
    rim = np.clip((1 - np.abs(steps) / half_side) / _FADING, 0, 1)
    weight = _known(seen, photo.shape[1], photo.shape[0]) * np.minimum(rim[:, None], rim).ravel()
    known = weight > 0
    albedo = np.tile(surface.albedo, (fine * fine, 1))
    relative = _looked_up(photo, seen[known]) / np.maximum(surface.radiance, 1e-4)
    shown = np.clip(surface.albedo * relative, 0, ALBEDO_LIMITS[1])
    albedo[known] += (shown - surface.albedo) * weight[known, None]
    mean = albedo.reshape(_TEXELS, 2, _TEXELS, 2, 3).mean((1, 3))
    return Texture((float(centre[0]), float(centre[1])), half_side, mean.astype(np.float32))


def _known(pixels: Float[np.ndarray, "n 2"], width: int, height: int) -> Float[np.ndarray, " n"]:
    """1 inside the photo, falling to 0 at its edges and outside."""
    inside = np.minimum(pixels, np.array([width, height]) - pixels).min(1)
    inside = np.where(np.isfinite(inside), inside, 0)  # nan: behind the camera
    known: np.ndarray = np.clip(inside / (_FADING * min(width, height)), 0, 1)
    return known


def _looked_up(
    photo: UInt8[np.ndarray, "height width 3"], pixels: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """Radiance between the photo's pixels, bilinear; outside, its edge goes on."""
    height, width, _ = photo.shape
    levels = np.repeat(np.arange(256, dtype=np.uint8)[:, None, None], 3, axis=2)
    table = radiance_of(levels)[:, 0]
    at = np.clip(pixels - 0.5, 0, [width - 1, height - 1])
    first = np.minimum(at.astype(int), [max(width - 2, 0), max(height - 2, 0)])
    (across, down), (left, top) = (at - first).T[..., None], first.T
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    colours = np.arange(3)
    rows = [
        table[photo[row, left], colours] * (1 - across) + table[photo[row, right], colours] * across
        for row in (top, bottom)
    ]
    found: np.ndarray = rows[0] * (1 - down) + rows[1] * down
    return found


def _footprint(solid: Solid) -> Float[np.ndarray, "n 3"]:
    """Points of the plane around and below one object, evenly spread over a disc."""
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    number = np.arange(600)
    radius = _PATCH * float((high - low).max()) * np.sqrt((number + 0.5) / 600)
    angle = number * np.pi * (3 - np.sqrt(5))
    disc = np.stack([radius * np.cos(angle), np.zeros(600), radius * np.sin(angle)], -1)
    centre: np.ndarray = (low + high) / 2 * [1, 0, 1]
    return centre + disc
