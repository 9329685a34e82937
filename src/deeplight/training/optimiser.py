"""Adam with the paper's numbers, its schedule, and the moving average of the weights."""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor, nn

from deeplight.training.network.generator import Generator


@dataclass(frozen=True)
class OptimiserConfig:
    """Adam (Kingma and Ba 2015); the defaults are the paper's."""

    learning_rate: float = 1.5e-4
    beta1: float = 0.9
    beta2: float = 0.999
    weight_decay: float = 0.0
    """Decoupled (AdamW), on weights but not on biases and norms; 0 is Adam."""
    encoder_lr_factor: float = 1.0
    """The encoder's learning rate as a share of the rest's."""
    freeze_blocks: int = 0
    """Number of first blocks that, with the stem, keep their initial weights; 0 trains all."""
    decoder_after: int = 0
    """With `network.components`: steps in which only these are mixed and the decoder rests."""
    ema_decay: float = 0.0
    """Decay per step of the moving average of the weights, which is what is shipped; 0: none."""
    max_gradient_norm: float = 0.0
    """Gradients with a larger norm are scaled down to it; 0: never."""


@dataclass(frozen=True)
class ScheduleConfig:
    """How long training lasts and how the learning rate goes; defaults are the paper's."""

    batch_size: int = 32
    epochs: float = 16.0
    steps: int | None = None
    """Steps of training; overrides `epochs`."""
    shape: Literal["constant", "cosine"] = "constant"
    warmup_steps: int = 0
    """Steps in which the learning rate rises from 0."""
    final_factor: float = 0.01
    """Where the cosine ends, as a share of the learning rate."""

    def total_steps(self, examples: int) -> int:
        """Steps of the whole run over a training split of this number of examples."""
        if self.steps is not None:
            return self.steps
        return max(1, math.ceil(self.epochs * examples / self.batch_size))

    def factor(self, step: int, total: int) -> float:
        """Share of the learning rate at `step`."""
        if step < self.warmup_steps:
            return (step + 1) / self.warmup_steps
        if self.shape == "constant":
            return 1.0
        progress = (step - self.warmup_steps) / max(1, total - self.warmup_steps)
        cosine = 0.5 * (1.0 + math.cos(math.pi * min(1.0, progress)))
        return self.final_factor + (1.0 - self.final_factor) * cosine


def make_optimiser(generator: Generator, config: OptimiserConfig) -> torch.optim.AdamW:
    """One group of parameters for each learning rate and weight decay.

    Each group keeps its `factor`, and the step `after` which it learns, for `set_learning_rate`.
    """
    groups: dict[tuple[float, float, int], list[nn.Parameter]] = {}
    for name, parameter in generator.named_parameters():
        if parameter.requires_grad:
            factor = config.encoder_lr_factor if name.startswith("encoder.") else 1.0
            decay = config.weight_decay if parameter.ndim > 1 else 0.0
            after = config.decoder_after if name.startswith("decoder.") else 0
            groups.setdefault((factor, decay, after), []).append(parameter)
    device = next(generator.parameters()).device
    return torch.optim.AdamW(
        [
            {"params": parameters, "weight_decay": decay, "factor": factor, "after": after}
            for (factor, decay, after), parameters in groups.items()
        ],
        lr=config.learning_rate,
        betas=(config.beta1, config.beta2),
        fused=device.type in ("cpu", "cuda"),
    )


def set_learning_rate(optimiser: torch.optim.Optimizer, learning_rate: float, step: int) -> None:
    """Set every group's rate to its own share of `learning_rate`, 0 while it rests."""
    for group in optimiser.param_groups:
        group["lr"] = learning_rate * group["factor"] if step >= group["after"] else 0.0


class MovingAverage:
    """Exponential moving average of a network's parameters; buffers are copied as they are."""

    def __init__(self, network: nn.Module, decay: float) -> None:
        self.decay = decay
        self.state = {name: value.detach().clone() for name, value in network.state_dict().items()}

    @torch.no_grad()
    def update(self, network: nn.Module, step: int) -> None:
        """Move towards the network; early steps weigh more, so that the start is soon forgotten."""
        decay = min(self.decay, (1.0 + step) / (10.0 + step))
        learnt = dict(network.named_parameters())
        moving = [name for name in self.state if name in learnt and learnt[name].requires_grad]
        average: list[Tensor] = [self.state[name] for name in moving]
        torch._foreach_lerp_(average, [learnt[name].detach() for name in moving], 1.0 - decay)
        for name, buffer in network.named_buffers():
            if name in self.state:
                self.state[name].copy_(buffer)
