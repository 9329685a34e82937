"""Many photos and videos in one go: results written for all that can be, reasons for the rest."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deeplight.errors import ConfigError, ImageFileError, InputError
from deeplight.estimators.confidence import warnings_of
from deeplight.estimators.environment import (
    HEIGHT,
    SceneLight,
    check_height,
    pixels_for,
)
from deeplight.estimators.fill import Fill
from deeplight.estimators.network import Estimate, NetworkEstimator
from deeplight.estimators.results import OutputSpec, write_results
from deeplight.estimators.sources import Source, find_sources
from deeplight.estimators.sun import SunHint, scene_in_sun
from deeplight.estimators.tilt import tilt_of_estimate
from deeplight.formats.webxr import light_estimate_file
from deeplight.io.atomic import results_folder
from deeplight.io.orientation import TOOLS
from deeplight.io.tilt import with_given
from deeplight.io.video import is_video


@dataclass(frozen=True)
class BatchSettings:
    """How to estimate and what to write.

    Attributes:
        fov_deg: vertical field of view of every photo; None reads it from EXIF.
        height: rows of the environments.
        light_only: write the network's estimate alone, without the photo and without lamps.
        lamps_apart: leave the lamps out of the environment files; the .json has them.
        made_for: the tool the environments are for.
        hdr: also write Radiance RGBE.
        seen_channel: also write what the photo shows as a channel of the .exr.
        sun: where the sun stands; None places it by EXIF data where it has both.
        fill: what to show where the photo does not look; see `estimators.fill`.
        pitch_deg, roll_deg: of the camera, up and counter-clockwise; None takes EXIF's, else what
            is seen in the photo.

    Raises:
        ConfigError: a value that cannot be, or options that exclude each other.
    """

    fov_deg: float | None = None
    height: int = HEIGHT
    light_only: bool = False
    lamps_apart: bool = False
    made_for: str | None = None
    hdr: bool = False
    seen_channel: bool = False
    sun: SunHint | None = None
    fill: Fill | None = "auto"
    pitch_deg: float | None = None
    roll_deg: float | None = None

    def __post_init__(self) -> None:
        if self.fov_deg is not None and not 0 < self.fov_deg < 180:
            got = f"{self.fov_deg:g}"
            raise ConfigError("--fov between 0 and 180 degrees", got, "correct it")
        check_height(self.height)
        for name, angle in (("pitch", self.pitch_deg), ("roll", self.roll_deg)):
            if angle is not None and not abs(angle) <= 90:
                raise ConfigError(f"--{name} from -90 to 90 degrees", f"{angle:g}", "correct it")
        if self.light_only and self._needs_the_photo:
            expected = "--lamps-apart, --seen, --sun, --fill, --pitch with a photo in its light"
            raise ConfigError(expected, "--light-only, which has no lamps and no photo", "drop one")

    @property
    def _needs_the_photo(self) -> bool:
        tilted = self.pitch_deg is not None or self.roll_deg is not None
        filled = self.fill not in (None, "auto")
        return bool(self.lamps_apart or self.seen_channel or self.sun or filled or tilted)


@dataclass(frozen=True)
class SourceDone:
    """What came of one photo or video.

    Attributes:
        source: it.
        count: results written, one for each frame of a video.
        first, last: files of the first and of the last result.
        notes: what the user should know, of the last one.
    """

    source: Source
    count: int
    first: Sequence[Path]
    last: Sequence[Path]
    notes: Sequence[str]


class _CannotWriteError(Exception):
    """The OSError of an output; it ends the batch, since the next one would fail too."""

    def __init__(self, reason: OSError) -> None:
        self.reason = reason


def estimate_batch(
    estimator: NetworkEstimator,
    paths: Sequence[Path],
    out: Path,
    settings: BatchSettings = BatchSettings(),
    *,
    on_done: Callable[[SourceDone], None] = lambda done: None,
    on_failure: Callable[[InputError | OSError], None] = lambda error: None,
    on_start: Callable[[Source, int, int], None] = lambda source, number, total: None,
) -> None:
    """Estimate everything that `paths` name, and write the results into `out`.

    Args:
        estimator: the loaded model.
        paths: photos, folders of photos, videos.
        out: made if it is missing.
        settings: how.
        on_done: called after each photo or video.
        on_failure: called for each of several that cannot be used; the rest goes on.
        on_start: called before each with its number, from 1, and how many there are.

    Raises:
        InputError: some of it cannot be used; raised when the rest is done.
        OSError: the only photo cannot be read, or a result cannot be written.
    """
    sources, failures = find_sources(paths, out)
    total = len(sources) + len(failures)
    with results_folder(out):
        for failure in failures if total > 1 else ():
            on_failure(failure)
        for number, source in enumerate(sources, 1):
            on_start(source, number, len(sources))
            try:
                on_done(_estimated(estimator, source, out, settings))
            except (InputError, OSError) as error:
                failures.append(error)
                if total > 1:
                    on_failure(error)
            except _CannotWriteError as wrapper:
                raise wrapper.reason from None
    if failures and total == 1:
        raise failures[0]
    if failures:
        got = f"{len(failures)} of {total} that cannot be used, named above"
        raise ImageFileError("usable photos", got, "the others are done")


def _estimated(
    estimator: NetworkEstimator, source: Source, out: Path, settings: BatchSettings
) -> SourceDone:
    """Estimate a photo or every frame of a video, and write the results."""
    done = SourceDone(source, 0, (), (), ())
    if settings.fill == "auto" and is_video(source.path):
        settings = replace(settings, fill="photo")  # each frame would have another place's detail
    for stem, photo in source.photos(pixels_for(settings.height)):
        estimate = estimator.explain(photo, settings.fov_deg)
        scene, sun, notes = _lit(estimate, settings)
        estimate = replace(estimate, notes=(*estimate.notes, *notes))
        try:
            files = _written(estimate, scene, estimator, out, stem, settings, sun)
        except OSError as error:
            raise _CannotWriteError(error) from error
        all_notes = (*warnings_of(estimate.photo.pixels), *estimate.notes)
        done = SourceDone(source, done.count + 1, done.first or files, files, all_notes)
    return done


def _lit(
    estimate: Estimate, settings: BatchSettings
) -> tuple[SceneLight | None, dict[str, Any] | None, tuple[str, ...]]:
    """The light to write, what is known of the sun, and notes on it."""
    if settings.light_only:
        return None, None, ()
    tilt, notes = tilt_of_estimate(estimate, settings.pitch_deg, settings.roll_deg)
    if tilt is None:
        tilt = with_given(None, settings.roll_deg and 0.0, settings.roll_deg)
    scene, found = scene_in_sun(estimate, settings.sun, settings.height, settings.fill, tilt)
    if found is None:
        return scene, None, notes
    return scene, found.sun.record(found.used), (*notes, found.note)


def _written(
    estimate: Estimate,
    scene: SceneLight | None,
    estimator: NetworkEstimator,
    out: Path,
    stem: str,
    settings: BatchSettings,
    sun: dict[str, Any] | None,
) -> list[Path]:
    further: dict[str, Any] = {}
    if settings.made_for == "webxr":
        lighting = scene.environment.lighting if scene else estimate.lighting
        main_light = scene.environment.main_light if scene else None
        further[".webxr.json"] = light_estimate_file(lighting, main_light)
    tool = TOOLS.get(settings.made_for or "")
    spec = OutputSpec(
        turn=tool.turn if tool else None,
        hdr=settings.hdr,
        lamps_apart=settings.lamps_apart,
        seen_channel=settings.seen_channel,
        height=settings.height,
    )
    facts = {} if sun is None else {"sun": sun}
    return write_results(estimate, estimator, out, stem, scene, spec, further, facts)
