"""The report of a clip: `reports/<stem>.json` for programs, `reports/<stem>.html` for people."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.camera import PinholeCamera
from deeplight.capture.choice import CAUSES
from deeplight.capture.clip import ClipRecord
from deeplight.dataset.contact_sheet import enlarged
from deeplight.dataset.manifest import read_json, write_json
from deeplight.errors import DataSetError
from deeplight.report.chart import Chart, Curve, Mark
from deeplight.report.page import Figure, Heading, Link, Page, PageRow, Paragraph, Table
from deeplight.sphere import SPHERES

REPORTS = "reports"
VERSION = 1
_ENDS = 1 << 20  # bytes at the start and the end of a clip that name its content
_CROP_PX = 96  # of a crop, as shown


def report_path(folder: Path, stem: str) -> Path:
    """Where the report for programs lies; the one for people next to it."""
    return folder / REPORTS / f"{stem}.json"


def fingerprint(clip: Path) -> str:
    """Name a file's content without reading all of it: its size and both ends."""
    try:
        size = clip.stat().st_size
        with clip.open("rb") as file:
            start = file.read(_ENDS)
            file.seek(max(0, size - _ENDS))
            ends = start + file.read(_ENDS)
    except OSError:
        return "unreadable"
    return f"{size}-{hashlib.sha256(ends).hexdigest()[:32]}"


def write_reports(record: ClipRecord, folder: Path) -> None:
    """Write both reports of a clip, each whole or not at all.

    Raises:
        OSError: they cannot be written.
    """
    path = report_path(folder, record.clip.stem)
    page(record).write(path.with_suffix(".html"))
    write_json(path, described(record))


def described(record: ClipRecord) -> dict[str, Any]:
    """The report for programs."""
    clip, video, chooser = record.clip, record.video, record.chooser
    return {
        "version": VERSION,
        "status": "failed" if record.reason else "ok",
        "reason": record.reason,
        "clip": clip.path.name,
        "content": fingerprint(clip.path),
        "place": clip.place,
        "scene": clip.scene,
        "split": clip.split,
        "frames": {
            "read": len(record.log),
            "kept": record.kept,
            "dropped": chooser.dropped if chooser else {},
        },
        "spheres": _spheres(record),
        "rig": record.rig_name or None,
        "method": record.located.method if record.located else None,
        "warnings": list(record.warnings),
        "video": None
        if video is None
        else {
            "width": video.width,
            "height": video.height,
            "rate_hz": video.rate_hz,
            "codec": video.codec,
            "transfer": video.transfer,
            "rotation_deg": video.rotation_deg,
            "mirrored": video.mirrored,
            "vertical_fov_deg": record.camera and round(_fov_deg(record.camera), 3),
        },
    }


def _spheres(record: ClipRecord) -> dict[str, Any]:
    located = record.located
    if located is None or record.reason:
        return {}
    spheres = {}
    for name in SPHERES:
        view, oval = located.rig.views[name], located.ellipses[name]
        spheres[name] = {
            "direction": (-view.ball_from_camera[2]).tolist(),
            "angular_radius_rad": view.angular_radius_rad,
            "distance_m": round(float(located.distance_m[name]), 7),
            "confidence": round(float(located.confidence[name]), 5),
            "ellipse_px": {
                "centre": [round(float(x), 4) for x in (oval.x, oval.y)],
                "axes": [round(float(axis), 4) for axis in (oval.major, oval.minor)],
                "angle_deg": round(float(oval.angle_deg), 4),
            },
        }
    return spheres


def page(record: ClipRecord) -> Page:
    """The report for people."""
    clip = record.clip
    read, kept = len(record.log), record.kept
    outcome = "failed" if record.reason else f"{kept} of {read} frames became examples"
    result = Page(f"Clip {clip.stem}", f"{clip.path.name}: {outcome}.")
    if record.reason:
        result.add(Paragraph(record.reason, "failure"))
    result.add(*(Paragraph(f"Look at this: {text}.", "warning") for text in record.warnings))
    if record.overlay is not None:
        alt = "a frame with what was seen" if record.reason else "a frame with the outlines found"
        caption = "What was seen." if record.reason else "The outlines found, by name and surety."
        result.add(Heading("The rig"), Figure(record.overlay, caption, alt, 380))
    if record.located is not None:
        result.add(_geometry(record))
    if record.shown:
        result.add(Heading("The crops over time"), *_crops(record))
    if read:
        result.add(*_curves(record))
    result.add(Heading("Frames"), _fates(record), Heading("The clip"), _facts(record))
    return result


def _geometry(record: ClipRecord) -> Table:
    located = record.located
    assert located is not None
    rows = []
    for name in SPHERES:
        view = located.rig.views[name]
        x, y, z = -view.ball_from_camera[2]
        rows.append(
            (
                name.replace("_", " "),
                round(100 * float(located.distance_m[name]), 1),
                round(float(np.degrees(np.arctan2(x, -z))), 2),
                round(float(np.degrees(np.arcsin(y))), 2),
                round(float(np.degrees(view.angular_radius_rad)), 3),
                round(float(located.confidence[name]), 2),
            )
        )
    head = ("sphere", "distance, cm", "right, °", "up, °", "angular radius, °", "surety")
    return Table(
        head, rows, f"Estimated geometry, seen from the camera; found by {located.method}."
    )


def _crops(record: ClipRecord) -> list[PageRow]:
    every = max(1, -(-len(record.shown) // 8))
    rows = []
    for name in SPHERES:
        title = name.replace("_", " ")
        figures = [
            Figure(
                enlarged(spheres[name], 2 * _CROP_PX),
                f"frame {number}",
                f"{title} sphere in frame {number}",
                _CROP_PX,
            )
            for number, spheres in record.shown[::every]
        ]
        rows.append(PageRow(figures, f"The {title} sphere, as the ideal camera sees it."))
    return rows


def _curves(record: ClipRecord) -> list[Heading | Chart]:
    log = record.log
    time_s = log.column("time_s").tolist()
    causes = record.chooser.causes if record.chooser else []
    marks = [
        Mark(cause.replace("_", " "), [time_s[n] for n, c in enumerate(causes) if c == cause], tone)
        for tone, cause in enumerate(CAUSES)
        if cause in causes
    ]
    lost = [
        Curve("mean", time_s, log.column("mean").tolist(), 0),
        Curve("white", time_s, log.column("clipped").tolist(), 1),
        Curve("black", time_s, log.column("black").tolist(), 4),
    ]
    sharp = [Curve("sharpness", time_s, log.column("sharpness").tolist(), 2)]
    change = [Curve("change", time_s, log.column("change").tolist(), 0)]
    return [
        Heading("Exposure, sharpness, movement"),
        Chart("Brightness, and the shares lost to white and black", lost, (), "seconds"),
        Chart("Sharpness; ticks are the frames left out", sharp, marks, "seconds"),
        Chart("Change from frame to frame, grey levels", change, (), "seconds"),
    ]


def _fates(record: ClipRecord) -> Table:
    dropped = record.chooser.dropped if record.chooser else {}
    rows = [("read", len(record.log)), ("kept", record.kept)]
    rows += [(cause.replace("_", " "), count) for cause, count in dropped.items()]
    return Table(("frames", "count"), rows)


def _facts(record: ClipRecord) -> Table:
    clip, video = record.clip, record.video
    rows = [("place", clip.place), ("scene", clip.scene), ("split", clip.split)]
    rows.append(("licence", clip.licence))
    if video is not None:
        uneven = ", unevenly spaced" if video.variable_rate else ""
        turn = f", stored turned by {video.rotation_deg}°" if video.rotation_deg else ""
        turn += ", stored mirrored" if video.mirrored else ""
        rows += [
            ("upright picture", f"{video.width} x {video.height}{turn}"),
            (
                "taken to see vertically",
                f"{_fov_deg(record.camera):.1f}°" if record.camera else "",
            ),
            ("frames a second", f"{video.rate_hz or 0:.4g}{uneven}"),
            ("coding", f"{video.codec}, {video.transfer}"),
        ]
    return Table(("", ""), rows)


def _fov_deg(camera: PinholeCamera) -> float:
    return float(np.degrees(camera.vertical_fov_rad))


def write_index(folder: Path, stems: list[str]) -> Path:
    """Write `reports/index.html` over all clips; give its path."""
    reports = [(stem, read_json(report_path(folder, stem))) for stem in stems]
    failed = sum(report["status"] != "ok" for _, report in reports)
    kept = sum(report["frames"]["kept"] for _, report in reports)
    summary = f"{len(reports) - failed} of {len(reports)} clips gave {kept} examples."
    rows = [
        (
            Link(stem, f"{stem}.html"),
            report["status"],
            report["split"],
            report["frames"]["read"],
            report["frames"]["kept"],
            len(report["warnings"]),
            report["reason"],
        )
        for stem, report in reports
    ]
    result = Page("Captured clips", summary)
    head = ("clip", "status", "split", "frames read", "kept", "warnings", "reason")
    result.add(Table(head, rows))
    path = folder / REPORTS / "index.html"
    result.write(path)
    return path


def is_done(folder: Path, stem: str, content: str) -> bool:
    """Whether the reports of a clip of this content are there."""
    path = report_path(folder, stem)
    if not (path.is_file() and path.with_suffix(".html").is_file()):
        return False
    try:
        values = read_json(path)
    except DataSetError:
        return False
    return isinstance(values, dict) and values.get("content") == content
