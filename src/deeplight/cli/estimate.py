"""Estimate the light of photos: an EXR environment, a JSON description and a preview for each.

deeplight estimate photo.jpg --out out

deeplight estimate photos/ clip.mp4 --out out --for blender
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight estimate`."""

    photos: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PHOTO...")]
    """Photos, folders of photos, videos (one result per frame)."""
    out: Path
    """Folder for the results; made if it is missing."""
    fov: float | None = None
    """Vertical field of view of the upright photo in degrees. Default: from EXIF, else 66 degrees
    along the long side."""
    model: Path | None = None
    """Use this .onnx or .tflite file instead of the model that comes with deeplight."""
    made_for: Annotated[
        Literal["blender", "three", "mitsuba", "unity", "unreal", "webxr"] | None,
        tyro.conf.arg(name="for"),
    ] = None
    """Turn the environment for this tool; webxr adds <stem>.webxr.json instead."""
    hdr: bool = False
    """Also write <stem>.hdr (Radiance RGBE)."""


def run(args: Args) -> None:
    """Estimate all that can be; of the rest tell why not, one line each."""
    from deeplight.cli.estimate_batch import Batch
    from deeplight.errors import ConfigError
    from deeplight.estimators.open import open_model

    if not args.photos:
        raise ConfigError("at least one photo, folder or video", "none", "name one")
    if args.fov is not None and not 0 < args.fov < 180:
        raise ConfigError("--fov between 0 and 180 degrees", f"{args.fov:g}", "correct it")
    Batch(
        estimator=open_model(args.model),
        out=args.out,
        fov_deg=args.fov,
        made_for=args.made_for,
        hdr=args.hdr,
    ).run(args.photos)
