"""Work out how an object takes up light, so that any light can shade it in real time.

deeplight transfer bunny --out bunny.transfer

deeplight transfer chair.glb --diffuse own --order 5 --out chair.transfer

The page of `deeplight demo` shows such files with shadow; docs/transfer.md describes them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight transfer`."""

    mesh: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MESH")]
    """bunny, sphere, pot, or a .glb, .gltf, .obj or .ply file."""
    out: Path
    """The file to write."""
    order: int = 4
    """Of the spherical harmonics, 1 to 8: (order + 1)^2 coefficients."""
    samples: int = 512
    """Rays from each vertex and ground point, for each bounce."""
    bounces: int = 2
    """Of light between the object's parts and the ground."""
    diffuse: float | Literal["own"] = 0.345
    """Reflectivity of the diffuse finish, or the mesh's own colours."""
    silver: float | None = 0.499
    """Reflectivity of the glossy finish; None leaves it out."""
    roughness: float = 0.3
    """GGX alpha of the glossy finish."""
    ground: float | None = 0.3
    """Reflectivity of the plane it stands on; None: no plane, light from below instead."""
    ground_points: int = 48
    """Points along a side of the ground's shadow."""
    longest_edge: float = 0.05
    """Longer edges are split; a share of the object's longest side."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in mesh files."""


def run(args: Args) -> None:
    """Work out one object's transfer, with a progress bar; print what was made.

    Raises:
        InputError: an option or the mesh cannot be used.
        OSError: a file cannot be read or written.
    """
    from time import perf_counter

    from rich.markup import escape

    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.screen import progress_bar, results_console
    from deeplight.compose.mesh import load
    from deeplight.errors import ConfigError
    from deeplight.transfer.file import write
    from deeplight.transfer.ground import Ground
    from deeplight.transfer.precompute import TransferSettings, precompute

    if args.silver is None:
        refuse_unused(args, "with --silver None", "roughness")
    if args.ground is None:
        refuse_unused(args, "with --ground None", "ground_points")
    settings = TransferSettings(
        order=args.order,
        samples=args.samples,
        bounces=args.bounces,
        diffuse=None if args.diffuse == "own" else args.diffuse,
        glossy=args.silver,
        roughness=args.roughness,
        ground=None if args.ground is None else Ground(args.ground_points, 1.6, args.ground),
        longest_edge=args.longest_edge,
    )
    if args.out.is_dir():
        raise ConfigError("a file to write", f"{args.out}, a folder", "name a file in it")
    meshes, begun = load(args.mesh, args.up), perf_counter()
    with progress_bar("tracing rays") as bar:
        transfer, notes = precompute(meshes, settings, bar.reach)
    write(args.out, transfer)
    console = results_console()
    took = perf_counter() - begun
    size = f"{len(transfer.vertices):,} vertices, {args.out.stat().st_size / 1000:,.0f} kB"
    console.print(escape(f"{args.mesh} -> {args.out} ({size}, {took:.0f} s)"))
    for note in notes:
        console.print(f"  [dim]{escape(note)}[/dim]")
