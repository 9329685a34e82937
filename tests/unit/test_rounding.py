"""Weights on a grid of integers: on the grid, and nearer to the layer's old output than nearest."""

import torch
from torch import nn

from deeplight.deploy.rounding import LEVELS, nearest, round_weights, scales


def network():
    torch.manual_seed(0)
    return nn.Sequential(
        nn.Conv2d(3, 8, 3, 2, 1),
        nn.ReLU6(),
        nn.Conv2d(8, 8, 3, 1, 1, groups=8),
        nn.ReLU6(),
        nn.Conv2d(8, 6, 1),
        nn.Flatten(),
        nn.Linear(6 * 24 * 17, 5),
    ).eval()


def smooth_photos(count=16):
    coarse = torch.rand(count, 3, 4, 3)
    return nn.functional.interpolate(coarse, (48, 34), mode="bicubic") - 0.5


def test_every_weight_is_an_integer_times_its_rows_step():
    rounded = network()
    round_weights(rounded, smooth_photos())
    for layer in (rounded[0], rounded[2], rounded[4], rounded[6]):
        rows = layer.weight.detach().flatten(1)
        integers = rows / scales(rows)
        assert (integers - integers.round()).abs().max() < 1e-3
        assert integers.abs().max() < LEVELS + 0.5


def test_a_row_keeps_its_largest_weight():
    exact, rounded = network(), network()
    round_weights(rounded, smooth_photos())
    for old, new in zip(exact.parameters(), rounded.parameters(), strict=True):
        if old.ndim == 4:
            torch.testing.assert_close(old.flatten(1).abs().amax(1), new.flatten(1).abs().amax(1))


@torch.no_grad()
def test_it_is_nearer_than_rounding_each_weight_alone():
    exact, rounded, plain = network(), network(), network()
    for each in (exact, rounded, plain):  # filters that cancel: what plain rounding gets wrong
        each[2].weight.sub_(each[2].weight.mean((2, 3), keepdim=True)).mul_(20)
    round_weights(rounded, smooth_photos())
    for layer in (plain[0], plain[2], plain[4], plain[6]):
        rows = layer.weight.flatten(1)
        layer.weight.copy_(nearest(rows, scales(rows)).reshape(layer.weight.shape))
    photos = smooth_photos()  # others than those it was fitted on
    error = [(each(photos) - exact(photos)).abs().mean() for each in (rounded, plain)]
    assert error[0] < 0.6 * error[1]


def test_a_row_without_weights_gets_a_step_its_bias_can_be_written_in():
    layer = nn.Conv2d(3, 4, 1)
    nn.init.zeros_(layer.weight)
    nn.init.constant_(layer.bias, 2.0)
    round_weights(layer, smooth_photos())
    step = scales(layer.weight.detach().flatten(1))
    assert (2.0 / step).max() < 2**31 / 255
    assert layer.weight.abs().max() < 1e-3
