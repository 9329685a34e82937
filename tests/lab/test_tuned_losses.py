"""What the losses of the tuning experiment ask for: a light that turns with the camera."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from deeplight.frames import turned, world_from_camera
from deeplight.lamp import Lamp
from deeplight.lobe import lobe_on_ball
from lab.evidence.tuned_terms import direction_loss, mode_loss, steadiness_loss, turned_ball

TOWARDS = np.array([0.48, 0.6, 0.64])
POSES = np.stack([world_from_camera(0.2, -0.3, 0.1), world_from_camera(-0.3, -0.1, 0.0)])
TURN = POSES[1].T @ POSES[0]


def lit_from(direction: np.ndarray, gain: float = 0.0) -> Tensor:
    """ln radiance (1, 3, 32, 32) of a dim room with a lamp there."""
    lamp = Lamp(direction.astype(np.float32), np.full(3, 2.0, np.float32), 0.45)
    radiance = torch.from_numpy(lobe_on_ball(lamp) + np.float32(0.1))
    return radiance.log().permute(2, 0, 1)[None] + gain


def tensor(array: np.ndarray) -> Tensor:
    return torch.tensor(array, dtype=torch.float32)[None]


@pytest.mark.parametrize(("turn", "same"), [(TURN, True), (TURN.T, False)])
def test_a_turned_ball_has_its_lamp_where_the_turn_brings_it(turn: np.ndarray, same: bool) -> None:
    moved = turned_ball(lit_from(TOWARDS), tensor(turn)).exp()
    wanted = lit_from(turned(TOWARDS[None], TURN)[0]).exp()
    assert bool((moved - wanted).abs().max() < 0.1 * wanted.max()) == same


@pytest.mark.parametrize(
    ("place", "gain", "steady"),
    [(turned(TOWARDS[None], TURN)[0], 0.7, True), (TOWARDS, 0.7, False),
     (turned(TOWARDS[None], TURN)[0], 0.0, False)],
)  # fmt: skip
def test_light_is_steady_that_turns_and_brightens_with_the_camera(
    place: np.ndarray, gain: float, steady: bool
) -> None:
    lights = torch.cat((lit_from(TOWARDS), lit_from(place, gain)))
    log_gain = tensor(np.array([[0.1] * 3, [0.8] * 3]))
    assert bool(steadiness_loss(lights, tensor(POSES), log_gain) < 0.05) == steady


@pytest.mark.parametrize("loss", [direction_loss, mode_loss])
def test_a_direction_is_better_the_nearer_it_is_and_an_unknown_one_does_not_count(
    loss: Callable[[Tensor, Tensor], Tensor],
) -> None:
    near, far = lit_from(TOWARDS), lit_from(-TOWARDS)
    true = tensor(TOWARDS)
    unknown = torch.full_like(true, torch.nan)
    assert loss(near, true) < loss(far, true) - 0.5
    both = loss(torch.cat((near, far)), torch.cat((true, unknown)))
    torch.testing.assert_close(both, loss(near, true), rtol=0, atol=1e-6)
    other = loss(torch.cat((near, near)), torch.cat((true, unknown)))
    assert torch.equal(both, other)  # whatever light the photo of unknown direction has
