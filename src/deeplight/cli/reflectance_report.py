"""What `deeplight reflectance` shows, and its options as settings."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from deeplight.cli.reflectance import Args
from deeplight.errors import ConfigError
from deeplight.light_stage.certificate import Certificate, SphereCertificate
from deeplight.light_stage.measure import MeasureSettings


def settings_of(args: Args) -> MeasureSettings:
    """The options as settings; ConfigError for impossible ones."""
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


@contextmanager
def reading(total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar over photographs."""
    columns = (TextColumn("reading photographs"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda n: bar.advance(task, n)


def show(certificate: Certificate, files: Sequence[Path]) -> None:
    """Print the furnace of every sphere, warnings, and the files."""
    console = Console()
    table = Table("sphere", "furnace", "expected", "lowest", "highest", "colour")
    for name, sphere in certificate.spheres.items():
        table.add_row(escape(name), *_cells(sphere))
    console.print(table)
    for name, sphere in certificate.spheres.items():
        (x, y), (major, minor) = sphere.centre_px, sphere.axes_px
        place = f"found at {x:.2f}, {y:.2f} px with half axes {major:.2f}, {minor:.2f} px"
        console.print(f"{escape(name)} {place}", soft_wrap=True, highlight=False)
    console.print(f"{certificate.lights} lights; scale from {escape(certificate.scale_from)}")
    for warning in certificate.warnings:
        console.print(f"warning: {escape(warning)}", style="yellow", soft_wrap=True)
    console.print(escape(" ".join(str(file) for file in files)), soft_wrap=True)


def _cells(sphere: SphereCertificate) -> list[str]:
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
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        do = "write --reflectivity diffuse=0.345"
        raise ConfigError("SPHERE=VALUE", repr(text), do) from None
