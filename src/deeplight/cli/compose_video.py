"""A video in, the video with the objects standing in it out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from rich.console import Console
from rich.markup import escape

from deeplight.camera import PinholeCamera
from deeplight.cli.compose import Args
from deeplight.cli.compose_run import bar, gained, light_of_file, settings_of, viewpoint_of
from deeplight.compose.compose import Item, Settings, matched, placed, rendered, scene_of
from deeplight.compose.follow import Follower, smoothed, turned_to
from deeplight.compose.ground import Viewpoint
from deeplight.compose.look import Look
from deeplight.compose.scene import Scene
from deeplight.compose.trace import Quality
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.io.photos import Photo
from deeplight.io.video import Still, facts, stills
from deeplight.io.video_writer import VideoWriter
from deeplight.lighting import Lighting

FRAME = Quality(samples=32, shadow_samples=24, shadow_pixels=2_000, most_rays=150_000)


def run_video(args: Args, items: Sequence[Item]) -> None:
    """Compose every frame; the objects keep to their place while the camera turns.

    Raises:
        InputError: an option, the video or an object cannot be used.
        OSError: a file cannot be read or written.
    """
    known = facts(args.photo)
    settings = settings_of(args)
    if args.quality == "preview":
        settings = replace(settings, quality=FRAME)
    source = stills(args.photo)
    first = next(source)
    film = _begin(args, first, items, settings)
    size = first.luma.shape[1] // 2 * 2, first.luma.shape[0] // 2 * 2  # codecs want even sides
    with bar() as progress, VideoWriter(args.out, *size, known.rate_hz or 30.0) as writer:
        task = progress.add_task("composing", total=known.frames)
        for time_s, pixels in _frames(film, chain([first], source)):
            writer.write(pixels[: size[1], : size[0]], time_s)
            progress.advance(task)
    console = Console(highlight=False, soft_wrap=True)
    console.print(escape(f"{args.photo} -> {args.out}"))
    for note in film.notes:
        console.print(f"  [dim]{escape(note)}[/dim]")


@dataclass(frozen=True, eq=False)
class _Film:
    """What the first frame decides for all of them."""

    args: Args
    settings: Settings
    estimator: OnnxEstimator
    fixed_light: np.ndarray | None
    lighting: Lighting
    scene: Scene
    look: Look
    follower: Follower
    anchor: np.ndarray
    notes: tuple[str, ...]


def _begin(args: Args, first: Still, items: Sequence[Item], settings: Settings) -> _Film:
    estimator = OnnxEstimator()
    photo = Photo(first.rgb(), args.photo)
    estimate = estimator.explain(photo, args.fov)
    viewpoint, assumed = viewpoint_of(args, photo, estimate.framing)
    fixed = None if args.light is None else gained(args, light_of_file(args.light))
    light = gained(args, estimate.lighting.latlong()) if fixed is None else fixed
    solids, notes = placed(viewpoint, items, estimate.framing.bottom)
    scene, limited = scene_of(photo.pixels, light, viewpoint, solids, settings)
    low, high = solids[0].vertices.min(0), solids[0].vertices.max(0)
    anchor = (low + high) / 2 * [1, 0, 1]
    x, y = viewpoint.pixels(anchor[None])[0]
    return _Film(
        args,
        settings,
        estimator,
        fixed,
        estimate.lighting,
        scene,
        matched(photo.pixels, settings),
        Follower(first.luma.astype(np.float32), float(x), float(y)),
        anchor,
        (*estimate.notes, *assumed, *notes, *limited),
    )


def _frames(film: _Film, source: Iterator[Still]) -> Iterator[tuple[float, np.ndarray]]:
    """Time and pixels of every finished frame."""
    lighting, viewpoint = film.lighting, film.scene.viewpoint
    for still in source:
        pixels = still.rgb()
        x, y = film.follower.update(still.luma.astype(np.float32))
        now = turned_to(viewpoint, film.anchor, x, y)
        light = film.fixed_light
        if light is None:
            new = film.estimator.estimate(pixels, _fov_deg(viewpoint.camera))
            lighting = smoothed(lighting, viewpoint, new, now)
            light = gained(film.args, lighting.latlong())
        else:  # a given light stands still in the world
            light = _turned(light, film.scene.viewpoint, now)
        viewpoint = now
        scene = replace(film.scene, viewpoint=now, light=light)
        settings = replace(film.settings, seed=still.number)
        yield still.time_s, rendered(pixels, scene, film.look, settings).pixels


def _fov_deg(camera: PinholeCamera) -> float:
    return float(np.degrees(camera.vertical_fov_rad))


def _turned(light: np.ndarray, first: Viewpoint, now: Viewpoint) -> np.ndarray:
    from deeplight.mappings.resample import turned_latlong

    return turned_latlong(light, now.world_from_camera.T @ first.world_from_camera)
