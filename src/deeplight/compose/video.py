"""A video in, the video with the objects standing in it out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.compose.compose import ComposeSettings, Item, matched, placed, rendered, scene_of
from deeplight.compose.follow import Follower, turned_to
from deeplight.compose.gravity import CameraPlacement, viewpoint_of
from deeplight.compose.ground import Viewpoint
from deeplight.compose.kept_frames import KeptFrames
from deeplight.compose.look import Look
from deeplight.compose.scene import Scene
from deeplight.compose.trace import Quality
from deeplight.estimators.onnx import OnnxEstimator, shipped_model
from deeplight.frames import Rotation
from deeplight.fuse.session import CHANGED, Session
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

    A run that was killed goes on where it was: finished frames lie in a hidden folder next to
    `out` until it is whole.

    Args:
        video: to read.
        out: .mp4 to write.
        items: at least one; they stand where the first frame says.
        settings: how to render.
        placement: what is known of how the camera stood.
        light: latlong radiance in the first frame's camera, which then stands still in the world;
            left out, it is fused from all frames before the first is lit, so that it stands still
            as well; a light that is switched on the way parts the video.
        gain: factor on the light.
        progress: called with (frames done, frames in all, None if unknown) while they are lit.

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
    lights = _watched(film, video) if light is None else None
    meshes = [Path(item.object) for item in items if Path(item.object).is_file()]
    kept = KeptFrames(out, _made_of([video, *meshes], items, settings, placement, light, gain))
    with VideoWriter(out, *size, known.rate_hz or 30.0) as writer:
        lit = _frames(film, chain([first], source), lights, kept)
        for number, (time_s, pixels) in enumerate(lit, 1):
            writer.write(pixels[: size[1], : size[0]], time_s)
            progress(number, known.frames)
    kept.remove()
    return film.notes


def _made_of(files: Sequence[Path], *settings: object) -> bytes:
    """What decides how frames look; another version of the program or a file makes other frames."""
    parts: list[object] = [version("deeplight")]
    for file in (*files, shipped_model()):
        status = file.stat()
        parts += [str(file.resolve()), status.st_size, status.st_mtime_ns]
    for value in settings:
        parts.append(value.tobytes() if isinstance(value, np.ndarray) else repr(value))
    return repr(parts).encode()


@dataclass(frozen=True, eq=False)
class _Shot:
    """What the first frame decides for all of them."""

    settings: ComposeSettings
    estimator: OnnxEstimator
    given_light: np.ndarray
    gain: np.float32
    scene: Scene
    look: Look
    stands_at: tuple[float, float]
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
) -> _Shot:
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
    return _Shot(
        settings,
        estimator,
        light,
        factor,
        scene,
        matched(photo.pixels, settings),
        (float(x), float(y)),
        anchor,
        (*estimate.notes, *assumed, *notes, *limited),
    )


@dataclass(frozen=True, eq=False)
class LightFrom:
    """A part of a video in one and the same light.

    Attributes:
        start: its first frame.
        radiance: latlong, in the world, in the unit of the video's first frame.
    """

    start: int
    radiance: Float[np.ndarray, "rows columns 3"]


@dataclass(frozen=True, eq=False)
class Lights:
    """The light of every frame of a video, standing still in the world.

    Attributes:
        parts: in order, the first from frame 0 on.
        log_gain: ln of each frame's exposure and white balance over the first frame's.
    """

    parts: tuple[LightFrom, ...]
    log_gain: Float[np.ndarray, "frames 3"]

    def at(self, frame: int, turn: Rotation) -> Float[np.ndarray, "rows columns 3"]:
        """In a frame's camera, turned `turn` (world_from_camera), relative to its white."""
        part = [part for part in self.parts if part.start <= frame][-1]
        gain = np.exp(self.log_gain[min(frame, len(self.log_gain) - 1)]).astype(np.float32)
        return turned_latlong(part.radiance, turn.T) * gain


def gathered_lights(
    session: Session, frames: Iterable[tuple[UInt8[np.ndarray, "height width 3"], Rotation]]
) -> Lights:
    """Look at all frames of a video: what the last one shows lights the first one as well.

    Args:
        session: without views.
        frames: upright pixels, and how the camera was turned (world_from_camera).
    """
    world = np.eye(3)
    parts: list[LightFrom] = []
    gains: list[np.ndarray] = []
    start, changed = 0, None  # a part that may begin, and the light before it
    for number, (pixels, turn) in enumerate(frames):
        added = session.add(pixels, turn)
        gains.append(added.log_gain)
        if added.disagreement <= CHANGED and not added.forgotten:
            changed = None
        elif changed is None:
            changed = LightFrom(number, session.environment(world, height=LIGHT_ROWS).radiance)
        if added.forgotten and changed is not None:
            parts.append(LightFrom(start, changed.radiance))
            start, changed = changed.start, None
    parts.append(LightFrom(start, session.environment(world, height=LIGHT_ROWS).radiance))
    return Lights(tuple(parts), _corrected(np.stack(gains), session))


def _corrected(
    gains: Float[np.ndarray, "frames 3"], session: Session
) -> Float[np.ndarray, "frames 3"]:
    """Gains as the whole video has them: what became of the kept views', between them as well."""
    numbers = np.array([view.number for view in session.views])
    order = np.argsort(numbers)
    change = session.gains[order] - gains[numbers[order]]
    frames = np.arange(len(gains))
    # Before the first kept view there was another light, of which nothing is known any more.
    more = [np.interp(frames, numbers[order], change[:, c], left=0.0) for c in range(3)]
    result: np.ndarray = gains + np.stack(more, axis=1)
    return result


def _watched(film: _Shot, video: Path) -> Lights:
    fov_rad = film.scene.viewpoint.camera.vertical_fov_rad

    def estimate(pixels: np.ndarray) -> np.ndarray:
        radiance = film.estimator.estimate(pixels, float(np.degrees(fov_rad))).radiance
        logs: np.ndarray = np.log(np.maximum(radiance, _DARKEST))
        return logs

    frames = ((still.rgb(), now.world_from_camera) for still, now in _followed(film, video))
    return gathered_lights(Session(fov_rad, estimate), frames)


def _followed(
    film: _Shot, source: Path | Iterator[VideoFrame]
) -> Iterator[tuple[VideoFrame, Viewpoint]]:
    """Frames, and from where each was taken."""
    stills = video_frames(source) if isinstance(source, Path) else source
    now, follower = film.scene.viewpoint, None
    for still in stills:
        luma = still.luma.astype(np.float32)
        follower = follower or Follower(luma, *film.stands_at)
        now = turned_to(now, film.anchor, *follower.update(luma))
        yield still, now


def _frames(
    film: _Shot, source: Iterator[VideoFrame], lights: Lights | None, kept: KeptFrames
) -> Iterator[tuple[float, UInt8[np.ndarray, "height width 3"]]]:
    """Time and pixels of every finished frame."""
    first_turn = film.scene.viewpoint.world_from_camera
    for number, (still, now) in enumerate(_followed(film, source)):
        turn, pixels = now.world_from_camera, still.rgb()
        finished = kept.find(number, pixels)
        if finished is None:
            if lights is None:  # a given light stands still in the world
                light = turned_latlong(film.given_light, turn.T @ first_turn)
            else:
                light = film.gain * lights.at(number, turn)
            scene = replace(film.scene, viewpoint=now, light=light)
            made = rendered(pixels, scene, film.look, replace(film.settings, seed=still.number))
            kept.keep(number, made)
            finished = made.pixels
        yield still.time_s, finished
