"""The files of one estimate: all of them or none."""

import json
from collections.abc import Mapping
from math import degrees
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from deeplight.estimate.onnx_estimator import Estimate, OnnxEstimator
from deeplight.estimate.preview import preview
from deeplight.io.image import write_png
from deeplight.io.lighting_file import LATLONG_HEIGHT, Turn, save_lighting


def write_results(
    estimate: Estimate,
    estimator: OnnxEstimator,
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
        aside = Path(temporary)
        latlong = estimate.lighting.latlong(LATLONG_HEIGHT)
        facts = _facts(estimate, estimator)
        files = save_lighting(
            estimate.lighting, aside / stem, turn=turn, hdr=hdr, facts=facts, latlong=latlong
        )
        for suffix, content in (further or {}).items():
            files.append(aside / f"{stem}{suffix}")
            files[-1].write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        source = estimate.photo.source
        files.append(aside / f"{stem}.preview.png")
        write_png(files[-1], preview(estimate, latlong, source.name if source else stem))
        return _moved(files, folder)


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


def _facts(estimate: Estimate, estimator: OnnxEstimator) -> dict[str, Any]:
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
