"""Teach a network's heads whether a photo was taken in a room.

Logistic regression with a ridge on averages of features that are trained for light: of some hundred
places no more can be learnt than what is linear.
"""

import numpy as np
import torch
from jaxtyping import Float, Shaped
from torch import Tensor, nn

from deeplight.training.network.heads import Heads

RIDGE = 0.1
"""On the squares of the weights, by standard deviations; chosen on validation places."""


def learn_indoors(
    heads: Heads,
    averaged: Float[Tensor, "n averages"],
    indoors: Float[Tensor, "n"],
    places: Shaped[np.ndarray, " n"],
) -> None:
    """Set the layer that says it; nothing else of the heads changes.

    Places count as much as each other, rooms as much as all else. Without photos of both the
    chance stays as it was.

    Args:
        heads: of the network.
        averaged: what `network.heads.averages` gives of its features.
        indoors: 1 in a room, 0 outdoors, NaN where it is not known.
        places: names of where the photos were taken.
    """
    is_known = indoors.isfinite()
    true = indoors[is_known].double()
    if not 0 < true.sum() < len(true):
        return
    features = averaged[is_known].double()
    mean, spread = features.mean(0), features.std(0) + 1e-3 * features.std()
    factor, offset = _fitted((features - mean) / spread, true, _shares(places[is_known], true))
    with torch.no_grad():  # the network gives features as they are
        heads.indoors.weight[0] = factor / spread
        heads.indoors.bias[0] = offset - (factor / spread) @ mean


def _shares(places: Shaped[np.ndarray, " n"], true: Float[Tensor, "n"]) -> Float[Tensor, "n"]:
    """How much each photo counts; they sum to 1."""
    _, place, count = np.unique(places, return_inverse=True, return_counts=True)
    share = torch.from_numpy(1 / count[place])
    return share / torch.where(true > 0, share[true > 0].sum(), share[true == 0].sum()) / 2


def _fitted(
    known: Float[Tensor, "n averages"], true: Float[Tensor, "n"], share: Float[Tensor, "n"]
) -> tuple[Float[Tensor, "averages"], Float[Tensor, ""]]:
    """Factors and offset of the most likely straight line under the ridge."""
    factor = torch.zeros(known.shape[1], dtype=torch.float64, requires_grad=True)
    offset = torch.zeros((), dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.LBFGS([factor, offset], max_iter=200, line_search_fn="strong_wolfe")
    mistake = nn.BCEWithLogitsLoss(share, reduction="sum")

    def loss() -> Tensor:
        optimiser.zero_grad()
        whole: Tensor = mistake(known @ factor + offset, true) + RIDGE * factor.square().sum()
        whole.backward()  # type: ignore[no-untyped-call]
        return whole

    optimiser.step(loss)  # type: ignore[no-untyped-call]
    return factor.detach(), offset.detach()
