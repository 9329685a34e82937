"""A video in, the video with the objects standing in it out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from hashlib import sha256
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.compose.camera_turn import CameraTurn, named_ranges
from deeplight.compose.compose import ComposeSettings, Item, matched, placed, scene_of
from deeplight.compose.composite import composite
from deeplight.compose.gravity import CameraPlacement, viewpoint_of
from deeplight.compose.ground import Viewpoint
from deeplight.compose.kept_frames import KeptFrames
from deeplight.compose.look import Look
from deeplight.compose.panned import is_near, seen_from, widened
from deeplight.compose.scene import Scene
from deeplight.compose.trace import Layers, Quality, trace
from deeplight.estimators.onnx import OnnxEstimator, shipped_model
from deeplight.estimators.tilt import tilt_of_estimate
from deeplight.frames import Rotation
from deeplight.fuse.session import CHANGED, Session
from deeplight.io.kept_folder import made_of
from deeplight.io.photos import Photo
from deeplight.io.video import VideoFrame, facts, video_frames
from deeplight.io.video_writer import VideoWriter
from deeplight.mappings.resample import turned_latlong

FRAME = Quality(samples=64, shadow_samples=48, shadow_pixels=6_000, most_rays=2_500_000)
"""Rays of a preview: one rendering serves many frames."""
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
    camera = _Cameras(film)
    lights = _watched(film, video, camera) if light is None else None
    solids = film.scene.solids
    kept = KeptFrames(out, _made_of(video, solids, items, settings, placement, light, gain))
    with VideoWriter(out, *size, known.rate_hz or 30.0) as writer:
        lit = _frames(film, camera, chain([first], source), lights, kept)
        for number, (time_s, pixels) in enumerate(lit, 1):
            writer.write(pixels[: size[1], : size[0]], time_s)
            progress(number, known.frames)
    kept.remove()
    notes = ["the video's sound is left out"] * known.sound
    named = {
        "match no other, left as they are": camera.turn.lost,
        "the object's place is hidden": camera.turn.hidden,
        "blurred by a fast turn, the object's place is not seen": camera.turn.blurred,
    }
    notes += [f"{why}: frames {named_ranges(frames)}" for why, frames in named.items() if frames]
    return (*film.notes, *notes)


def _made_of(video: Path, *made_from: object) -> bytes:
    """What decides how frames look; another version of the program or a file makes other frames."""
    return made_of([video, shipped_model()], _content(made_from))


def _content(value: object) -> object:
    """A value in words, arrays by their hash: meshes count as read, from all their files."""
    if isinstance(value, np.ndarray):
        digest = sha256(np.ascontiguousarray(value).data).hexdigest()
        return str(value.dtype), value.shape, digest
    if isinstance(value, tuple | list):
        return [_content(part) for part in value]
    if is_dataclass(value) and not isinstance(value, type):
        return [_content(getattr(value, part.name)) for part in fields(value)]
    return repr(value)


@dataclass(frozen=True, eq=False)
class _Shot:
    """What the first frame decides for all of them."""

    settings: ComposeSettings
    estimator: OnnxEstimator
    given_light: np.ndarray
    gain: np.float32
    scene: Scene
    look: Look
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
    framing = estimate.framing
    tilt, doubts = tilt_of_estimate(estimate, placement.pitch_deg, placement.roll_deg)
    viewpoint, assumed = viewpoint_of(framing.camera, placement, tilt)
    light = factor * (estimate.lighting.latlong() if given is None else given)
    solids, notes = placed(viewpoint, items, framing.bottom, photo.pixels)
    scene, limited = scene_of(photo.pixels, light, viewpoint, solids, settings)
    low, high = solids[0].vertices.min(0), solids[0].vertices.max(0)
    anchor = (low + high) / 2 * [1, 0, 1]
    return _Shot(
        settings,
        estimator,
        light,
        factor,
        scene,
        matched(photo.pixels, settings),
        anchor,
        (*estimate.notes, *doubts, *assumed, *notes, *limited),
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

    def part(self, frame: int) -> LightFrom:
        """The light of a frame."""
        return [part for part in self.parts if part.start <= frame][-1]

    def gain(self, frame: int) -> Float32[np.ndarray, "3"]:
        """A frame's exposure and white balance over the first frame's."""
        gain: np.ndarray = np.exp(self.log_gain[min(frame, len(self.log_gain) - 1)])
        return gain.astype(np.float32)


def gathered_lights(
    session: Session, frames: Iterable[tuple[UInt8[np.ndarray, "height width 3"], Rotation | None]]
) -> Lights:
    """Look at all frames of a video: what the last one shows lights the first one as well.

    Args:
        session: without views.
        frames: upright pixels, and how the camera was turned (world_from_camera), None where that
            is unknown: those say nothing of the light. Of the first one it is known.
    """
    world = np.eye(3)
    parts: list[LightFrom] = []
    gains: list[np.ndarray] = []
    used: list[int] = []  # frame of each that the session has seen
    start, changed = 0, None  # a part that may begin, and the light before it
    for number, (pixels, turn) in enumerate(frames):
        if turn is None:
            gains.append(gains[-1])
            continue
        added = session.add(pixels, turn)
        used.append(number)
        gains.append(added.log_gain)
        if added.disagreement <= CHANGED and not added.forgotten:
            changed = None
        elif changed is None:
            changed = LightFrom(number, session.environment(world, height=LIGHT_ROWS).radiance)
        if added.forgotten and changed is not None:
            parts.append(LightFrom(start, changed.radiance))
            start, changed = changed.start, None
    parts.append(LightFrom(start, session.environment(world, height=LIGHT_ROWS).radiance))
    return Lights(tuple(parts), _corrected(np.stack(gains), session, used))


def _corrected(
    gains: Float[np.ndarray, "frames 3"], session: Session, used: Sequence[int]
) -> Float[np.ndarray, "frames 3"]:
    """Gains as the whole video has them: what became of the kept views', between them as well."""
    numbers = np.array([used[view.number] for view in session.views])
    order = np.argsort(numbers)
    change = session.gains[order] - gains[numbers[order]]
    frames = np.arange(len(gains))
    # Before the first kept view there was another light, of which nothing is known any more.
    more = [np.interp(frames, numbers[order], change[:, c], left=0.0) for c in range(3)]
    result: np.ndarray = gains + np.stack(more, axis=1)
    return result


def _watched(film: _Shot, video: Path, camera: "_Cameras") -> Lights:
    fov_rad = film.scene.viewpoint.camera.vertical_fov_rad

    def estimate(pixels: np.ndarray) -> np.ndarray:
        radiance = film.estimator.estimate(pixels, float(np.degrees(fov_rad))).radiance
        logs: np.ndarray = np.log(np.maximum(radiance, _DARKEST))
        return logs

    def seen(still: VideoFrame) -> tuple[np.ndarray, Rotation | None]:
        now = camera.of(still)
        return still.rgb(), None if now is None else now.world_from_camera

    frames = map(seen, video_frames(video))
    return gathered_lights(Session(fov_rad, estimate), frames)


class _Cameras:
    """The camera of each frame, found once, whoever asks first.

    Attributes:
        turn: what finds it, and which frames it did not find.
    """

    def __init__(self, film: _Shot) -> None:
        self.turn = CameraTurn(film.scene.viewpoint, film.anchor)
        self._found: list[Viewpoint | None] = []

    def of(self, still: VideoFrame) -> Viewpoint | None:
        """In the order of frames; None where a frame matches no other."""
        if still.number == len(self._found):
            now = self.turn.update(still.luma)
            self._found.append(None if still.number in self.turn.lost[-1:] else now)
        return self._found[still.number]


class _Standing:
    """A shot's objects in its light, rendered anew only where the camera has turned far or the
    light is another: see `compose.panned`."""

    def __init__(self, film: _Shot, lights: Lights | None) -> None:
        self._film, self._lights = film, lights
        self._rendered_from: Viewpoint | None = None
        self._part: LightFrom | None = None
        self._layers: Layers | None = None

    def turn(self, number: int, now: Viewpoint) -> None:
        """Go on to a frame. Every one counts, so that a run that goes on renders the same."""
        part = None if self._lights is None else self._lights.part(number)
        before = self._rendered_from
        if before is None or part is not self._part or not is_near(before, now):
            self._rendered_from, self._part, self._layers = widened(now), part, None

    def layers(self, number: int, now: Viewpoint) -> Layers:
        """What a frame's camera sees of them, in the frame's own exposure."""
        rendered_from = self._rendered_from
        assert rendered_from is not None  # `turn` was called
        if self._layers is None:
            turn, settings = rendered_from.world_from_camera, self._film.settings
            light = self._light(turn)
            scene = replace(self._film.scene, viewpoint=rendered_from, light=light)
            below, seed = settings.light_from_below, settings.seed
            self._layers = trace(scene, settings.quality, settings.engine, below, seed)
        seen = seen_from(self._layers, rendered_from, now)
        gain = 1 if self._lights is None else self._lights.gain(number)
        return replace(seen, radiance=seen.radiance * gain)

    def _light(self, turn: Rotation) -> Float[np.ndarray, "rows columns 3"]:
        """In a camera turned so, relative to the first frame's white."""
        if self._part is None:  # a given light stands still in the world
            first = self._film.scene.viewpoint.world_from_camera
            return turned_latlong(self._film.given_light, turn.T @ first)
        return self._film.gain * turned_latlong(self._part.radiance, turn.T)


def _frames(
    film: _Shot,
    camera: _Cameras,
    source: Iterator[VideoFrame],
    lights: Lights | None,
    kept: KeptFrames,
) -> Iterator[tuple[float, UInt8[np.ndarray, "height width 3"]]]:
    """Time and pixels of every finished frame."""
    standing = _Standing(film, lights)
    for number, still in enumerate(source):
        pixels, now = still.rgb(), camera.of(still)
        if now is None:
            yield still.time_s, pixels
            continue
        standing.turn(number, now)
        finished = kept.find(number, pixels)
        if finished is None:
            layers = standing.layers(number, now)
            made = composite(pixels, layers, film.look, seed=still.number)
            kept.keep_frame(number, made)
            finished = made.pixels
        yield still.time_s, finished
