"""Panning clips of a place whose light is known: what `deeplight.fuse` is measured with.

    python -m lab.pans ../shared/hdri --split val --out build/pans

Writes for each place `<place>.mp4` or numbered photos, `<place>.poses.json` (world_from_camera of
each frame) and `<place>.truth.exr`: the whole light in the first frame's camera, relative to the
first frame's white. Every trouble of a real pan can be switched on alone, to see what it costs.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

import cv2
import numpy as np
import tyro
from jaxtyping import Float, UInt8

from deeplight.camera import PinholeCamera
from deeplight.camera_response import GAMMA
from deeplight.frames import Rotation, rotation, turned, world_from_camera
from deeplight.harmonics import irradiance, spherical_harmonics
from deeplight.io.photos import write_png
from deeplight.io.radiance import write_exr
from deeplight.io.video_writer import VideoWriter
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, resample
from deeplight.simulate.panorama import Place, load, places_in
from deeplight.simulate.phone import (
    PHONES,
    CameraAutomatics,
    Phone,
    Setting,
    develop,
    draw_automatics,
    follow,
    metered,
    vignetting,
)
from deeplight.simulate.vary import stepped

DEPTH_M = 3.0  # of the walls, where the camera moves: a step of 0.3 m is a tenth of it
BOX_M = ((-2.0, -1.5, -3.0), (3.0, 1.3, 4.0))  # corners of a room with the camera at 0
_BLUR_STEPS = 5
_SENSOR_PIXELS = 9  # averaged into each pixel of a small frame


@dataclass(frozen=True)
class Troubles:
    """What goes wrong in a pan, each from 0 (not at all).

    Attributes:
        shake_rad: standard deviation of each frame's hand shake.
        exposure: share of the automatics' way from the first frame's setting to each frame's own.
        people: number of people walking through.
        step_m: how far the camera strays from where it started.
        room: what the panorama is painted on then: a sphere of `DEPTH_M`, or a box, `BOX_M`.
        blur_rad: how far the camera turns while the shutter is open.
        dropped: share of frames that are missing.
        response: False takes the phone's tone curve, tint, vignetting and noise away.
    """

    shake_rad: float = 0.015
    exposure: float = 1.0
    people: int = 0
    step_m: float = 0.0
    room: Literal["round", "box"] = "round"
    blur_rad: float = 0.0
    dropped: float = 0.0
    response: bool = True


@dataclass(frozen=True)
class Sweep:
    """Where a pan looks.

    Attributes:
        frames: on each ring.
        pitches_deg: of the rings.
        turn_deg: how far each ring goes; 360 comes back to where it began.
        bracket_stops: exposure compensation of successive frames, repeated.
    """

    frames: int = 24
    pitches_deg: tuple[float, ...] = (-10.0,)
    turn_deg: float = 360.0
    bracket_stops: tuple[float, ...] = (0.0,)

    def poses(self) -> Iterator[Rotation]:
        """world_from_camera of each frame, without the hand's shake."""
        for pitch in self.pitches_deg:
            for yaw in np.arange(self.frames) * (self.turn_deg / self.frames):
                yield world_from_camera(np.radians(yaw), np.radians(pitch))


@dataclass(frozen=True, eq=False)
class PanFrame:
    """One frame of a pan.

    Attributes:
        pixels: upright, gamma-encoded.
        rotation: world_from_camera, world = the panorama's frame.
        log_gain: ln of the factor from the panorama's radiance to the camera's white.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    rotation: Rotation
    log_gain: Float[np.ndarray, "3"]


@dataclass(frozen=True, eq=False)
class Pan:
    """A pan and its truth."""

    panorama: Float[np.ndarray, "height width 3"]
    camera: PinholeCamera
    frames: list[PanFrame] = field(repr=False)

    @property
    def rotations(self) -> Float[np.ndarray, "frames 3 3"]:
        """world_from_camera of all frames."""
        return np.stack([frame.rotation for frame in self.frames])

    def truth(self, frame: int = 0) -> Float[np.ndarray, "height width 3"]:
        """The whole light in the camera and relative to the white of a frame."""
        one = self.frames[frame]
        seen = resample.turned_latlong(self.panorama, one.rotation.T)
        return (seen * np.exp(one.log_gain)).astype(np.float32)

    def true_lighting(self, frame: int = 0) -> Lighting:
        """The same on the mirror ball, energy kept."""
        one = self.frames[frame]
        return Lighting.from_latlong(self.panorama * np.exp(one.log_gain), one.rotation.T)


def film_pan(
    panorama: Float[np.ndarray, "height width 3"],
    sweep: Sweep,
    troubles: Troubles,
    rng: np.random.Generator,
    size: tuple[int, int] = (480, 270),
    phone: Phone = PHONES["paper"],
) -> Pan:
    """Film one pan of (height, width) frames; `rng` decides everything."""
    camera = PinholeCamera(size[1], size[0], phone.vertical_fov_rad)
    automatics = _habits(phone, troubles, rng)
    start = rotation("y", rng.uniform(0, 2 * np.pi))
    poses = [start @ pose @ _shake(troubles, rng) for pose in sweep.poses()]
    kept = [k for k in range(len(poses)) if k == 0 or rng.random() >= troubles.dropped]
    steps = _strayed(len(poses), troubles.step_m / DEPTH_M, rng)
    people = [_Person.drawn(len(poses), rng) for _ in range(troubles.people)]
    coarse = resample.shrink_latlong(panorama, 64)  # what falls on things changes little in a step
    first: Setting | None = None
    setting: Setting | None = None
    frames = []
    for k in kept:
        place = panorama
        if steps[k].any():
            place = {"round": stepped, "box": stepped_in_box}[troubles.room](panorama, steps[k])
        seen = _exposed(place, camera, poses[k], troubles.blur_rad)
        for person in people:
            seen = person.standing_in(seen, camera, poses[k], k, float(np.median(panorama)))
        wanted = metered(seen[::8, ::8].reshape(-1, 3), _illuminant(coarse, poses[k]), automatics)
        setting = follow(setting, wanted, automatics.speed)
        first = first or setting
        stops = sweep.bracket_stops[k % len(sweep.bracket_stops)]
        used = follow(first, setting, troubles.exposure)
        log_gain = np.array(used.log_gain) + stops * np.log(2)
        lens = _lens(camera, automatics)
        gain = np.exp(log_gain).astype(np.float32) * lens
        pixels = develop(seen, gain, automatics, _SENSOR_PIXELS, rng)
        frames.append(PanFrame(pixels, poses[k], log_gain))
    return Pan(panorama, camera, frames)


def _habits(phone: Phone, troubles: Troubles, rng: np.random.Generator) -> CameraAutomatics:
    drawn = draw_automatics(phone, rng)
    if troubles.response:
        return drawn
    return replace(drawn, gamma=GAMMA, contrast=0.0, vignette=0.0, noise=0.0)


def _shake(troubles: Troubles, rng: np.random.Generator) -> Rotation:
    return world_from_camera(*rng.normal(0, 1, 3) * troubles.shake_rad)


def _strayed(frames: int, reach: float, rng: np.random.Generator) -> Float[np.ndarray, "frames 3"]:
    """Where the camera is in each frame: on a slow wobble that ends `reach` away at most."""
    phase, speed = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.5, 1.5, 3)
    along = np.arange(frames)[:, None] / max(frames, 1) * 2 * np.pi
    way = np.sin(along * speed + phase) - np.sin(phase)
    return way * (reach / max(float(np.linalg.norm(way, axis=1).max()), 1e-9))


def stepped_in_box(
    panorama: Float[np.ndarray, "height width 3"], step: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "height width 3"]:
    """The view from `step` (in units of `DEPTH_M`) away, of a box that wears the panorama."""
    low, high = (np.array(corner, np.float32) / np.float32(DEPTH_M) for corner in BOX_M)
    directions = latlong.directions(*panorama.shape[:2]).astype(np.float32)
    start = step.astype(np.float32)
    with np.errstate(divide="ignore"):  # along a wall: it is never met
        reach = np.where(directions > 0, high - start, start - low) / np.abs(directions)
    met = start + reach.min(axis=-1, keepdims=True) * directions
    return resample.sample_latlong(panorama.astype(np.float32), met)


def _exposed(
    panorama: np.ndarray, camera: PinholeCamera, pose: Rotation, blur_rad: float
) -> Float[np.ndarray, "height width 3"]:
    rays = camera.rays().astype(np.float32)
    if not blur_rad:
        return resample.sample_latlong(panorama, turned(rays, pose))
    turns = ((np.arange(_BLUR_STEPS) + 0.5) / _BLUR_STEPS - 0.5) * blur_rad
    views = [turned(rays, rotation("y", turn) @ pose) for turn in turns]
    mean: np.ndarray = np.mean([resample.sample_latlong(panorama, view) for view in views], axis=0)
    return mean


def _illuminant(panorama: np.ndarray, pose: Rotation) -> Float[np.ndarray, "3"]:
    """Light on what stands in front of the camera: on its top and on the side seen."""
    coefficients = spherical_harmonics(Lighting.from_latlong(panorama, pose.T))
    facing = irradiance(coefficients, np.eye(3, dtype=np.float32)[1:])
    return np.maximum(facing.mean(axis=0), 1e-6 * facing.max())


def _lens(
    camera: PinholeCamera, automatics: CameraAutomatics
) -> Float[np.ndarray, "height width 1"]:
    row = (np.arange(camera.height) + 0.5) * (2 / camera.height) - 1
    column = (np.arange(camera.width) + 0.5) * (2 / camera.width) - 1
    return vignetting(row[:, None], column[None], automatics).astype(np.float32)[..., None]


@dataclass(frozen=True)
class _Person:
    """Somebody 2 to 4 m away who walks by: a tall ellipse in clothes of one colour."""

    yaw: float
    per_frame: float
    half_width: float
    colour: tuple[float, float, float]

    @classmethod
    def drawn(cls, frames: int, rng: np.random.Generator) -> "_Person":
        colour = tuple(rng.uniform(0.05, 1.2, 3).tolist())
        turn = rng.uniform(-3, 3) / frames
        return cls(rng.uniform(0, 2 * np.pi), turn, rng.uniform(0.06, 0.14), colour)

    def standing_in(
        self, seen: np.ndarray, camera: PinholeCamera, pose: Rotation, frame: int, grey: float
    ) -> np.ndarray:
        """The picture with this person in it, lit like the median of the place."""
        at = rotation("y", self.yaw + self.per_frame * frame) @ np.array([0.0, -0.15, -1.0])
        towards = pose.T @ at
        if towards[2] > -0.2:
            return seen
        (row,), (column,) = camera.pixel_of_directions(towards[None])
        focal = camera.height / 2 / camera.tangents[1]
        mask = np.zeros(seen.shape[:2], np.float32)
        axes = (int(self.half_width * focal), int(4.0 * self.half_width * focal))
        cv2.ellipse(mask, (int(column), int(row)), axes, 0, 0, 360, 1.0, -1, cv2.LINE_AA)
        clothes = np.asarray(self.colour, np.float32) * np.float32(grey)
        return seen * (1 - mask[..., None]) + clothes * mask[..., None]


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.pans`."""

    panoramas: Annotated[Path, tyro.conf.Positional]
    """Folder of HDR panoramas."""
    out: Path
    """Folder to write into."""
    split: Literal["train", "val", "test"] = "val"
    """Which places."""
    sweep: Sweep = field(default_factory=Sweep)
    troubles: Troubles = field(default_factory=Troubles)
    kind: Literal["video", "photos"] = "video"
    size: tuple[int, int] = (960, 540)
    """Height and width of the frames."""
    rate_hz: float = 10.0
    seed: int = 0
    most: int = 100
    """Places at most."""


def main(args: Args) -> None:
    """Film a pan in every place of the split."""
    args.out.mkdir(parents=True, exist_ok=True)
    places = [place for place in places_in(args.panoramas) if place.split == args.split]
    for number, place in enumerate(places[: args.most]):
        rng = np.random.default_rng([args.seed, number])
        pan = film_pan(load(place), args.sweep, args.troubles, rng, args.size)
        _write(pan, place, args)
        print(f"{place.name}: {len(pan.frames)} frames")


def _write(pan: Pan, place: Place, args: Args) -> None:
    stem = place.path.stem
    write_exr(args.out / f"{stem}.truth.exr", pan.truth())
    if args.kind == "photos":
        for number, frame in enumerate(pan.frames):
            write_png(args.out / f"{stem}_{number:03d}.png", frame.pixels)
    else:
        with VideoWriter(args.out / f"{stem}.mp4", args.size[1], args.size[0], args.rate_hz) as out:
            for frame in pan.frames:
                out.write(frame.pixels)
    poses = {
        "convention": "deeplight",
        "frames": [{"rotation": np.round(f.rotation, 7).tolist()} for f in pan.frames],
    }
    (args.out / f"{stem}.poses.json").write_text(json.dumps(poses, indent=1) + "\n")


if __name__ == "__main__":
    main(tyro.cli(Args))
