"""The files of one estimate: all of them or none."""

import errno
import json
import os
import shutil
from collections.abc import Mapping
from math import degrees
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from deeplight.estimators.network import Estimate, NetworkEstimator
from deeplight.estimators.preview import preview
from deeplight.io.lighting_file import LATLONG_HEIGHT, Turn, save_lighting
from deeplight.io.photos import write_png

FULL_DISK_BYTES = 2**22
"""With less room than this left, a failed write is put down to a full disk."""


def write_results(
    estimate: Estimate,
    estimator: NetworkEstimator,
    folder: Path,
    stem: str,
    *,
    turn: Turn | None = None,
    hdr: bool = False,
    further: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write `<stem>.exr`, `.json`, `.preview.png` and what else was asked for into `folder`.

    They are written aside first. If anything fails, a full disk for one, nothing of them stays.

    Args:
        estimate: what to write.
        estimator: whose it is; the JSON names its model.
        folder: must exist.
        stem: name of the files without suffix.
        turn: how to turn the environment for a tool.
        hdr: also write Radiance RGBE.
        further: more JSON files, content by suffix, such as ".webxr.json".

    Raises:
        OSError: a file cannot be written.
    """
    with TemporaryDirectory(prefix=f".{stem[:80]}.", dir=folder) as temporary:
        try:
            files = _written(estimate, estimator, Path(temporary) / stem, turn, hdr)
            for suffix, content in (further or {}).items():
                files.append(Path(temporary) / f"{stem}{suffix}")
                files[-1].write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
            return _moved(files, folder)
        except OSError as error:
            if shutil.disk_usage(temporary).free > FULL_DISK_BYTES:
                raise
            told = os.strerror(errno.ENOSPC)  # image writers only say that they failed
            raise OSError(errno.ENOSPC, told, str(folder / stem)) from error


def _written(
    estimate: Estimate, estimator: NetworkEstimator, stem: Path, turn: Turn | None, hdr: bool
) -> list[Path]:
    latlong = estimate.lighting.latlong(LATLONG_HEIGHT)
    facts = _facts(estimate, estimator)
    files = save_lighting(estimate.lighting, stem, turn=turn, hdr=hdr, facts=facts, latlong=latlong)
    source = estimate.photo.source
    files.append(stem.with_name(f"{stem.name}.preview.png"))
    write_png(files[-1], preview(estimate, latlong, source.name if source else stem.name))
    return files


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
    """Give the JSON entries that tell where the light comes from."""
    framing = estimate.framing
    source = estimate.photo.source
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
            "used_fraction": framing.used_fraction,
            "seen_by_the_network": {
                "top": framing.top,
                "bottom": framing.bottom,
                "left": framing.left,
                "right": framing.right,
                "unit": "pixels of the upright photo, from its upper left corner",
            },
        },
        "notes": list(estimate.notes),
    }
