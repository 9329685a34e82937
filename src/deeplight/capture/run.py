"""From a folder of clips to a data set: what is to be done, clip by clip, and the last page.

Each clip is one shard and two reports, written whole; killed at any moment, a run goes on with the
clips that are missing. Clips may be added to a data set later.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2

from deeplight.capture.catalogue import Clip
from deeplight.capture.clip import CaptureSettings, ClipRecord, capture_clip
from deeplight.capture.located import TagRig
from deeplight.capture.report import (
    REPORTS,
    fingerprint,
    is_done,
    report_path,
    write_index,
    write_reports,
)
from deeplight.dataset import Manifest, ShardJob, ShardPlan, Skipped
from deeplight.dataset.manifest import read_json
from deeplight.dataset.plan import PLAN
from deeplight.dataset.shards import index_path
from deeplight.dataset.splits import check_places
from deeplight.errors import DataSetError, InputError
from deeplight.io.atomic import only_run
from deeplight.jobs import LOCAL, Engine, run
from deeplight.sphere import Rig

MADE_BY = "deeplight capture"


@dataclass(frozen=True)
class ClipJob:
    """One clip and the shard it becomes."""

    clip: Clip
    shard: ShardJob


@dataclass(frozen=True)
class Outcome:
    """What came of a clip; `reason` is empty if it gave examples."""

    clip: Clip
    read: int
    kept: int
    reason: str


@dataclass(frozen=True)
class Capture:
    """The clips of one data set and how to work on them; small enough for every process.

    Attributes:
        shards: of all clips, those of earlier runs too.
        settings: the same for all.
        missing: what is to be done.
    """

    shards: ShardPlan
    settings: CaptureSettings
    missing: tuple[ClipJob, ...]

    def work(self, job: ClipJob) -> Outcome:
        """Write a clip's shard and reports; one that cannot be used gives an empty shard."""
        cv2.setNumThreads(1)  # a job is one thread; clips are what runs side by side
        record = ClipRecord(job.clip)
        try:
            self.shards.write(job.shard, capture_clip(record, self.settings, job.shard.number))
        except InputError as error:
            record.reason = record.reason or str(error)
            self.shards.write(job.shard, [Skipped(job.clip.path.name, record.reason)])
        write_reports(record, self.shards.folder)
        return Outcome(job.clip, len(record.log), record.kept, record.reason)


def plan(clips: tuple[Clip, ...], out: Path, settings: CaptureSettings) -> Capture:
    """Decide what is to be done before anything is, and remember it in `out`.

    Raises:
        DataSetError: `out` holds a data set that was made otherwise, or a place would be both
            trained on and held out.
        OSError: `out` cannot be written.
    """
    out = out.absolute()  # the same on every machine that shares it
    known = _known(out, _settings_record(settings))
    entries = _numbered(clips, known)
    places: dict[str, set[str]] = {}
    for entry in entries.values():
        places.setdefault(entry["split"], set()).add(entry["place"])
    check_places(places)
    _forget_changed(out, known, entries)
    jobs = sorted((_job(entry) for entry in entries.values()), key=lambda job: job.file)
    recipe = {"made_by": MADE_BY, "settings": _settings_record(settings), "clips": entries}
    shards = ShardPlan.begin(out, jobs, {}, recipe, revised=True)
    for leftover in (out / REPORTS).glob(".*"):
        leftover.unlink()
    unfinished = {job.file for job in shards.missing()}
    missing = []
    for clip in clips:
        job = _job(entries[clip.stem])
        if job.file in unfinished or not is_done(out, clip.stem, fingerprint(clip.path)):
            missing.append(ClipJob(clip, job))
    return Capture(shards, settings, tuple(missing))


def capture(
    what: Capture,
    engine: Engine = LOCAL,
    progress: Callable[[Outcome], None] = lambda outcome: None,
) -> Manifest:
    """Work on every clip that is missing, write the manifest and the page over all clips.

    Raises:
        ConfigError, MissingExtraError: the engine cannot be reached.
        DataSetError: not one clip of the data set gave examples; its reports say why.
        OSError: the data set cannot be written; what is finished stays, to go on with.
    """
    with only_run(what.shards.folder):
        for done in run(what.missing, partial(Capture.work, what), engine):
            if done.error:
                raise done.error
            if done.result:
                progress(done.result)
        manifest = what.shards.finish()
    page = write_index(what.shards.folder, sorted(what.shards.recipe["clips"]))
    if not any(manifest.examples(split) for split in manifest.splits):
        raise DataSetError(
            "at least one usable clip", f"none of {len(manifest.skipped)}", f"see {page}"
        )
    return manifest


def _known(out: Path, settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The clips that `out` holds already, by stem; those that were never finished are left out."""
    if not (out / PLAN).is_file():
        return {}
    old = ShardPlan.open(out)
    if old.recipe.get("made_by") != MADE_BY or old.recipe.get("settings") != settings:
        raise DataSetError(
            f"in {out} a data set captured with the same settings, or nothing",
            "another one",
            "choose another --out, or delete that one",
        )
    unfinished = {job.file for job in old.missing()}
    clips: dict[str, dict[str, Any]] = dict(old.recipe["clips"])
    return {stem: clip for stem, clip in clips.items() if _job(clip).file not in unfinished}


def _numbered(
    clips: tuple[Clip, ...], known: Mapping[str, dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """All clips by stem; one that is known keeps its number, so that its shard keeps its name."""
    entries = dict(known)
    last: dict[str, int] = {}
    for entry in known.values():
        last[entry["split"]] = max(last.get(entry["split"], -1), entry["number"])
    for clip in clips:
        old = known.get(clip.stem)
        if old is None or old["split"] != clip.split:
            last[clip.split] = last.get(clip.split, -1) + 1
            number = last[clip.split]
        else:
            number = old["number"]
        described = {"place": clip.place, "scene": clip.scene, "licence": clip.licence}
        entries[clip.stem] = {"split": clip.split, "number": number, **described}
    return entries


def _forget_changed(
    out: Path, known: Mapping[str, dict[str, Any]], entries: Mapping[str, dict[str, Any]]
) -> None:
    """Remove the shard of a clip of which other things are known than before."""
    for stem, old in known.items():
        if entries[stem] != old:
            shard = out / _job(old).file
            report_path(out, stem).unlink(missing_ok=True)
            index_path(shard).unlink(missing_ok=True)
            shard.unlink(missing_ok=True)


def _job(entry: Mapping[str, Any]) -> ShardJob:
    return ShardJob(entry["split"], entry["number"], 0, 0)  # how many is known only afterwards


def _settings_record(settings: CaptureSettings) -> dict[str, Any]:
    """All that decides the content, as plain JSON values."""
    rig = settings.locate.rig
    described: dict[str, Any] | None = None
    if isinstance(rig, Rig):
        described = rig.to_dict()
    elif isinstance(rig, TagRig):
        centres = {name: centre.tolist() for name, centre in rig.centres_m.items()}
        described = {**asdict(rig), "centres_m": centres}
    return {
        "vertical_fov_rad": settings.vertical_fov_rad,
        "diameter_m": settings.locate.diameter_m,
        "rig": described,
        "choice": asdict(settings.choice),
    }


def surest_rig(what: Capture, manifest: Manifest) -> Rig:
    """The rig of the clip whose least sure sphere is surest."""
    surety = {}
    for stem in what.shards.recipe["clips"]:
        report = read_json(report_path(what.shards.folder, stem))
        if report["status"] == "ok":
            sure = [sphere["confidence"] for sphere in report["spheres"].values()]
            surety[report["rig"]] = min(sure)
    best = max(surety, key=lambda name: surety[name])
    return Rig.from_dict(dict(manifest.rigs[best]))
