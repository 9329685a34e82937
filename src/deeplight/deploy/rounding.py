"""Weights on the grid of 8-bit integers, chosen so that each layer still gives what it gave.

The plain way, every weight to its nearest integer, moves ln radiance by 0.3: first layers have
filters that cancel nearly to zero. Here each rounding error is made up for by the weights of the
row that are not rounded yet, weighted by how the layer's inputs vary together (optimal brain
quantisation in the order of Frantar et al., GPTQ, ICLR 2023), inputs taken from real photos.
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

LEVELS = 127
"""Integers run from -127 to 127; a row's largest weight is one of the two."""
DAMPING = 0.01
"""Share of the mean variance added to every input's, so that no correction grows without bound."""
MOST_INPUTS = 1024
"""Layers with more inputs per row are rounded plainly: photos are too few to correct them."""
LEAST_STEP = 1e-4
"""A row's largest weight is at least this share of its bias."""
CHUNK = 16


@torch.no_grad()
def round_weights(network: nn.Module, photos: Float[Tensor, "n 3 height width"]) -> None:
    """Round the weights of every convolution and linear layer in place; biases stay exact.

    Args:
        network: without batch norm, in evaluation mode.
        photos: real ones, a hundred or so, as the network gets them.
    """
    moments = input_moments(network, photos)
    for name, layer in layers_of(network):
        give_steps(layer)
        rows = layer.weight.flatten(1)
        second, mean = moments[name]
        if rows.shape[1] > MOST_INPUTS:
            rounded = nearest(rows, scales(rows))
        elif isinstance(layer, nn.Conv2d) and layer.groups > 1:
            one = zip(rows, second, strict=True)
            rounded = torch.cat([compensated(row[None], gram) for row, gram in one])
        else:
            rounded = compensated(rows, second[0])
        if layer.bias is not None:
            lost = (rows - rounded) * (mean if len(mean) == len(rows) else mean[:1])
            layer.bias.add_(lost.sum(1))
        layer.weight.copy_(rounded.reshape(layer.weight.shape))


def give_steps(layer: nn.Conv2d | nn.Linear) -> None:
    """Give rows without weights a tiny one: their step is also their bias's, which is an integer of
    32 bits and would be cut off."""
    if layer.bias is None:
        return
    rows = layer.weight.view(len(layer.weight), -1)
    least = LEAST_STEP * layer.bias.abs()
    small = rows.abs().amax(1) < least
    rows[small, 0] = least[small]


def layers_of(network: nn.Module) -> Iterator[tuple[str, nn.Conv2d | nn.Linear]]:
    """The layers that have weights, with their names."""
    for name, module in network.named_modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            yield name, module


def input_moments(network: nn.Module, photos: Tensor) -> dict[str, tuple[Tensor, Tensor]]:
    """Of each layer's inputs: (groups, inputs, inputs) mean products and (groups, inputs) means."""
    sums: dict[str, list[Tensor]] = {}

    def note(name: str, layer: nn.Module, x: Tensor) -> None:
        columns = columns_of(layer, x)  # (groups, inputs, positions)
        count = columns.shape[2] / 1e3
        parts = [
            columns @ columns.mT / 1e3 if columns.shape[1] <= MOST_INPUTS else torch.zeros(1),
            columns.sum(2) / 1e3,
            torch.tensor(count),
        ]
        sums[name] = (
            [a + b for a, b in zip(sums[name], parts, strict=True)] if name in sums else parts
        )

    hooks = [
        layer.register_forward_pre_hook(lambda m, x, name=name: note(name, m, x[0]))
        for name, layer in layers_of(network)
    ]
    try:
        for chunk in torch.split(photos, CHUNK):
            network(chunk)
    finally:
        for hook in hooks:
            hook.remove()
    return {name: (a / count, b / count) for name, (a, b, count) in sums.items()}


def columns_of(layer: nn.Module, x: Tensor) -> Float[Tensor, "groups inputs positions"]:
    """What each row of a layer's weights is multiplied with, position by position."""
    if not isinstance(layer, nn.Conv2d):
        return x.T[None]
    if layer.kernel_size == (1, 1):
        return x.transpose(0, 1).flatten(1)[None]
    padding, stride = layer.padding, layer.stride
    assert not isinstance(padding, str)
    patches = functional.unfold(x, layer.kernel_size, 1, padding, stride)  # (n, inputs, positions)
    inputs = patches.transpose(0, 1).flatten(1)
    return inputs.reshape(layer.groups, -1, inputs.shape[1])


def compensated(
    rows: Float[Tensor, "rows inputs"], second: Float[Tensor, "inputs inputs"]
) -> Float[Tensor, "rows inputs"]:
    """Round rows column by column; the columns to come make up for the error so far."""
    damped = second.double() + torch.eye(len(second)) * (DAMPING * second.diagonal().mean() + 1e-12)
    upper = torch.linalg.cholesky(torch.linalg.inv(damped), upper=True).float()
    left, scale = rows.clone(), scales(rows)
    largest = rows.abs().argmax(1)
    for column in range(rows.shape[1]):
        value = left[:, column]
        rounded = nearest(value[:, None], scale)[:, 0]
        # The quantiser takes its step from the largest weight: that one stays what it was.
        rounded = torch.where(largest == column, rows[:, column], rounded)
        error = (value - rounded) / upper[column, column]
        left[:, column:] -= error[:, None] * upper[column, column:]
        left[:, column] = rounded
    return left


def scales(rows: Float[Tensor, "rows inputs"]) -> Float[Tensor, "rows 1"]:
    """The step between two integers, for each row."""
    return rows.abs().amax(1, keepdim=True).clamp_min(1e-12) / LEVELS


def nearest(values: Tensor, scale: Tensor) -> Tensor:
    """The nearest multiples of the steps, within the range."""
    return (values / scale).round().clamp(-LEVELS, LEVELS) * scale
