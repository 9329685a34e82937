"""What the rivals learn from: views into HDR panoramas, as a phone shows them, with their light."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.camera import LANDSCAPE_HEIGHT, LANDSCAPE_WIDTH, TRAINED_CAMERA, PinholeCamera
from deeplight.frames import rotation, turned
from deeplight.mappings import latlong, resample
from deeplight.simulate.phone import PHONES, develop, draw_automatics, metered
from deeplight.simulate.take import hand_held

HEIGHT = 64
"""Rows of the panoramas that are learnt."""
# Section 4.3: the middle 1080 x 810 of the 1080 x 1920 frame.
LANDSCAPE_FOV_RAD = float(
    2 * np.arctan(TRAINED_CAMERA.tangents[0] * LANDSCAPE_HEIGHT / LANDSCAPE_WIDTH)
)
_NOISE_PIXELS = 30


@dataclass(frozen=True)
class ViewPlan:
    """Which views are taken.

    Attributes:
        width, height: pixels of a view.
        per_panorama: views of each, at random azimuths.
        elevation_deg: they look up or down by at most that; 0: as a data set's phones are held
            (`simulate.take.hand_held`), mostly downward.
        fov_deg: least and greatest vertical field of view.
    """

    width: int = 192
    height: int = 144
    per_panorama: int = 8
    elevation_deg: float = 30.0
    fov_deg: tuple[float, float] = (
        float(np.degrees(LANDSCAPE_FOV_RAD)),
        float(np.degrees(LANDSCAPE_FOV_RAD)),
    )


@dataclass(frozen=True, eq=False)
class Pair:
    """A view and the light around it.

    Attributes:
        photo: 8-bit.
        place: the panorama of `HEIGHT` rows, in its own frame and scale; its views share it.
        column: of `place` that the camera looks to.
        gain: red, green and blue of the camera's white over those of `place`.
        elevation_rad: of the camera, positive up.
        fov_rad: vertical.
        mirrored: `place` is mirrored, left to right, after it was turned.
    """

    photo: UInt8[np.ndarray, "height width 3"]
    place: Float32[np.ndarray, "rows columns 3"]
    column: int
    gain: Float[np.ndarray, "3"]
    elevation_rad: float
    fov_rad: float
    mirrored: bool = False

    @property
    def panorama(self) -> Float32[np.ndarray, "rows columns 3"]:
        """Upright, its centre column where the camera looks; relative to the camera's white."""
        light = np.roll(self.place, -self.column, axis=1) * self.gain
        return np.ascontiguousarray(light[:, ::-1] if self.mirrored else light, np.float32)

    def level(self, direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
        """A direction of `place` as `panorama` has it."""
        seen = rotation("y", self.column * np.pi / HEIGHT) @ direction
        return seen * np.array([-1.0, 1.0, 1.0]) if self.mirrored else np.asarray(seen)

    def mirror(self) -> "Pair":
        """The view of the mirrored place."""
        photo = np.ascontiguousarray(self.photo[:, ::-1])
        return replace(self, photo=photo, mirrored=not self.mirrored)


def pairs_of(
    panorama: Float[np.ndarray, "rows columns 3"], views: ViewPlan, random: np.random.Generator
) -> Iterator[Pair]:
    """Take views of one panorama with a phone's automatic exposure and white balance."""
    small = resample.shrink_latlong(panorama, HEIGHT).astype(np.float32)
    for _ in range(views.per_panorama):
        shift = int(random.integers(HEIGHT * 2))
        azimuth = shift * np.pi / HEIGHT
        elevation = drawn_elevation(views, random)
        fov = float(np.radians(random.uniform(*views.fov_deg)))
        rays = PinholeCamera(views.width, views.height, fov).rays()
        world = rotation("y", -azimuth) @ rotation("x", elevation)
        radiance = resample.sample_latlong(panorama, turned(rays, world)).astype(np.float32)
        automatics = draw_automatics(PHONES["paper"], random)
        weight = latlong.solid_angles(*small.shape[:2])
        illuminant = np.average(small, axis=(0, 1), weights=weight)
        gain = metered(radiance[::4, ::4].reshape(-1, 3), illuminant, automatics).gain
        photo = develop(radiance, gain, automatics, _NOISE_PIXELS, random)
        yield Pair(photo, small, shift, np.broadcast_to(gain, 3), elevation, fov)


def drawn_elevation(views: ViewPlan, random: np.random.Generator) -> float:
    """Of a camera, in radians, positive up."""
    if views.elevation_deg:
        return float(np.radians(random.uniform(-1, 1) * views.elevation_deg))
    (pose,) = hand_held(1, random)
    return float(np.arcsin(-pose[1, 2]))  # the camera looks along its -Z


def all_pairs(
    panoramas: Sequence[Float[np.ndarray, "rows columns 3"]], views: ViewPlan, seed: int = 0
) -> list[Pair]:
    """The views of all panoramas, in their order."""
    random = np.random.default_rng(seed)
    return [pair for panorama in panoramas for pair in pairs_of(panorama, views, random)]
