"""How a camera zoomed while it turned: from pairs of pictures, each placed with its own zoom."""

from collections.abc import Iterable, Mapping, Sequence
from math import radians

import numpy as np

from deeplight.frames import crosses, dot, exponential
from deeplight.fuse.adjust import Pair, rays_of

_SOFT_RAD = radians(0.3)
_ROUNDS, _NUDGE = 4, 1e-4
_STEP, _RANGE = 0.08, 0.2
"""ln of the zoom between neighbours, and of the whole. 30 cm nearer to a wall 3 m away are 0.1, and
in made-up rooms at most 0.05 and 0.18."""


def log_zooms(pairs: Sequence[Pair], pictures: Iterable[int]) -> dict[int, float]:
    """ln of how much more each picture is magnified than the first one.

    Args:
        pairs: of which only those between `pictures` count.
        pictures: their places in the sequence; pairs must connect them all.
    """
    order = {number: place for place, number in enumerate(sorted(pictures))}
    used = [p for p in pairs if p.first in order and p.second in order]
    matrix, right = np.zeros((len(used) + 1, len(order))), np.zeros(len(used) + 1)
    matrix[-1, :1] = 1
    for k, pair in enumerate(used):
        counts = np.sqrt(len(pair.one))
        matrix[k, order[pair.first]], matrix[k, order[pair.second]] = -counts, counts
        right[k] = counts * _between(pair)
    logs = np.linalg.lstsq(matrix, right, rcond=None)[0]
    return dict(zip(order, (logs - logs[:1]).tolist(), strict=True))


def is_zoom(logs: Mapping[int, float]) -> bool:
    """Whether these say that the camera zoomed: of less, a step forward is the likelier cause."""
    values = np.array([logs[number] for number in sorted(logs)])
    if len(values) < 2:
        return False
    return bool(np.ptp(values) > _RANGE or np.abs(np.diff(values)).max() > _STEP)


def _between(pair: Pair) -> float:
    """ln of how much more the second picture is magnified, solved for with the rotation."""
    turn, log = pair.first_from_second, 0.0
    one = rays_of(pair.one)
    for _ in range(_ROUNDS):
        other, grown = (rays_of(pair.other, log + more) @ turn.T for more in (0.0, _NUDGE))
        miss = one - other
        weight = 1 / (1 + dot(miss, miss) / _SOFT_RAD**2)
        slopes = np.concatenate([-crosses(other), (grown - other)[..., None] / _NUDGE], axis=-1)
        matrix = np.einsum("nij,nik,n->jk", slopes, slopes, weight) + 1e-9 * np.eye(4)
        step = np.linalg.solve(matrix, np.einsum("nij,ni,n->j", slopes, miss, weight))
        turn, log = exponential(step[:3]) @ turn, log + float(step[3])
    return -log  # what is magnified lies too far out on its plane
