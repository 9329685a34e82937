"""Masked L1 of each sphere on the validation splits, next to the best constant lighting."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.utils.data import Subset

from deeplight.sphere import SPHERES
from deeplight.training.augment import Inputs, prepare
from deeplight.training.data import Batch, ExampleBytes, preload, take, to_device
from deeplight.training.losses import RigBases, masked_l1

BATCH_SIZE = 64

Predict = Callable[[Inputs], Tensor]


@dataclass(frozen=True)
class SphereErrors:
    """Mean masked L1 of each sphere over one split, against the pixels as they are."""

    split: str
    model: Mapping[str, float]
    constant: Mapping[str, float] | None
    """The same for the constant lighting; None before it is fitted or without it."""

    def ratio(self, sphere: str) -> float | None:
        """The model's error as a share of the constant lighting's."""
        return None if self.constant is None else self.model[sphere] / self.constant[sphere]


class Validation:
    """Fixed examples of the validation splits, and their errors for the constant lighting."""

    def __init__(self, tables: Mapping[str, Batch], bases: RigBases, device: torch.device) -> None:
        self.tables, self.bases, self.device = dict(tables), bases, device
        self.constant: dict[str, dict[str, float]] = {}

    def set_constant(self, log_radiance: Float[Tensor, "3 size size"]) -> None:
        """Measure the constant lighting on every split."""
        q = log_radiance.to(self.device)
        self.constant = {
            split: self.errors(table, lambda inputs: q.expand(len(inputs.photo), -1, -1, -1))
            for split, table in self.tables.items()
        }

    def measure(self, generator: nn.Module) -> list[SphereErrors]:
        """Errors of a generator on every split; the generator is in evaluation mode meanwhile."""
        was_training = generator.training
        generator.eval()
        errors = [
            SphereErrors(
                split,
                self.errors(table, lambda inputs: generator(inputs.photo)),
                self.constant.get(split),
            )
            for split, table in self.tables.items()
        ]
        generator.train(was_training)
        return errors

    @torch.no_grad()
    def errors(self, table: Batch, predict: Predict) -> dict[str, float]:
        """Mean masked L1 per sphere of what `predict` says of each batch."""
        per_sphere = []
        for rows in np.array_split(np.arange(len(table.photo)), -(-len(table.photo) // BATCH_SIZE)):
            inputs = prepare(*to_device(take(table, rows), self.device))
            rendered = self.bases.render(predict(inputs), inputs.rig)
            mask = self.bases.masks(inputs.rig)
            per_sphere.append(masked_l1(rendered, inputs.spheres, mask, "plain"))
        means = torch.cat(per_sphere).mean(0).tolist()
        return dict(zip(SPHERES, means, strict=True))


def some_of(examples: ExampleBytes, most: int, workers: int) -> Batch:
    """At most this number of examples, evenly spread over the split, decoded."""
    count = min(most, len(examples))
    indices = np.linspace(0, len(examples) - 1, count).round().astype(int)
    return preload(Subset(examples, indices.tolist()), workers)


def score(errors: Sequence[SphereErrors], weights: Mapping[str, float]) -> float:
    """The one number runs are compared by: the weighted L1, mean over the splits."""
    return float(np.mean([sum(weights[name] * e.model[name] for name in SPHERES) for e in errors]))
