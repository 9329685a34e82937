"""Transfer at every vertex and ground point: what leaves it in light of each harmonic.

Sloan, Kautz and Snyder 2002: light that reaches a point = light from everywhere, less what the
object and the ground block, plus what those send there. Nothing but the second and third part is
sampled, since the first is known: a convex object has no noise. Bounces repeat the sum with what
the surfaces sent out in the round before.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float, Float32, Int

from deeplight import harmonics
from deeplight.transfer import finish as transfer_finish
from deeplight.transfer.finish import FinishCoefficients
from deeplight.transfer.ground import Ground, open_plane
from deeplight.transfer.mesh import TransferSurface
from deeplight.transfer.rays import Blockers, frames_at, hemisphere

_RAYS = 65_536  # at a time: with 25 coefficients, 7 MB of each array
_UP = np.array([[0.0, 1.0, 0.0]])
Progress = Callable[[int, int], None]
Transfers = Float32[np.ndarray, "points leaving coefficients"]


@dataclass(frozen=True)
class Work:
    """What to find out, and how well.

    Attributes:
        order: of the harmonics.
        samples: directions over each point.
        bounces: of light between surfaces; 0 is direct light and what blocks it.
        diffuse: reflectivity of the object with the diffuse finish, or of each of its vertices.
        glossy: reflectivity with the glossy finish; None leaves that finish out.
        roughness: GGX alpha of the glossy finish.
    """

    order: int
    samples: int
    bounces: int
    diffuse: float | Float[np.ndarray, "vertices"]
    glossy: float | None
    roughness: float


@dataclass(frozen=True, eq=False)
class Solution:
    """Transfer per unit of the reflectivity of the point itself.

    Attributes:
        diffuse, glossy: of the vertices; glossy only if asked for.
        ground: of the grid's points, under the diffuse object; the last row is the open plane.
    """

    diffuse: Float32[np.ndarray, "vertices 1 coefficients"]
    glossy: Float32[np.ndarray, "vertices coefficients coefficients"] | None
    ground: Float32[np.ndarray, "points 1 coefficients"]


def solve(
    surface: TransferSurface,
    ground: Ground | None,
    work: Work,
    progress: Progress = lambda done, total: None,
) -> Solution:
    """Trace all rays once for the direct light and once for each bounce."""
    solver = _Solver(surface, ground, work)
    points = len(surface.vertices) + (ground.size**2 if ground else 0)
    solution, total = solver.dark(), points * (work.bounces + 1)

    def report(begun: int, done: int) -> None:
        progress(begun + done, total)

    for begun in range(0, total, points):
        solution = solver.round(solution, partial(report, begun))
    return solution


class _Solver:
    def __init__(self, surface: TransferSurface, ground: Ground | None, work: Work) -> None:
        self._surface, self._ground, self._work = surface, ground, work
        self._coefficients = (work.order + 1) ** 2
        self._blockers = Blockers(surface)
        self._over = hemisphere(work.samples)
        self._diffuse = transfer_finish.diffuse(work.samples, work.order)
        self._glossy = None
        if work.glossy is not None:
            self._glossy = transfer_finish.glossy(work.samples, work.order, work.roughness)
        albedo = np.asarray(work.diffuse, np.float32)
        self._albedo = np.broadcast_to(albedo, (len(surface.vertices),))

    def dark(self) -> Solution:
        """Before the first round nothing sends anything."""
        n, count = len(self._surface.vertices), self._coefficients
        glossy = np.zeros((n, count, count), np.float32) if self._glossy else None
        points = self._ground.size**2 if self._ground else 0
        ground = np.zeros((points + 1, 1, count), np.float32)
        return Solution(np.zeros((n, 1, count), np.float32), glossy, ground)

    def round(self, old: Solution, progress: Callable[[int], None]) -> Solution:
        """What leaves every point in the light and what all others sent out before."""
        new, count = self.dark(), len(self._surface.vertices)
        for rows in self._chunks(count):
            self._at_vertices(rows, old, new)
            progress(int(rows[-1]) + 1)
        if self._ground is not None:
            points = self._ground.points
            for rows in self._chunks(len(points)):
                new.ground[rows] = self._at_ground(points[rows], rows, old)
                progress(count + int(rows[-1]) + 1)
        new.ground[-1, 0] = open_plane(self._work.order)
        return new

    def _chunks(self, count: int) -> Iterator[Int[np.ndarray, "rows"]]:
        step = max(1, _RAYS // self._work.samples)
        for first in range(0, count, step):
            yield np.arange(first, min(first + step, count))

    def _at_vertices(self, rows: np.ndarray, old: Solution, new: Solution) -> None:
        points, normals = self._surface.vertices[rows], self._surface.normals[rows]
        frames = frames_at(normals, rows)
        directions = np.einsum("sk,njk->nsj", self._over.directions, frames)
        hit = self._blockers.hit(points, normals, directions)
        below = self._below(points, directions, hit)
        taken = np.nonzero((hit >= 0) | (below >= 0))
        toward, vertex = directions[taken], hit[taken]
        blocked, of_object = harmonics.basis(toward, self._work.order), vertex >= 0
        change = -blocked
        if self._ground is not None:
            place = below[taken][~of_object]
            change[~of_object] += self._ground.reflectivity * old.ground[place, 0]
        for finish, before, after in (
            (self._diffuse, old.diffuse, new.diffuse),
            (self._glossy, old.glossy, new.glossy),
        ):
            if finish is None or before is None or after is None:
                continue
            added = self._sent(finish, before, vertex[of_object], toward[of_object])
            changed = change.copy()
            changed[of_object] += added
            after[rows] = self._leaving(finish, frames, changed, taken)

    def _at_ground(self, points: np.ndarray, rows: np.ndarray, old: Solution) -> Transfers:
        normals = np.repeat(_UP, len(rows), axis=0)
        frames = frames_at(normals, rows)
        directions = np.einsum("sk,njk->nsj", self._over.directions, frames)
        hit = self._blockers.hit(points, normals, directions)
        taken = np.nonzero(hit >= 0)
        change = self._sent(self._diffuse, old.diffuse, hit[taken], directions[taken])
        change = change - harmonics.basis(directions[taken], self._work.order)
        return self._leaving(self._diffuse, frames, change, taken)

    def _below(
        self, points: np.ndarray, directions: np.ndarray, hit: Int[np.ndarray, "n s"]
    ) -> Int[np.ndarray, "n s"]:
        """The ground point that each ray falls on; -1 where it meets the object or goes up."""
        result = np.full(hit.shape, -1)
        if self._ground is None:
            return result
        falling = (directions[..., 1] < 0) & (hit < 0)
        down = directions[falling]
        start = np.broadcast_to(points[:, None], directions.shape)[falling]
        steps = np.maximum(start[:, 1:2], 0) / np.minimum(down[:, 1:2], -1e-6)
        result[falling] = self._ground.nearest(start - down * steps)
        return result

    def _sent(
        self, finish: FinishCoefficients, before: np.ndarray, at: np.ndarray, toward: np.ndarray
    ) -> Float32[np.ndarray, "hits coefficients"]:
        """Radiance from vertices against the direction in which they were seen."""
        if finish is self._diffuse:
            diffuse: np.ndarray = self._albedo[at, None] * before[at, 0]
            return diffuse
        normals = self._surface.normals[at].astype(np.float32)
        mirrored = toward - 2 * (toward * normals).sum(-1, keepdims=True) * normals
        lobes = harmonics.basis(mirrored, self._work.order)
        result = np.empty((len(at), self._coefficients), np.float32)
        for first in range(0, len(at), 16_384):  # a matrix for each hit
            part = slice(first, first + 16_384)
            result[part] = np.matmul(lobes[part, None], before[at[part]])[:, 0]
        return result * np.float32(self._work.glossy or 0)

    def _leaving(
        self,
        finish: FinishCoefficients,
        frames: np.ndarray,
        change: np.ndarray,
        taken: tuple[np.ndarray, ...],
    ) -> Transfers:
        """Bare transfer turned to each point's frame, plus what the changed rays add."""
        turns = _turnings(frames, self._work.order)
        weights = finish.weights
        dense = np.zeros((len(frames), weights.shape[1], self._coefficients), np.float32)
        dense[taken] = change
        result = np.einsum("oi,nji->noj", finish.bare.astype(np.float32), turns)
        result += np.matmul(weights, dense)
        if len(weights) == 1:
            return result
        return np.matmul(turns, result)


def _turnings(frames: np.ndarray, order: int) -> Float32[np.ndarray, "n world surface"]:
    """`harmonics.turning` of many frames at once: world from surface."""
    directions, weights = harmonics.quadrature(order)
    turned = np.einsum("qk,njk->nqj", directions.astype(np.float32), frames)
    old = (weights[:, None] * harmonics.basis(directions, order)).astype(np.float32)
    return np.matmul(harmonics.basis(turned, order).swapaxes(1, 2), old)
