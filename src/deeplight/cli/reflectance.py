"""Photographs of spheres under one light at a time -> their reflectance bases, with a certificate.

deeplight reflectance stage --out basis.npz

The folder holds a sub-folder of photographs for each sphere (mirror, matte_silver, diffuse), with
dark.png, and lights.json or lights.csv and camera.json: see docs/reflectance.md. Beside the basis
come <stem>.certificate.json and <stem>.picture.png. `python -m lab.light_stage` makes such
a folder.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight reflectance`."""

    folder: Annotated[Path, tyro.conf.Positional]
    """The light stage's folder."""
    out: Path
    """The .npz to write."""
    material: str | None = None
    """Name of the one sphere whose photographs lie in the folder itself."""
    lights: Path | None = None
    """List of the lights (.json or .csv); left out, the folder's own."""
    directions_from_mirror: bool = False
    """Find the lights in the mirror ball instead of believing the list."""
    fov: float | None = None
    """Vertical field of view of the upright photographs, degrees; before camera.json and EXIF."""
    linear: bool = False
    """Integer files are linear."""
    gamma: float | None = None
    """Of integer files: before what camera.json says, which is 2.2 if it says nothing."""
    circle: tuple[float, float, float] | None = None
    """x y radius of the sphere in pixels, instead of looking for it."""
    reflectivity: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Set the scale by one sphere: --reflectivity diffuse=0.345."""
    passes: int = 2
    """1: the paper's Phong lobe alone; 2: what the lobe blurs is put back once."""


def run(args: Args) -> None:
    """Read with a progress bar, print the certificate, write the files."""
    from deeplight.cli.reflectance_report import reading, settings_of, show
    from deeplight.light_stage.files import check_name, write_measured
    from deeplight.light_stage.measure import measure, photographs_in

    check_name(args.out)
    how = settings_of(args)
    with reading(photographs_in(args.folder, how)) as advance:
        measured = measure(args.folder, how, advance)
    files = write_measured(args.out, measured, args.folder, how)
    show(measured.certificate, files)
