"""Measure the light of a place with a camera: exposures of a mirror ball or panorama in, HDR out.

deeplight probe IMG_1*.jpg --out truth.exr

deeplight probe IMG_1*.jpg --like photo.jpg --card 400 1200 80 80 --out truth.exr

deeplight probe pano_*.jpg --shows panorama --times 0.001 0.004 0.016 --out truth.exr

Photos of one view from a tripod, each two or three stops longer than the last; EXIF says how
long. Writes any format of `deeplight convert`; with --check also the merged picture and where the
ball was found.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight probe`."""

    photos: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="PHOTO...", help_behavior_hint="(one or more)"),
    ]
    """The exposures, in any order."""
    out: Path
    """Environment to write: .exr .hdr .json and what else `deeplight convert` knows."""
    shows: Literal["mirror-ball", "panorama"] = "mirror-ball"
    """What the photos show; a panorama is equirectangular, its centre the view."""
    times: Annotated[tuple[float, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Exposure of each photo in the order given, in seconds, where EXIF does not say it."""
    gamma: float | None = None
    """Of the stored values, 1 for linear ones; left out, recovered from three or more photos."""
    align: bool = False
    """Shift the frames onto each other."""
    ball: tuple[float, float, float] | None = None
    """X Y RADIUS of the ball in pixels; left out, it is looked for."""
    focal: float | None = None
    """Focal length in pixels; left out, EXIF's."""
    reflectivity: float = 0.827
    """Of the ball."""
    card: tuple[int, int, int, int] | None = None
    """X Y WIDTH HEIGHT of a grey card in pixels: makes it neutral and sets the unit."""
    card_reflectance: float = 0.18
    """Of the card."""
    chart: Annotated[tuple[float, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """X Y of a 24-patch chart's corners: at dark skin, bluish green, black, white."""
    like: Path | None = None
    """The photo whose true light this is: 1.0 becomes the white of its exposure."""
    check: Path | None = None
    """Folder for pictures to check by eye."""


def run(args: Args) -> None:
    from deeplight.bracket.check import write_check
    from deeplight.bracket.probe import ProbeSettings, measure
    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.screen import results_console
    from deeplight.formats.files import FileSpec, write_environment

    if args.card is None:
        refuse_unused(args, "without --card", "card_reflectance")
    if args.shows == "panorama":
        refuse_unused(args, "with --shows panorama", "ball", "reflectivity")
    spec = FileSpec(args.out)
    spec.must_not_replace(args.photos)
    settings = ProbeSettings(
        args.shows,
        args.times,
        args.gamma,
        args.align,
        args.ball,
        args.focal,
        args.reflectivity,
        args.card,
        args.card_reflectance,
        args.chart,
        args.like,
    )
    probe = measure(args.photos, settings)
    console = results_console()
    for fact in probe.facts:
        console.print(fact)
    if args.check is not None:
        console.print(f"look at {write_check(probe, args.check)}")
    for path in write_environment(probe.environment, spec):
        console.print(f"{path}")
