"""A video in, the video with the objects standing in it out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.compose.compose import ComposeSettings, Item, matched, placed, rendered, scene_of
from deeplight.compose.follow import Follower, turned_to
from deeplight.compose.gravity import CameraPlacement, viewpoint_of
from deeplight.compose.look import Look
from deeplight.compose.scene import Scene
from deeplight.compose.trace import Quality
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.fuse.session import Session
from deeplight.io.photos import Photo
from deeplight.io.video import VideoFrame, facts, video_frames
from deeplight.io.video_writer import VideoWriter
from deeplight.mappings.resample import turned_latlong

FRAME = Quality(samples=32, shadow_samples=24, shadow_pixels=2_000, most_rays=150_000)
"""Rays of one frame of a preview."""
LIGHT_ROWS = 256  # of the panorama that lights a frame
_DARKEST = 1e-4


def compose_video(
    video: Path,
    out: Path,
    items: Sequence[Item],
    settings: ComposeSettings,
    placement: CameraPlacement,
    light: Float[np.ndarray, "rows columns 3"] | None = None,
    gain: float = 1.0,
    progress: Callable[[int, int | None], None] = lambda frames, total: None,
) -> tuple[str, ...]:
    """Compose every frame; the objects keep to their place while the camera turns.

    Args:
        video: to read.
        out: .mp4 to write.
        items: at least one; they stand where the first frame says.
        settings: how to render.
        placement: what is known of how the camera stood.
        light: latlong radiance in the first frame's camera, which then stands still in the world;
            left out, it is fused from all frames so far, so that it stands still as well.
        gain: factor on the light.
        progress: called with (frames done, frames in all, None if unknown).

    Returns:
        Notes on what was assumed.

    Raises:
        InputError: the video or an object cannot be used.
        OSError: a file cannot be read or written.
    """
    known, source = facts(video), video_frames(video)
    first = next(source)
    film = _begin(video, first, items, settings, placement, light, gain)
    size = first.luma.shape[1] // 2 * 2, first.luma.shape[0] // 2 * 2  # codecs want even sides
    with VideoWriter(out, *size, known.rate_hz or 30.0) as writer:
        for number, (time_s, pixels) in enumerate(_frames(film, chain([first], source)), 1):
            writer.write(pixels[: size[1], : size[0]], time_s)
            progress(number, known.frames)
    return film.notes


@dataclass(frozen=True, eq=False)
class _Film:
    """What the first frame decides for all of them."""

    settings: ComposeSettings
    estimator: OnnxEstimator
    given_light: np.ndarray | None
    gain: np.float32
    scene: Scene
    look: Look
    follower: Follower
    anchor: np.ndarray
    notes: tuple[str, ...]


def _begin(
    video: Path,
    first: VideoFrame,
    items: Sequence[Item],
    settings: ComposeSettings,
    placement: CameraPlacement,
    given: np.ndarray | None,
    gain: float,
) -> _Film:
    estimator, factor = OnnxEstimator(), np.float32(gain)
    photo = Photo(first.rgb(), video)
    estimate = estimator.explain(photo, placement.fov_deg)
    viewpoint, assumed = viewpoint_of(video, estimate.framing, placement, photo.pixels)
    light = factor * (estimate.lighting.latlong() if given is None else given)
    solids, notes = placed(viewpoint, items, estimate.framing.bottom, photo.pixels)
    scene, limited = scene_of(photo.pixels, light, viewpoint, solids, settings)
    low, high = solids[0].vertices.min(0), solids[0].vertices.max(0)
    anchor = (low + high) / 2 * [1, 0, 1]
    x, y = viewpoint.pixels(anchor[None])[0]
    return _Film(
        settings,
        estimator,
        None if given is None else light,
        factor,
        scene,
        matched(photo.pixels, settings),
        Follower(first.luma.astype(np.float32), float(x), float(y)),
        anchor,
        (*estimate.notes, *assumed, *notes, *limited),
    )


def _session(film: _Film) -> Session:
    fov_rad = film.scene.viewpoint.camera.vertical_fov_rad

    def estimate(pixels: np.ndarray) -> np.ndarray:
        radiance = film.estimator.estimate(pixels, float(np.degrees(fov_rad))).radiance
        logs: np.ndarray = np.log(np.maximum(radiance, _DARKEST))
        return logs

    return Session(fov_rad, estimate)


def _frames(
    film: _Film, source: Iterator[VideoFrame]
) -> Iterator[tuple[float, UInt8[np.ndarray, "height width 3"]]]:
    """Time and pixels of every finished frame."""
    before = film.scene.viewpoint
    session = _session(film)
    for still in source:
        pixels = still.rgb()
        x, y = film.follower.update(still.luma.astype(np.float32))
        now = turned_to(before, film.anchor, x, y)
        if film.given_light is None:
            turn = now.world_from_camera
            added = session.add(pixels, turn)
            light = film.gain * session.environment(turn, added.log_gain, LIGHT_ROWS).radiance
        else:  # a given light stands still in the world
            new_from_first = now.world_from_camera.T @ film.scene.viewpoint.world_from_camera
            light = turned_latlong(film.given_light, new_from_first)
        before = now
        scene = replace(film.scene, viewpoint=now, light=light)
        settings = replace(film.settings, seed=still.number)
        yield still.time_s, rendered(pixels, scene, film.look, settings).pixels
