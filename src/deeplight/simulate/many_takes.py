"""Takes of the family of phones: one camera each, held anywhere a hand holds it.

`take.film` films recipe v1 and stays as it is. Here the photo is developed by a phone's processing
and brought to the trained view as `preprocess` does it; the spheres show the light itself, through
exposure, white balance and colour matrix but not through the lens or the curve; and the light is
gathered faster (`place_light`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float32, UInt8

from deeplight.camera import (
    BACKGROUND_FRACTION,
    BACKGROUND_HEIGHT,
    BACKGROUND_WIDTH,
    FRAME_HEIGHT,
    FRAME_WIDTH,
    TRAINED_VERTICAL_FOV_RAD,
    PinholeCamera,
)
from deeplight.camera_response import GAMMA, encode
from deeplight.frames import Rotation, turned, world_from_camera
from deeplight.io.photos import decode_rgb, encode_jpeg
from deeplight.lighting import LIGHTING_SIZE, Lighting
from deeplight.mappings import mirror_ball
from deeplight.reflectance import analytic_basis
from deeplight.simulate.many_phones import Optics, PhoneSettings
from deeplight.simulate.phone import Setting, follow, metered, vignetting
from deeplight.simulate.place_light import PlaceLight
from deeplight.simulate.processing import in_srgb, process
from deeplight.simulate.take import Frame
from deeplight.sphere import Rig, SphereView

_FINE, _COARSE = 128, 64
_LIT_BY = {"mirror": _FINE, "matte_silver": _COARSE, "diffuse": LIGHTING_SIZE}
"""Pixels along the ball of light that each sphere needs: a rougher one blurs the rest away."""
_SENSOR_PIXELS = 64  # behind each pixel of the small photo, before noise reduction
_DOWN, _UP = np.radians(-80.0), np.radians(25.0)


@dataclass(frozen=True)
class Pixels:
    """Which of the network's pixels a photo shows, and rays through these.

    Attributes:
        rows, columns: for every pixel of the input the visible row or column that it repeats,
            as `preprocess` lets edge pixels go on.
        rays: through the visible pixels, camera frame, not normalised.
        place: (x, y) of the visible pixels in the photo, each -1 to 1.
    """

    rows: np.ndarray
    columns: np.ndarray
    rays: Float32[np.ndarray, "visible_rows visible_columns 3"]
    place: tuple[np.ndarray, np.ndarray]


def visible_pixels(optics: Optics) -> Pixels:
    """The trained view's pixels in a photo with these optics."""
    half_high = np.tan(TRAINED_VERTICAL_FOV_RAD / 2) * optics.view_scale
    half_wide = half_high * FRAME_WIDTH / FRAME_HEIGHT
    rows = BACKGROUND_HEIGHT / BACKGROUND_FRACTION
    y = (1 - (np.arange(BACKGROUND_HEIGHT) + 0.5) * (2 / rows)) * half_high
    x = ((np.arange(BACKGROUND_WIDTH) + 0.5) * (2 / BACKGROUND_WIDTH) - 1) * half_wide
    wide, high = optics.tangents
    shown_rows, shown_columns = np.flatnonzero(abs(y) <= high), np.flatnonzero(abs(x) <= wide)
    x, y = x[shown_columns], y[shown_rows]
    plane = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), -1.0)], axis=-1)
    return Pixels(
        np.clip(np.arange(BACKGROUND_HEIGHT), shown_rows[0], shown_rows[-1]) - shown_rows[0],
        np.clip(np.arange(BACKGROUND_WIDTH), shown_columns[0], shown_columns[-1])
        - shown_columns[0],
        plane.astype(np.float32),
        (x / wide, y / high),
    )


def film_many(
    place: PlaceLight,
    phone: PhoneSettings,
    rig: Rig,
    frames: int,
    rng: np.random.Generator,
    looks_up: bool = False,
) -> Iterator[Frame]:
    """Film one take.

    Args:
        place: its light; its own scale does not matter.
        phone: the camera as it is set.
        rig: where the three spheres are held.
        frames: how many, a fraction of a second apart.
        rng: decides how the phone is held, and the noise.
        looks_up: keep to the sky, for panoramas whose ground is made up.
    """
    poses = list(held_anywhere(frames, rng, looks_up))
    balls = [place.ball(_FINE, pose) for pose in poses]
    spheres = sphere_radiance(rig, balls)
    pixels = visible_pixels(phone.optics)
    setting = None
    for number, (pose, ball) in enumerate(zip(poses, balls, strict=True)):
        radiance = {name: values[..., number, :] for name, values in spheres.items()}
        illuminant = radiance["diffuse"][rig.views["diffuse"].mask()].mean(axis=0)
        seen = place.seen(turned(phone.metered_rays().astype(np.float32), pose))
        setting = follow(
            setting, metered(seen, illuminant, phone.automatics), phone.automatics.speed
        )
        photo = _photo(place, pose, phone, pixels, setting.gain, rng)
        jpeg = encode_jpeg(photo, phone.automatics.jpeg_quality)
        crops = {
            name: _crop(values, rig.views[name], place, pose, phone, setting.gain, rng)
            for name, values in radiance.items()
        }
        light = in_srgb(halved(halved(ball)) * setting.gain, phone.processing)
        known = facts(place, phone, pose, setting)
        yield Frame(decode_rgb(jpeg), jpeg, crops, Lighting(light), pose, setting, known)


def held_anywhere(
    frames: int, rng: np.random.Generator, looks_up: bool = False
) -> Iterator[Rotation]:
    """Poses of a hand-held phone, world_from_camera of each frame.

    Most look a little down; some far down, at a table or the floor; one in eight is tilted.
    """
    yaw, turn = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.12)
    pitch = rng.normal(-0.22, 0.26) if rng.random() < 0.7 else rng.uniform(_DOWN, -0.35)
    low, high = _DOWN, _UP
    if looks_up:
        low, high, pitch = 0.3, 0.8, rng.normal(0.45, 0.1)
    roll = rng.normal(0, 0.25 if rng.random() < 0.125 else 0.05)
    for _ in range(frames):
        shake = rng.normal(0, 0.01, 3)
        held = float(np.clip(pitch + shake[1], low, high))
        yield world_from_camera(yaw + shake[0], held, roll + shake[2])
        yaw += turn
        turn += rng.normal(0, 0.03)
        pitch += rng.normal(0, 0.05)
        roll = 0.9 * roll + rng.normal(0, 0.012)


def facts(
    place: PlaceLight, phone: PhoneSettings, pose: Rotation, setting: Setting
) -> Mapping[str, Any]:
    """What is exactly true of a frame and what a phone may know of it; plain JSON values.

    `exposure_stops` is log2 of the gain on the place's mean luminance, which no phone knows: 0
    brings it to white. `ev100` is what its EXIF would state, were the place as bright as assumed.
    `white_balance` is ln of the gain of each channel over green's. Angles are in radians, pitch
    upwards, roll counter-clockwise as the holder sees it. `view_fov_rad` is the vertical field of
    view of the frame whose upper 80 % the network sees: 66 degrees where the photo's is known.
    """
    gain = np.array(setting.log_gain)
    view = -pose[:, 2]
    automatics, processing = phone.automatics, phone.processing
    exposure = (gain.mean() + np.log(max(place.mean_luminance, 1e-30))) / np.log(2)
    values = {
        "exposure_stops": exposure,
        "ev100": place.ev100 - exposure,
        "pitch_rad": np.arctan2(view[1], np.hypot(view[0], view[2])),
        "roll_rad": np.arctan2(pose[1, 0], pose[1, 1]),
        "vertical_fov_rad": phone.optics.vertical_fov_rad,
        "view_fov_rad": phone.optics.view_fov_rad,
        "aspect": phone.optics.aspect,
        "height": place.height,
        "adaptation": automatics.adaptation,
        "bias_stops": automatics.bias_stops,
        "gamma": processing.gamma,
        "contrast": processing.contrast,
        "local": processing.local,
        "headroom": processing.headroom,
    }
    return {
        "white_balance": [round(float(g - gain[1]), 5) for g in gain],
        "fov_known": phone.optics.fov_known,
        "metering": phone.metering,
        **{name: round(float(value), 5) for name, value in values.items()},
    }


def sphere_radiance(
    rig: Rig, balls: list[Float32[np.ndarray, "light light 3"]]
) -> dict[str, Float32[np.ndarray, "size size frames 3"]]:
    """Scene radiance of each sphere of a rig under several balls of light at once.

    The weights are read once for all of them: reading them is most of the work.
    """
    lights = {len(balls[0]): balls}
    for size in (_COARSE, LIGHTING_SIZE):
        lights[size] = [halved(ball) for ball in lights[2 * size]]
    weights = _weights_of(rig)
    return {
        name: weights[name].relit(np.stack([b.reshape(-1, 3) for b in lights[_LIT_BY[name]]], 1))
        for name in rig.views
    }


def halved(ball: Float32[np.ndarray, "size size 3"]) -> Float32[np.ndarray, "half half 3"]:
    """A mirror ball at half its size, the light of each four pixels added up."""
    power = ball * mirror_ball.coverage(len(ball)).astype(np.float32)[..., None]
    return _four_together(power) / _covered(len(ball))


def _four_together(values: np.ndarray) -> np.ndarray:
    pairs = values[::2] + values[1::2]
    result: np.ndarray = pairs[:, ::2] + pairs[:, 1::2]
    return result


@lru_cache(maxsize=4)
def _covered(size: int) -> Float32[np.ndarray, "half half 1"]:
    """Pixels' worth of light in each four pixels of a ball."""
    covered = _four_together(mirror_ball.coverage(size))[..., None]
    return np.maximum(covered, 1e-9).astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Weights:
    """A basis without its zeros: rows of what shows the sphere, columns of what holds light.

    A mirror's rows hold a few weights each and are kept as (column, weight) lists.
    """

    size: int
    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray
    starts: np.ndarray | None = None

    def relit(
        self, light: Float32[np.ndarray, "lights frames 3"]
    ) -> Float32[np.ndarray, "size size frames 3"]:
        shape = light.shape[1:]
        flat = light.reshape(len(light), -1)[self.columns]
        if self.starts is None:
            shown = self.values @ flat
        else:
            shown = np.add.reduceat(flat * self.values[:, None], self.starts, axis=0)
        result = np.zeros((self.size**2, flat.shape[1]), np.float32)
        result[self.rows] = shown
        return result.reshape(self.size, self.size, *shape)


@lru_cache(maxsize=4)
def _weights_of(rig: Rig) -> dict[str, _Weights]:
    result = {}
    for name, view in rig.views.items():
        weights = analytic_basis(name, view, _LIT_BY[name]).weights
        rows = np.flatnonzero(weights.any(axis=1))
        if name == "mirror":
            row, column = np.nonzero(weights)
            starts = np.flatnonzero(np.diff(row, prepend=-1))
            result[name] = _Weights(view.size, rows, column, weights[row, column], starts)
        else:
            columns = np.flatnonzero(weights.any(axis=0))
            kept = np.ascontiguousarray(weights[np.ix_(rows, columns)])
            result[name] = _Weights(view.size, rows, columns, kept)
    return result


def _photo(
    place: PlaceLight,
    pose: Rotation,
    phone: PhoneSettings,
    pixels: Pixels,
    gain: np.ndarray,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "height width 3"]:
    """The network's view of the phone's photo, before its JPEG."""
    x, y = pixels.place
    lens = vignetting(y[:, None], x[None, :], phone.automatics).astype(np.float32)[..., None]
    linear = place.seen(turned(pixels.rays, pose)) * (gain * lens)
    noisy = _with_noise(linear, phone.automatics.noise / _SENSOR_PIXELS, rng)
    photo = process(in_srgb(noisy, phone.processing), phone.processing)
    return photo[pixels.rows[:, None], pixels.columns[None, :]]


def _crop(
    sphere: Float32[np.ndarray, "size size 3"],
    view: SphereView,
    place: PlaceLight,
    pose: Rotation,
    phone: PhoneSettings,
    gain: np.ndarray,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "size size 3"]:
    """The 8-bit crop: light as it reaches the phone, clipped at white, plain gamma 2.2.

    No lens and no curve: they would darken and bend what the network is to learn.
    """
    around, rays, alpha = _rim(view)
    linear = sphere.copy()
    behind = place.seen(turned(rays, pose))
    linear[around] = linear[around] * alpha + behind * (1 - alpha)
    noisy = _with_noise(linear * gain, phone.automatics.noise / _SENSOR_PIXELS, rng)
    pixel = encode(np.minimum(in_srgb(noisy, phone.processing), 1), GAMMA)
    return np.round(pixel * 255).astype(np.uint8)


@lru_cache(maxsize=16)
def _rim(view: SphereView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels of a crop that show what is behind the sphere, rays through them, their alpha."""
    around = view.alpha() < 1
    ideal = PinholeCamera(view.size, view.size, 2 * view.angular_radius_rad)
    rays = turned(ideal.rays(), view.ball_from_camera.T)[around].astype(np.float32)
    return around, rays, view.alpha()[around][:, None].astype(np.float32)


def _with_noise(
    linear: Float32[np.ndarray, "height width 3"], variance: float, rng: np.random.Generator
) -> Float32[np.ndarray, "height width 3"]:
    deviation = np.clip(linear, 0.01, 1)
    deviation *= np.float32(variance)
    noise = rng.standard_normal(linear.shape, np.float32)
    noise *= np.sqrt(deviation, out=deviation)
    noise += linear
    return noise


def drawn_height(rng: np.random.Generator) -> float:
    """How high a take is filmed: half at the panorama's own height, else from 0.6 to 1.5 of it."""
    return float(np.exp(rng.uniform(np.log(0.6), np.log(1.5)))) if rng.random() < 0.5 else 1.0
