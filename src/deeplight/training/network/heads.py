"""What a network says besides light: of the camera, and how sure it is. Our choice.

A small branch next to the latent vector, on features that are trained for light and stay as they
are. Each number has a scale next to it, which is learnt with it.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.contract import HEADS

HIDDEN = 64
LEAST_LOG_SCALE, MOST_LOG_SCALE = -4.0, 3.0


class Heads(nn.Module):
    """Features -> the numbers of `contract.HEADS`, in their order.

    The features of each row and of each column are averaged: where something is counts, but not
    where exactly. Whether they show a room is read of these averages alone, and not known (a
    chance of a half) until it is taught.
    """

    def __init__(self, channels: int, rows: int, columns: int) -> None:
        super().__init__()
        self.inner = nn.Linear(channels * (rows + columns), HIDDEN)
        self.outer = nn.Linear(HIDDEN, len(HEADS) - 1)
        self.activation = nn.ReLU6()
        self.indoors = nn.Linear(channels * (rows + columns), 1)
        nn.init.zeros_(self.indoors.weight)
        nn.init.zeros_(self.indoors.bias)

    def forward(self, features: Float[Tensor, "n channels rows columns"]) -> Tensor:
        return self.read(averages(features))

    def read(self, averaged: Float[Tensor, "n averages"]) -> Float[Tensor, "n heads"]:
        """The numbers, from `averages`: scales above 0, and chances that sum to 1."""
        raw = self.outer(self.activation(self.inner(averaged)))
        parts = []
        for number, name in enumerate(HEADS[:-1]):
            part = raw[:, number : number + 1]
            if name.endswith("_scale"):
                part = part.clamp(LEAST_LOG_SCALE, MOST_LOG_SCALE).exp()
            parts.append(part)
        turns = [n for n, name in enumerate(HEADS) if name.startswith("upright_")]
        first, last = turns[0], turns[-1] + 1
        chances = torch.softmax(raw[:, first:last], 1)
        indoors = torch.sigmoid(self.indoors(averaged))
        return torch.cat((*parts[:first], chances, *parts[last:], indoors), 1)


def averages(features: Float[Tensor, "n channels rows columns"]) -> Float[Tensor, "n averages"]:
    """Means over the columns and over the rows."""
    return torch.cat((features.mean(3).flatten(1), features.mean(2).flatten(1)), 1)
