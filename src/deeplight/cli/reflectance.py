"""Photographs of spheres under one light at a time -> their reflectance bases, with a certificate.

deeplight reflectance stage --out basis.npz

The folder holds a sub-folder of photographs for each sphere (mirror, matte_silver, diffuse), with
dark.png, and lights.json or lights.csv and camera.json: see docs/reflectance.md. Next to the basis
come <stem>.certificate.json and <stem>.picture.png. `python -m lab.light_stage` makes such
a folder.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from collections.abc import Sequence

    from deeplight.light_stage.certificate import Certificate, SphereCertificate
    from deeplight.light_stage.measure import MeasureSettings


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
    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.screen import progress_bar
    from deeplight.light_stage.files import check_name, write_measured
    from deeplight.light_stage.folder import all_linear
    from deeplight.light_stage.measure import measure, photographs_in

    check_name(args.out)
    how = _settings(args)
    if all_linear(args.folder):
        refuse_unused(args, "with photographs that are linear already", "linear", "gamma")
    with progress_bar("reading photographs", photographs_in(args.folder, how)) as advance:
        measured = measure(args.folder, how, advance)
    files = write_measured(args.out, measured, args.folder, how)
    _show(measured.certificate, files)


def _settings(args: Args) -> "MeasureSettings":
    """The options as settings; ConfigError for impossible ones."""
    from deeplight.errors import ConfigError
    from deeplight.light_stage.measure import MeasureSettings

    if args.linear and args.gamma is not None:
        raise ConfigError("--linear or --gamma", "both", "give one")
    return MeasureSettings(
        material=args.material,
        lights=args.lights,
        directions_from_mirror=args.directions_from_mirror,
        fov_deg=args.fov,
        gamma=1.0 if args.linear else args.gamma,
        circle=args.circle,
        reflectivity=dict(_named_value(text) for text in args.reflectivity),
        passes=args.passes,
    )


def _show(certificate: "Certificate", files: "Sequence[Path]") -> None:
    """Print the furnace of every sphere, warnings, and the files."""
    from rich.markup import escape
    from rich.table import Table

    from deeplight.cli.screen import print_tables, results_console

    console = results_console()
    table = Table("sphere", "furnace", "expected", "lowest", "highest", "colour")
    for name, sphere in certificate.spheres.items():
        table.add_row(escape(name), *_cells(sphere))
    print_tables([table])
    for name, sphere in certificate.spheres.items():
        (x, y), (major, minor) = sphere.centre_px, sphere.axes_px
        place = f"found at {x:.2f}, {y:.2f} px with half axes {major:.2f}, {minor:.2f} px"
        console.print(f"{escape(name)} {place}")
    console.print(f"{certificate.lights} lights; scale from {escape(certificate.scale_from)}")
    for warning in certificate.warnings:
        console.print(f"warning: {escape(warning)}", style="yellow")
    console.print(escape(" ".join(str(file) for file in files)))


def _cells(sphere: "SphereCertificate") -> list[str]:
    expected = "unknown" if sphere.expected is None else f"{sphere.expected}"
    note = " (given)" if sphere.forced else "" if sphere.photographed else " (one-hot)"
    return [
        f"{sphere.measured:.4f}",
        expected + note,
        f"{sphere.lowest:.4f}",
        f"{sphere.highest:.4f}",
        " ".join(f"{c:.3f}" for c in sphere.colour) if sphere.photographed else "",
    ]


def _named_value(text: str) -> tuple[str, float]:
    from deeplight.errors import ConfigError

    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        do = "write --reflectivity diffuse=0.345"
        raise ConfigError("SPHERE=VALUE", repr(text), do) from None
