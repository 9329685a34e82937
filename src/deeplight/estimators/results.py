"""The files of one estimate: all of them or none."""

import errno
import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import Any

from deeplight.environment import Environment
from deeplight.estimators.confidence import confidence_of
from deeplight.estimators.environment import ITSELF, SceneLight
from deeplight.estimators.network import Estimate, NetworkEstimator
from deeplight.estimators.preview import preview
from deeplight.estimators.sureness import camera_record, sureness_of
from deeplight.io.atomic import staging
from deeplight.io.lighting_file import (
    LATLONG_HEIGHT,
    Turn,
    lamps_record,
    save_lighting,
    seen_record,
)
from deeplight.io.photos import write_png
from deeplight.io.tilt import Tilt
from deeplight.preprocess import frame_photo, hull, looks, slid_into_photo

FULL_DISK_BYTES = 2**22
"""With less room than this left, a failed write is put down to a full disk."""


@dataclass(frozen=True)
class OutputSpec:
    """How an environment is written.

    Attributes:
        turn: how to turn it for a tool.
        hdr: also as Radiance RGBE.
        lamps_apart: leave the lamps out of it; the JSON has them in any case.
        seen_channel: add what the photo shows as a channel of the EXR.
        height: rows of the bare network's environment; a `SceneLight` has its own.
    """

    turn: Turn | None = None
    hdr: bool = False
    lamps_apart: bool = False
    seen_channel: bool = False
    height: int = LATLONG_HEIGHT


def write_results(
    estimate: Estimate,
    estimator: NetworkEstimator,
    folder: Path,
    stem: str,
    scene: SceneLight | None = None,
    spec: OutputSpec = OutputSpec(),
    further: Mapping[str, Any] | None = None,
    facts: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write `<stem>.exr`, `.json`, `.preview.png` and what else was asked for into `folder`.

    They are written aside first. If anything fails, a full disk for one, nothing of them stays.

    Args:
        estimate: what to write.
        estimator: whose it is; the JSON names its model.
        folder: must exist.
        stem: name of the files without suffix.
        scene: the light with the photo in it; left out, the network's estimate alone is written.
        spec: how.
        further: more JSON files, content by suffix, such as ".webxr.json".
        facts: more entries of the `.json`.

    Raises:
        OSError: a file cannot be written.
    """
    with staging(folder, stem) as temporary:
        try:
            files = _written(estimate, estimator, temporary / stem, scene, spec, facts or {})
            for suffix, content in (further or {}).items():
                files.append(temporary / f"{stem}{suffix}")
                files[-1].write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
            return _moved(files, folder)
        except OSError as error:
            if shutil.disk_usage(temporary).free > FULL_DISK_BYTES:
                raise
            reason = os.strerror(errno.ENOSPC)  # image writers only say that they failed
            raise OSError(errno.ENOSPC, reason, str(folder / stem)) from error


def _written(
    estimate: Estimate,
    estimator: NetworkEstimator,
    stem: Path,
    scene: SceneLight | None,
    spec: OutputSpec,
    more: Mapping[str, Any],
) -> list[Path]:
    confidence = sureness_of(estimate) or confidence_of(estimator, estimate)
    facts = _facts(estimate, estimator) | {"confidence": confidence.record()}
    if estimate.heads:
        facts["camera_guess"] = camera_record(estimate.heads)
    facts |= more
    seen, main_light, elsewhere = None, None, ""
    if scene is None:
        ball = Environment.from_lighting(estimate.lighting, spec.height)
        environment = replace(ball, known_lamps=())
        lighting, latlong = estimate.lighting, environment.radiance
    else:
        environment, lighting = scene.environment, scene.environment.lighting
        main_light = environment.main_light
        latlong = scene.rest if spec.lamps_apart else environment.radiance
        seen = scene.seen if spec.seen_channel else None
        facts["lamps"] = lamps_record(scene.lamps, in_environment=not spec.lamps_apart)
        unseen = elsewhere_record(scene)
        elsewhere = unseen["elsewhere"]
        facts["seen"] = seen_record(scene.seen) | unseen
        if scene.tilt is not None:
            facts["camera_tilt"] = _tilt_record(scene.tilt)
    files = save_lighting(
        lighting,
        stem,
        turn=spec.turn,
        hdr=spec.hdr,
        facts=facts,
        latlong=latlong,
        seen=seen,
        main_light=main_light,
    )
    source = estimate.photo.source
    title = source.name if source else stem.name
    files.append(stem.with_name(f"{stem.name}.preview.png"))
    known = confidence.words["direction"] == "roughly known"
    tilt = scene.tilt if scene else None
    said = confidence.sentences
    picture = preview(estimate, environment, title, said, known, tilt, elsewhere)
    write_png(files[-1], picture)
    return files


def elsewhere_record(scene: SceneLight) -> dict[str, str]:
    """Give the JSON entries of what the environment is where the photo does not look."""
    if scene.detail_of is None:
        return {"elsewhere": "estimated"}
    if scene.detail_of == ITSELF:
        return {"elsewhere": "estimated, brought to the means of the rows that the photo shows"}
    return {"elsewhere": "estimated, its detail invented", "detail_of": scene.detail_of}


def _tilt_record(tilt: Tilt) -> dict[str, Any]:
    """The tilt that the photo went on by and the preview is level by."""
    return {
        "pitch_deg": degrees(tilt.pitch_rad),
        "roll_deg": degrees(tilt.roll_rad),
        "meaning": "pitch: up is positive; roll: counter-clockwise is positive; scale: two of "
        "three such pitches are less off, 0 where it is known; up: against gravity, camera frame; "
        "`deeplight convert --turn 0 PITCH ROLL` makes the environment level",
        "scale_deg": degrees(tilt.scale_rad),
        "source": tilt.source,
        "up": tilt.up.tolist(),
    }


def _moved(files: list[Path], folder: Path) -> list[Path]:
    moved: list[Path] = []
    try:
        for file in files:
            moved.append(file.replace(folder / file.name))
    except OSError:
        for file in moved:
            file.unlink(missing_ok=True)
        raise
    return moved


def _facts(estimate: Estimate, estimator: NetworkEstimator) -> dict[str, Any]:
    """Give the JSON entries that say where the light comes from."""
    used, source = estimate.framing, estimate.photo.source
    fov, (height, width) = used.vertical_fov_rad, estimate.photo.full_size
    # The photo may have been read smaller; users speak of the pixels in their file.
    framing = frame_photo(height, width, fov, used.fov_source, estimator.contract)
    framing = slid_into_photo(framing)
    shown = hull(looks(framing))
    return {
        "contract_version": estimator.contract.version,
        "model": {
            "file": estimator.path.name,
            "sha256": estimator.sha256,
            "trained_on": estimator.contract.trained_on,
        },
        "photo": {
            "file": source.name if source else None,
            "width": framing.photo_width,
            "height": framing.photo_height,
        },
        "framing": {
            "vertical_fov_deg": degrees(framing.vertical_fov_rad),
            "fov_source": framing.fov_source,
            "visible_fraction": framing.visible_fraction,
            "used_fraction": shown.used_fraction,
            "seen_by_the_network": {
                "top": shown.top,
                "bottom": shown.bottom,
                "left": shown.left,
                "right": shown.right,
                "unit": "pixels of the upright photo, from its upper left corner",
            },
        },
        "notes": list(estimate.notes),
    }
