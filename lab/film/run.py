"""A set of films: which clip is filmed where, one after the other, resumable."""

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from deeplight.dataset import Skipped
from deeplight.errors import ConfigError, DataSetError, InputError
from deeplight.io.atomic import replacing
from deeplight.io.video_writer import VideoWriter, require_video
from deeplight.simulate import panorama
from deeplight.simulate.panorama import Place
from lab.film.clip import Clip
from lab.film.recipe import FilmRecipe
from lab.film.truth import TruthWriter, truth_paths

CLIPS = "clips"
RECORD, SKIPPED = "films.json", "skipped.json"
_UNSAFE = re.compile(r"[^A-Za-z0-9_-]")


@dataclass(frozen=True)
class ClipJob:
    """One clip to film.

    Attributes:
        number: in the set.
        path: of its video.
        place: where.
        troubles: of `TROUBLES`.
        seed: decides everything about it.
    """

    number: int
    path: Path
    place: Place
    troubles: tuple[str, ...]
    seed: tuple[int, ...]

    @property
    def finished(self) -> bool:
        """Its truth, which is written last, is there."""
        return self.path.is_file() and all(path.is_file() for path in truth_paths(self.path))


@dataclass(frozen=True)
class FilmSet:
    """All clips of one recipe in one folder."""

    out: Path
    recipe: FilmRecipe
    jobs: tuple[ClipJob, ...]

    def missing(self) -> tuple[ClipJob, ...]:
        """Clips that are not finished."""
        return tuple(job for job in self.jobs if not job.finished)


def plan_films(folder: Path, out: Path, recipe: FilmRecipe) -> FilmSet:
    """Decide every clip before anything is filmed, and remember the recipe in `out`.

    Places are taken in an order drawn from the seed, each once before any comes again; those whose
    ground is made up are left out.

    Raises:
        ConfigError: `out` holds films of another recipe.
        DataSetError: no panoramas of that split, or a file where `out` should be.
        MissingExtraError: the `capture` extra, which encodes video, is not installed.
        OSError: `out` cannot be written.
    """
    require_video("filming")
    places = [
        place
        for place in panorama.places_in(folder)
        if not place.synthetic_ground and recipe.split in ("any", place.split)
    ]
    if not places:
        expected = f"panoramas of the split {recipe.split} with real ground in {folder}"
        raise DataSetError(expected, "none", "choose another film.split")
    order = np.random.default_rng([recipe.seed, 77]).permutation(len(places))
    jobs = []
    for number in range(recipe.clips):
        place = places[order[number % len(places)]]
        troubles = recipe.troubles_of(number)
        stem = _UNSAFE.sub("_", place.path.stem)[:50]
        name = "-".join([f"{number:03d}", stem, *troubles])
        digest = int.from_bytes(hashlib.sha256(place.path.stem.encode()).digest()[:4], "big")
        seed = (recipe.seed, number, digest)
        jobs.append(ClipJob(number, out / CLIPS / f"{name}.mp4", place, troubles, seed))
    described = {"made_by": "python -m lab.film", **asdict(recipe)}
    described |= {"troubles": list(recipe.troubles)}
    described |= {"clip_names": [job.path.name for job in jobs]}
    _remember(out, described)
    return FilmSet(out, recipe, tuple(jobs))


def film_all(
    films: FilmSet, progress: Callable[[int], None] = lambda frames: None
) -> tuple[Skipped, ...]:
    """Film what is missing; panoramas that cannot be used are reported, and noted in `SKIPPED`.

    Args:
        films: from `plan_films`.
        progress: called with the number of frames whenever some are done.

    Raises:
        DataSetError: not one clip could be filmed; the folder is taken away again if that empties
            it.
        OSError: the folder cannot be written; finished clips stay, to go on with.
    """
    skipped = []
    for job in films.missing():
        try:
            radiance = panorama.load(job.place)
        except (OSError, InputError) as error:
            skipped.append(Skipped(job.place.path.name, str(error)))
            progress(films.recipe.frames)
            continue
        film_clip(job, radiance, films.recipe, progress)
    if len(films.missing()) == len(films.jobs):
        _discard(films.out)
        reasons = "; ".join(f"{item.file}: {item.reason}" for item in skipped)
        raise DataSetError("at least one usable panorama", f"none ({reasons[:400]})", "repair them")
    if skipped:
        with replacing(films.out / SKIPPED) as temporary:
            temporary.write_text(json.dumps([asdict(item) for item in skipped], indent=1) + "\n")
    return tuple(skipped)


def film_clip(
    job: ClipJob,
    radiance: np.ndarray,
    recipe: FilmRecipe,
    progress: Callable[[int], None] = lambda frames: None,
) -> None:
    """Film one clip. Its video appears whole, its truth after it."""
    clip = Clip(radiance, job.place.scene, recipe, job.troubles, list(job.seed))
    truth = TruthWriter(clip, job.place)
    camera, codec = clip.camera, "libx265" if "hlg10" in job.troubles else "libx264"
    size = camera.width, camera.height
    with VideoWriter(job.path, *size, recipe.rate, codec, clip.rotation_deg) as video:
        for frame in clip.frames():
            if not frame.dropped:
                video.write(frame.pixels, frame.time_s)
            truth.add(frame)
            progress(1)
    truth.write(job.path)


def _discard(out: Path) -> None:
    """Take the record away, and the folder if it holds nothing else."""
    (out / RECORD).unlink(missing_ok=True)
    if not any(out.iterdir()):
        out.rmdir()


def _remember(out: Path, described: dict[str, object]) -> None:
    """Write the recipe into the folder, or check that it is the one already there."""
    record = out / RECORD
    if record.is_file():
        try:
            earlier = json.loads(record.read_text())
        except (UnicodeDecodeError, json.JSONDecodeError) as error:
            raise DataSetError(f"JSON in {record}", f"{error}", "repair or remove it") from None
        if earlier != described:
            got = f"films of another recipe in {out}"
            raise ConfigError("the same recipe and panoramas", got, "choose another --out")
        return
    if out.exists() and not out.is_dir():
        raise DataSetError("a folder", f"{out}, a file", "choose another --out")
    with replacing(record) as temporary:
        temporary.write_text(json.dumps(described, indent=1, default=list) + "\n")
