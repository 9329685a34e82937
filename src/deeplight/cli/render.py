"""Work out how an object takes up light, so that any light can shade it in real time.

deeplight render transfer bunny --out bunny.transfer
deeplight render transfer chair.glb --diffuse own --order 5 --out chair.transfer

The page of `deeplight demo` shows such files with shadow; docs/transfer.md describes them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight render`."""

    what: Annotated[Literal["transfer"], tyro.conf.Positional]
    """Precomputed radiance transfer, the only thing so far."""
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
    from deeplight.cli.render_transfer import run_transfer

    run_transfer(args)
