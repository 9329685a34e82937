"""The files of one fused light: .exr, .json and a preview, all of them or none."""

import shutil
from math import degrees
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from deeplight.camera_response import CameraResponse
from deeplight.environment import Environment
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.preview import (
    FAINT,
    INK,
    MARGIN,
    PAPER,
    SPHERE,
    WIDTH,
    draw_spheres,
    mark_lamps,
)
from deeplight.fuse.fuse import Fused
from deeplight.io.atomic import staging
from deeplight.io.lighting_file import Turn, lamps_record, save_lighting, seen_record
from deeplight.io.photos import write_png
from deeplight.mappings import latlong

_THUMB_ROWS, _MOST_THUMBS = 96, 16
_WARN = (255, 120, 90)
_UNSEEN_DIM = 0.35  # how much darker the preview shows what no frame saw


def write_fused(
    fused: Fused,
    estimator: NetworkEstimator,
    folder: Path,
    stem: str,
    turn: Turn | None = None,
    hdr: bool = False,
) -> list[Path]:
    """Write `<stem>.exr` (with a channel `seen`), `.json` and `.preview.png` into a folder.

    Args:
        fused: what to write.
        estimator: whose estimates are in it; the JSON names its model.
        folder: must exist.
        stem: name of the files without suffix.
        turn: how to turn the environment for a tool.
        hdr: also write Radiance RGBE.

    Raises:
        OSError: a file cannot be written.
    """
    environment = fused.environment
    with staging(folder, stem) as temporary:
        base = temporary / stem
        files = save_lighting(
            environment.lighting,
            base,
            turn=turn,
            hdr=hdr,
            facts=_facts(fused, estimator),
            latlong=environment.radiance,
            seen=environment.seen,
            main_light=environment.main_light,
        )
        files.append(base.with_name(f"{stem}.preview.png"))
        write_png(files[-1], preview(fused, stem))
        return [Path(shutil.move(file, folder / file.name)) for file in files]


def _facts(fused: Fused, estimator: NetworkEstimator) -> dict[str, Any]:
    environment = fused.environment
    facts: dict[str, Any] = {
        "contract_version": estimator.contract.version,
        "model": {"file": estimator.path.name, "sha256": estimator.sha256},
        "fused": {
            "vertical_fov_deg": degrees(fused.vertical_fov_rad),
            "frames": [
                {
                    "name": frame.name,
                    "frame": frame.number,
                    "rotation": np.round(turn, 7).tolist(),
                }
                for frame, turn in zip(fused.placed, fused.rotations, strict=True)
            ],
            "meaning": "rotation: three rows, this file's frame from the camera's",
            "dropped": [frame.name for frame in fused.dropped],
            "seen_share": seen_share(environment),
        },
        "notes": list(fused.notes),
        "lamps": lamps_record(environment.lamps, in_environment=True),
    }
    if environment.frame == "level":
        facts["frame"] = "level: +Y against gravity, -Z the view made level, +X right of it"
    if environment.seen is not None:
        facts["seen"] = seen_record(environment.seen)
    return facts


def seen_share(environment: Environment) -> float:
    """Share of all directions that was seen, 0 to 1."""
    if environment.seen is None:
        return 0.0
    solid_angle = latlong.solid_angles(*environment.seen.shape)
    return float((environment.seen * solid_angle).sum() / (4 * np.pi))


def preview(fused: Fused, title: str) -> UInt8[np.ndarray, "height width 3"]:
    """One picture to look at: frames used and dropped, the light, three spheres in it."""
    environment, width = fused.environment, WIDTH - 2 * MARGIN
    pano = _tone_mapped(environment.radiance)
    if environment.seen is not None:
        share = environment.seen[..., None]
        pano = (pano * (1 - _UNSEEN_DIM * (1 - share))).astype(np.uint8)
    picture = Image.fromarray(pano).resize((width, width // 2), Image.Resampling.LANCZOS)
    top, below = MARGIN + 40, MARGIN + 40 + width // 2 + 16
    height = below + SPHERE + 32 + MARGIN
    canvas = Image.new("RGB", (WIDTH, height), PAPER)
    draw = ImageDraw.Draw(canvas)
    font, small = ImageFont.load_default(22), ImageFont.load_default(15)
    draw.text((MARGIN, MARGIN), title[:60], INK, font)
    caption = f"{seen_share(environment):.0%} seen; the rest, darker, is estimated"
    draw.text((WIDTH - MARGIN, MARGIN + 4), caption, FAINT, small, anchor="ra")
    canvas.paste(picture, (MARGIN, top))
    mark_lamps(draw, environment.lamps, (MARGIN, top, width, width // 2))
    spheres = WIDTH - MARGIN - 3 * (SPHERE + 24)
    draw_spheres(canvas, environment, spheres, below)
    _thumbnails(canvas, fused, below, spheres - MARGIN, small)
    return np.asarray(canvas)


def _thumbnails(
    canvas: Image.Image,
    fused: Fused,
    top: int,
    room: int,
    font: ImageFont.ImageFont | ImageFont.FreeTypeFont,
) -> None:
    """Dropped frames first, because they are what one has to look at, then the front photo."""
    x, draw = MARGIN, ImageDraw.Draw(canvas)
    step = max(1, len(fused.placed) // _MOST_THUMBS)
    used = ((fused.front,) if fused.front else ()) + fused.placed[::step]
    for frame, dropped in [(f, True) for f in fused.dropped[:4]] + [(f, False) for f in used]:
        rows, columns, _ = frame.pixels.shape
        size = (max(1, round(columns * _THUMB_ROWS / rows)), _THUMB_ROWS)
        if x + size[0] > MARGIN + room:
            break
        thumb = cv2.resize(frame.pixels, size, interpolation=cv2.INTER_AREA)
        canvas.paste(Image.fromarray(np.asarray(thumb)), (x, top))
        if dropped:
            draw.rectangle((x, top, x + size[0] - 1, top + size[1] - 1), outline=_WARN, width=3)
        x += size[0] + 4
    text = f"{len(fused.placed)} frame{'s' * (len(fused.placed) != 1)} placed"
    if fused.dropped:
        text += f", {len(fused.dropped)} could not be (outlined)"
    if fused.front:
        text += ", and the front photo"
    draw.text((MARGIN, top + _THUMB_ROWS + 6), text, FAINT, font)


def _tone_mapped(radiance: np.ndarray) -> UInt8[np.ndarray, "height width 3"]:
    pixel = CameraResponse().pixel_from_radiance(np.asarray(radiance, np.float32))
    levels: np.ndarray = np.floor(np.clip(pixel, 0, 1) * 255 + 0.5)
    return levels.astype(np.uint8)
