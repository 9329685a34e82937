"""Glossy transfer matrices in few numbers: clustered principal components.

Sloan, Hall, Hart and Snyder 2003: vertices are grouped; in each group a matrix is the group's mean
plus a few of the group's own matrices, weighted by the vertex. A light then has to meet only the
groups' matrices, not every vertex's.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

_LEARNT_FROM = 8192  # vertices at most
_ROUNDS = 6
_CHUNK = 8192


@dataclass(frozen=True, eq=False)
class Clusters:
    """Matrices of many vertices.

    Attributes:
        cluster: of each vertex.
        weights: of each vertex on its cluster's components.
        matrices: of each cluster: the mean, then the components; [leaving, arriving].
    """

    cluster: Int[np.ndarray, "vertices"]
    weights: Float32[np.ndarray, "vertices components"]
    matrices: Float32[np.ndarray, "clusters parts leaving arriving"]

    @property
    def expanded(self) -> Float32[np.ndarray, "vertices leaving arriving"]:
        """The matrix of each vertex."""
        count, parts, leaving, arriving = self.matrices.shape
        flat = self.matrices.reshape(count, parts, -1)
        result = flat[self.cluster, 0]
        for number in range(count):
            own = self.cluster == number
            result[own] += self.weights[own] @ flat[number, 1:]
        return result.reshape(-1, leaving, arriving)


def clustered(
    matrices: Float32[np.ndarray, "vertices leaving arriving"],
    normals: Float[np.ndarray, "vertices 3"],
    clusters: int,
    components: int,
) -> Clusters:
    """Group vertices, first by their normals, then by which group holds their matrix best.

    What is lost counts by how strong light of each degree usually is: about 1 / (1 + degree).
    """
    count, leaving, arriving = matrices.shape
    usual = (1 / (1 + np.floor(np.sqrt(np.arange(arriving))))).astype(np.float32)
    flat = (matrices * usual).reshape(count, -1)
    random = np.random.default_rng(0)
    some = random.permutation(count)[:_LEARNT_FROM]
    clusters = max(1, min(clusters, len(some) // (2 * components)))
    group = _by_direction(normals[some], clusters)
    parts = np.zeros((clusters, components + 1, flat.shape[1]), np.float32)
    parts[:, 1:] = random.normal(size=parts[:, 1:].shape)
    for _ in range(_ROUNDS):
        for number in range(clusters):
            members = flat[some[group == number]]
            if len(members) > components:
                parts[number] = _principal(members, parts[number, 1:])
        group = _best(flat[some], parts)
    group = np.concatenate([_best(flat[i : i + _CHUNK], parts) for i in range(0, count, _CHUNK)])
    weights = np.zeros((count, components), np.float32)
    for number in range(clusters):
        own = group == number
        weights[own] = (flat[own] - parts[number, 0]) @ parts[number, 1:].T
    parts = parts.reshape(clusters, components + 1, leaving, arriving) / usual
    return Clusters(group, weights, parts)


def _by_direction(normals: Float[np.ndarray, "n 3"], clusters: int) -> Int[np.ndarray, "n"]:
    """Groups of normals around directions that are spread over those that occur."""
    centres = normals[:1]
    while len(centres) < clusters:  # the normal farthest from all centres is the next
        centres = np.concatenate([centres, normals[(normals @ centres.T).max(1).argmin()][None]])
    return (normals @ centres.T).argmax(1)


def _principal(members: np.ndarray, start: np.ndarray) -> Float32[np.ndarray, "parts numbers"]:
    """Mean and principal components, by a few subspace iterations from `start`."""
    mean = members.mean(0)
    centred, space = members - mean, start.T
    for _ in range(6):
        space = np.linalg.qr(centred.T @ (centred @ space))[0]
    strength, turn = np.linalg.eigh((centred @ space).T @ (centred @ space))
    space = space @ turn[:, np.argsort(-strength)]
    return np.concatenate([mean[None], space.T]).astype(np.float32)


def _best(flat: np.ndarray, parts: np.ndarray) -> Int[np.ndarray, "n"]:
    """The group whose mean and components come nearest to each matrix."""
    left = np.empty((len(flat), len(parts)))
    for number, part in enumerate(parts):
        centred = flat - part[0]
        left[:, number] = (centred**2).sum(1) - ((centred @ part[1:].T) ** 2).sum(1)
    return left.argmin(1)
