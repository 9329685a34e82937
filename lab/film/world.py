"""The place of a clip: a panorama that a walk moves through, finer than its file.

Two things a panorama lacks, both our choice. Parallax: what it shows stands on a floor at the
height it was taken from and on a dome around it, so that a step moves what is near. Fine
texture: noise of several octaves multiplies the radiance, its mean 1, fixed to the world,
weaker in smooth sky; a 1024 x 512 panorama has one texel for ten pixels of a phone's film.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from deeplight import brdf
from deeplight.camera_response import LUMINANCE
from deeplight.frames import Directions, normalised
from deeplight.mappings import latlong, resample

FLOOR_M = 1.4  # below the panorama's place, and the height a phone is held at
DOME_M = {"indoor": 4.0, "outdoor": 15.0}
MATERIALS = ("diffuse", "matte_silver", "mirror")  # rows of `World.glossy`
GLOSSY_HEIGHT = 32

_LEVELS = 4  # panorama rows 512, 256, 128, 64
_SURFACE, _SKY = 0.30, 0.03  # amplitude of the texture
_TILE = 2048
_FINEST, _COARSEST = 11, 700  # wavelengths in texels of the tile


@dataclass(frozen=True, eq=False)
class World:
    """A place to film in.

    Attributes:
        levels: the panorama at full, half, quarter ... size, linear radiance.
        glossy: for each of `MATERIALS` what a surface of reflectivity 1 shows that reflects
            towards a direction (the diffuse one: that faces it), as small panoramas.
        amplitude: of the fine texture, as a panorama.
        dome_m: how far away everything above the floor is.
        floor_m: how far below the panorama's place the floor is.
    """

    levels: tuple[Float[np.ndarray, "_height _width 3"], ...]
    glossy: Float[np.ndarray, "materials small_height small_width 3"]
    amplitude: Float[np.ndarray, "quarter_height quarter_width 1"]
    dome_m: float
    floor_m: float = FLOOR_M

    def seen(self, place_m: Float[np.ndarray, "3"], directions: Directions) -> Directions:
        """The panorama's direction of what is seen from `place_m` along world directions."""
        return normalised(self.points_m(place_m, directions))

    def points_m(self, place_m: Float[np.ndarray, "3"], directions: Directions) -> Directions:
        """Where rays from `place_m` meet the floor or the dome, from the panorama's place."""
        along = directions @ place_m.astype(directions.dtype)
        reach = np.sqrt(along * along - float(place_m @ place_m) + self.dome_m**2) - along
        down = np.minimum(directions[..., 1], -1e-6)
        reach = np.minimum(reach, (-self.floor_m - float(place_m[1])) / down)
        return place_m.astype(directions.dtype) + reach[..., None] * directions

    def radiance(self, directions: Directions, level: int = 0) -> Float[np.ndarray, "*n 3"]:
        """Radiance in directions of the panorama, at one of its sizes."""
        return resample.sample_latlong(self.levels[level], directions)

    def texture_at(self, directions: Directions) -> Float[np.ndarray, "*n 1"]:
        """Amplitude of the fine texture in directions of the panorama."""
        return resample.sample_latlong(self.amplitude, directions)


def build_world(
    panorama: Float[np.ndarray, "height width 3"], scene: str, texture: float = 1.0
) -> World:
    """The place of a panorama.

    Args:
        panorama: radiance in any scale.
        scene: "indoor" or "outdoor": how far the dome is, and whether there is sky.
        texture: strength of the fine texture; 0 leaves it out.
    """
    levels = [np.ascontiguousarray(panorama, np.float32)]
    while len(levels) < _LEVELS and len(levels[-1]) > 64:
        levels.append(resample.shrink_latlong(levels[-1], len(levels[-1]) // 2))
    amplitude = texture * _texture_amplitude(levels[min(2, len(levels) - 1)], scene)
    return World(tuple(levels), _glossy(panorama), amplitude, DOME_M[scene])


@lru_cache(maxsize=2)
def noise_tile(seed: int) -> Float[np.ndarray, "tile tile"]:
    """Periodic noise between -1 and 1 with mean 0: equal strength in every octave (read-only)."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.standard_normal((_TILE, _TILE), np.float32))
    rows, columns = np.fft.fftfreq(_TILE)[:, None], np.fft.rfftfreq(_TILE)[None]
    frequency = np.hypot(rows, columns)
    band = (frequency < 1 / _FINEST) & (frequency > 1 / _COARSEST)
    spectrum *= np.where(band, 1 / np.maximum(frequency, 1e-9), 0)
    noise = np.fft.irfft2(spectrum, (_TILE, _TILE))
    noise = np.tanh(0.9 * noise / noise.std())
    noise = (noise - noise.mean()).astype(np.float32)
    noise.setflags(write=False)
    return noise


def _texture_amplitude(
    radiance: Float[np.ndarray, "height width 3"], scene: str
) -> Float[np.ndarray, "height width 1"]:
    """Strong on surfaces; outdoors above the horizon it follows the panorama's own roughness."""
    height = len(radiance)
    amplitude = np.full((*radiance.shape[:2], 1), _SURFACE, np.float32)
    if scene == "outdoor":
        bright = np.log(np.maximum(radiance @ LUMINANCE, 1e-9))
        steps = abs(np.diff(bright, axis=1, append=bright[:, :1]))
        steps += abs(np.diff(bright, axis=0, append=bright[-1:]))
        rough = resample.shrink(steps[..., None], height // 4, radiance.shape[1] // 4)
        rough = rough.repeat(4, axis=0).repeat(4, axis=1)
        share = np.clip(rough / 0.25, 0, 1)
        above = slice(0, round(height * 0.48))
        amplitude[above] = _SKY + (_SURFACE - _SKY) * share[above]
    return amplitude


def _glossy(
    panorama: Float[np.ndarray, "height width 3"],
) -> Float[np.ndarray, "3 small_height small_width 3"]:
    """What unit reflectors show: for things seen in the spheres, which are small."""
    small = resample.shrink_latlong(panorama, GLOSSY_HEIGHT)
    shown = [(lobe @ small.reshape(-1, 3)).reshape(small.shape) for lobe in _lobes(len(small))]
    return np.stack([*shown, small])


@lru_cache(maxsize=1)
def _lobes(height: int) -> tuple[Float[np.ndarray, "texels texels"], ...]:
    """How much each texel of a panorama counts for the reflection in each, matte and rough."""
    sources = latlong.directions(height, 2 * height).reshape(-1, 3)
    solid_angle = latlong.solid_angles(height, 2 * height).reshape(-1)
    cosine = sources @ sources.T
    result = []
    for lobe in (
        brdf.lambertian(cosine),
        brdf.rough_specular(cosine, np.ones_like(cosine), cosine),
    ):
        weights = lobe * solid_angle
        weights = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
        weights.setflags(write=False)
        result.append(weights)
    return tuple(result)
