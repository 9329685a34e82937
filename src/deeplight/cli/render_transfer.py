"""From the words of `deeplight render transfer` to a file."""

from time import perf_counter

from rich.console import Console
from rich.markup import escape

from deeplight.cli.compose_run import bar
from deeplight.cli.render import Args
from deeplight.compose.mesh import load
from deeplight.errors import ConfigError
from deeplight.transfer.file import write
from deeplight.transfer.ground import Ground
from deeplight.transfer.precompute import Settings, precompute


def run_transfer(args: Args) -> None:
    """Work out one object's transfer, with a progress bar; print what was made.

    Raises:
        InputError: an option or the mesh cannot be used.
        OSError: a file cannot be read or written.
    """
    settings = settings_of(args)
    if args.out.is_dir():
        raise ConfigError("a file to write", f"{args.out}, a folder", "name a file in it")
    meshes, begun = load(args.mesh, args.up), perf_counter()
    with bar() as progress:
        task = progress.add_task("tracing rays", total=None)
        transfer, notes = precompute(
            meshes,
            settings,
            lambda done, total: progress.update(task, completed=done, total=total),
        )
    write(args.out, transfer)
    console = Console(highlight=False, soft_wrap=True)
    took = perf_counter() - begun
    size = f"{len(transfer.vertices):,} vertices, {args.out.stat().st_size / 1000:,.0f} kB"
    console.print(escape(f"{args.mesh} -> {args.out} ({size}, {took:.0f} s)"))
    for note in notes:
        console.print(f"  [dim]{escape(note)}[/dim]")


def settings_of(args: Args) -> Settings:
    """Give the settings of the library.

    Raises:
        ConfigError: one is out of range.
    """
    return Settings(
        order=args.order,
        samples=args.samples,
        bounces=args.bounces,
        diffuse=None if args.diffuse == "own" else args.diffuse,
        glossy=args.silver,
        roughness=args.roughness,
        ground=None if args.ground is None else Ground(args.ground_points, 1.6, args.ground),
        longest_edge=args.longest_edge,
    )
