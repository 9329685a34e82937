"""How long transfer takes, its memory and its file: python benchmarks/transfer_speed.py.

Each row is a process of its own. Seconds are of one core's time, which a busy machine does not
change much. Rays are given next to Embree's own speed for the same rays, so that rows can be
compared between machines.
"""

import resource
import subprocess
import sys
from time import process_time

import numpy as np

from deeplight.compose import shapes
from deeplight.compose.mesh import Mesh
from deeplight.transfer.file import encode
from deeplight.transfer.mesh import prepared
from deeplight.transfer.precompute import TransferSettings, precompute
from deeplight.transfer.rays import Blockers, frames_at, hemisphere

# Cells of the bunny, longest edge, order, samples, bounces, with gloss.
ROWS = (
    (40, 0.1, 4, 512, 2, 0),
    (40, 0.1, 4, 512, 2, 1),
    (60, 0.1, 4, 512, 2, 1),
    (60, 0.1, 6, 512, 2, 1),
    (50, 0.005, 4, 128, 1, 1),
)


def main() -> None:
    print("vertices order samples bounces gloss seconds Mrays/s of-Embree's peak-MB file-kB")
    for row in ROWS:
        words = [sys.executable, __file__, *(str(value) for value in row)]
        subprocess.run(words, check=True)


def measure(cells: int, edge: float, order: int, samples: int, bounces: int, gloss: int) -> None:
    """Print one row."""
    mesh = Mesh(*shapes.bunny(cells))
    settings = TransferSettings(
        order=order,
        samples=samples,
        bounces=bounces,
        glossy=0.499 if gloss else None,
        longest_edge=edge,
    )
    embree = bare_speed(mesh, edge, samples)
    begun = process_time()
    transfer, _ = precompute([mesh], settings)
    took = process_time() - begun
    assert settings.ground is not None
    points = len(transfer.vertices) + settings.ground.size**2
    speed = points * samples * (bounces + 1) / took / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    size = len(encode(transfer)) / 1000
    what = f"{order:5} {samples:7} {bounces:7} {'yes' if gloss else 'no':>5}"
    print(
        f"{len(transfer.vertices):8,} {what}"
        f" {took:7.1f} {speed:7.2f} {speed / embree:11.2f} {peak:7,.0f} {size:7,.0f}",
        flush=True,
    )


def bare_speed(mesh: Mesh, edge: float, samples: int) -> float:
    """Millions of such rays that Embree alone traces in a second."""
    surface, _ = prepared([mesh], edge)
    rows = np.arange(0, len(surface.vertices), max(1, len(surface.vertices) // 500))
    normals = surface.normals[rows]
    directions = np.einsum("sk,njk->nsj", hemisphere(samples).directions, frames_at(normals, rows))
    blockers = Blockers(surface)
    blockers.hit(surface.vertices[rows[:1]], normals[:1], directions[:1])  # builds its tree
    begun = process_time()
    blockers.hit(surface.vertices[rows], normals, directions)
    return directions.size / 3 / (process_time() - begun) / 1e6


if __name__ == "__main__":
    if sys.argv[1:]:
        cells, edge, *rest = sys.argv[1:]
        measure(int(cells), float(edge), *(int(value) for value in rest))
    else:
        main()
