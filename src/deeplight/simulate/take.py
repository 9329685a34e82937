"""One take: a phone with the rig in front of it, held and moved by a hand inside a panorama."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import (
    BACKGROUND_FRACTION,
    BACKGROUND_HEIGHT,
    BACKGROUND_WIDTH,
    FRAME_HEIGHT,
    PinholeCamera,
)
from deeplight.frames import Rotation, turned, world_from_camera
from deeplight.io.photos import decode_rgb, encode_jpeg
from deeplight.lighting import LIGHTING_SIZE, Lighting
from deeplight.mappings import mirror_ball, resample
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.simulate.phone import (
    CameraAutomatics,
    Phone,
    Setting,
    develop,
    draw_automatics,
    follow,
    metered,
    vignetting,
)
from deeplight.sphere import Rig, SphereView

# Light for the mirror is gathered at 128: at 64 its crop is off by 0.010 of masked L1 from a
# finely ray-traced one, at 128 by 0.005. The others blur the difference away.
_FINE, _COARSE = 128, 64
_FRAME_ROWS = round(BACKGROUND_HEIGHT / BACKGROUND_FRACTION)


@dataclass(frozen=True, eq=False)
class Frame:
    """What one frame of a take gives.

    Attributes:
        background: the frame without its lower 20 %, decoded from `jpeg`.
        jpeg: as the phone compressed it.
        spheres: 8-bit crops by name.
        true_lighting: radiance relative to camera white, camera frame.
        pose: world_from_camera.
        setting: exposure and white balance.
        known: what else is exactly true of the frame; JSON values.
    """

    background: UInt8[np.ndarray, "height width 3"]
    jpeg: bytes
    spheres: dict[str, UInt8[np.ndarray, "size size 3"]]
    true_lighting: Lighting
    pose: Rotation
    setting: Setting
    known: Mapping[str, Any] = field(default_factory=dict)


def film(
    panorama: Float[np.ndarray, "height width 3"],
    phone: Phone,
    rig: Rig,
    frames: int,
    rng: np.random.Generator,
    looks_up: bool = False,
) -> Iterator[Frame]:
    """Film one take.

    Args:
        panorama: radiance of the place; its own scale does not matter.
        phone: the camera.
        rig: where the three spheres are held.
        frames: how many, a fraction of a second apart.
        rng: decides everything; the same state films the same take.
        looks_up: keep to the sky, for panoramas whose ground is made up.
    """
    camera = PinholeCamera(BACKGROUND_WIDTH, _FRAME_ROWS, phone.vertical_fov_rad)
    automatics = draw_automatics(phone, rng)
    rays = camera.rays(BACKGROUND_HEIGHT).astype(np.float32)
    lens = _background_vignetting(automatics)[..., None]
    setting = None
    for pose in hand_held(frames, rng, looks_up):
        radiance = resample.sample_latlong(panorama, turned(rays, pose))
        fine = resample.ball_from_latlong(panorama, _FINE, pose.T)
        spheres = _sphere_radiance(fine, panorama, rig, pose)
        illuminant = _mean_on_sphere(spheres["diffuse"], rig.views["diffuse"])
        wanted = metered(_metered_pixels(radiance, spheres), illuminant, automatics)
        setting = follow(setting, wanted, automatics.speed)
        gain = setting.gain
        photo = develop(radiance, gain * lens, automatics, (FRAME_HEIGHT // _FRAME_ROWS) ** 2, rng)
        jpeg = encode_jpeg(photo, automatics.jpeg_quality)
        crops = {
            name: _crop(values, rig.views[name], camera, gain, automatics, rng)
            for name, values in spheres.items()
        }
        lighting = Lighting(shrink_ball(fine, LIGHTING_SIZE) * gain)
        yield Frame(decode_rgb(jpeg), jpeg, crops, lighting, pose, setting)


def hand_held(frames: int, rng: np.random.Generator, looks_up: bool = False) -> Iterator[Rotation]:
    """Poses of a hand-held phone that pans slowly: world_from_camera of each frame.

    Pitch is biased downward, "towards imagery of surfaces or ground planes" (Datasets).
    """
    yaw, turn = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.12)
    pitch = rng.normal(0.45, 0.1) if looks_up else rng.normal(-0.25, 0.24)
    low, high = (0.3, 0.8) if looks_up else (-0.95, 0.35)
    roll = rng.normal(0, 0.04)
    for _ in range(frames):
        shake = rng.normal(0, 0.01, 3)
        yield world_from_camera(
            yaw + shake[0], float(np.clip(pitch, low, high)) + shake[1], roll + shake[2]
        )
        yaw += turn
        turn += rng.normal(0, 0.03)
        pitch += rng.normal(0, 0.05)
        roll = 0.9 * roll + rng.normal(0, 0.012)


def shrink_ball(
    ball: Float[np.ndarray, "old old 3"], size: int
) -> Float[np.ndarray, "size size 3"]:
    """A mirror ball at a fraction of its size: the mean over what each pixel covers."""
    covered = mirror_ball.coverage(len(ball))[..., None]
    power = resample.shrink(ball * covered, size, size)
    return power / np.maximum(resample.shrink(covered, size, size), 1e-9)


def _sphere_radiance(
    fine: np.ndarray, panorama: np.ndarray, rig: Rig, pose: Rotation
) -> dict[str, np.ndarray]:
    """Scene radiance of each crop: the sphere, and around it what lies behind."""
    light = {_FINE: Lighting(fine), _COARSE: Lighting(shrink_ball(fine, _COARSE))}
    crops = {}
    for name, view in rig.views.items():
        size = _FINE if name == "mirror" else _COARSE
        sphere = relight(analytic_basis(name, view, size), light[size])
        behind = resample.sample_latlong(panorama, turned(_rays(view), pose))
        alpha = view.alpha()[..., None]
        crops[name] = (sphere * alpha + behind * (1 - alpha)).astype(np.float32)
    return crops


def _rays(view: SphereView) -> Float[np.ndarray, "size size 3"]:
    """Directions through the crop's pixels, camera frame: what is seen past the sphere."""
    ideal = PinholeCamera(view.size, view.size, 2 * view.angular_radius_rad)
    return turned(ideal.rays().astype(np.float32), view.ball_from_camera.T)


def _metered_pixels(
    background: np.ndarray, spheres: dict[str, np.ndarray]
) -> Float[np.ndarray, "n 3"]:
    """A spread of places over the frame; the spheres fill about 5 % of it, so too here."""
    places = [background[4::8, 4::8], *(crop[6::9, 6::9] for crop in spheres.values())]
    return np.concatenate([place.reshape(-1, 3) for place in places])


def _mean_on_sphere(crop: np.ndarray, view: SphereView) -> Float[np.ndarray, "3"]:
    mean: np.ndarray = crop[view.mask()].mean(axis=0)
    return mean


def _background_vignetting(automatics: CameraAutomatics) -> Float[np.ndarray, "height width"]:
    row = (np.arange(BACKGROUND_HEIGHT) + 0.5) * (2 / _FRAME_ROWS) - 1
    column = (np.arange(BACKGROUND_WIDTH) + 0.5) * (2 / BACKGROUND_WIDTH) - 1
    return vignetting(row[:, None], column[None, :], automatics).astype(np.float32)


def _crop(
    radiance: np.ndarray,
    view: SphereView,
    camera: PinholeCamera,
    gain: np.ndarray,
    automatics: CameraAutomatics,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "size size 3"]:
    """The 8-bit crop, with the lens's loss of light at the sphere's place in the frame."""
    centre = -view.ball_from_camera[2:]  # the sphere's direction: -Z of its own frame
    row, column = camera.pixel_of_directions(centre)
    lens = vignetting(
        (2 * row / camera.height - 1).clip(-1, 1),
        (2 * column / camera.width - 1).clip(-1, 1),
        automatics,
    ).astype(np.float32)
    across = 2 * np.tan(view.angular_radius_rad) / (2 * camera.tangents[1]) * FRAME_HEIGHT
    averaged = max(1, int(across / view.size) ** 2)
    return develop(radiance, gain * lens, automatics, averaged, rng)
