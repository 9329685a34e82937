"""The loss that a photo and its mirror image should give mirrored light."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.frames import world_from_camera
from deeplight.harmonics import dominant_light
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.lobe import lobe_on_ball
from deeplight.training.agreement import (
    FLIP,
    STEADY,
    join_agreement,
    join_steadiness,
    main_direction,
)
from deeplight.training.augment import Inputs, both_ways, turn_back
from deeplight.training.losses import LossTerms

torch = pytest.importorskip("torch")

NOTHING = LossTerms({"reconstruction": torch.zeros(())}, {})


def lit_from(x: float) -> torch.Tensor:
    """ln radiance of a dim room with one lamp to the right or left, (3, 32, 32)."""
    direction = np.array([x, 0.5, 0.6]) / np.linalg.norm([x, 0.5, 0.6])
    radiance = 0.1 + lobe_on_ball(Lamp(direction, np.full(3, 0.8), 0.3))
    return torch.from_numpy(np.log(radiance)).permute(2, 0, 1).float()


def difference(a: torch.Tensor, b: torch.Tensor) -> float:
    terms = join_agreement(NOTHING, torch.stack((a, b)), weight=1.0)
    return float(terms.weighted[FLIP])


def test_it_is_zero_for_the_same_light_and_grows_with_the_angle() -> None:
    assert difference(lit_from(0.5), lit_from(0.5)) == pytest.approx(0, abs=1e-6)
    near, far = (difference(lit_from(0.5), lit_from(x)) for x in (0.3, -0.5))
    assert 0.05 < near < far


def test_brightness_alone_counts_as_much_as_it_differs() -> None:
    assert difference(lit_from(0.5), lit_from(0.5) + 0.3) == pytest.approx(0.3, abs=1e-4)


def test_its_main_light_is_the_dominant_one() -> None:
    light = lit_from(0.7)
    found = main_direction(light[None])[0].numpy()
    expected = dominant_light(Lighting(light.exp().permute(1, 2, 0).numpy())).direction
    assert found @ expected > np.cos(np.radians(12))
    assert main_direction(light.flip(-1)[None])[0].numpy() @ expected < 0.7  # the twin


TURN = world_from_camera(0.3, -0.2, 0.1)
"""Directions of the second frame's camera from the first one's."""


def lit_towards(direction: np.ndarray) -> torch.Tensor:
    radiance = 0.1 + lobe_on_ball(Lamp(direction, np.full(3, 0.8), 0.3))
    return torch.from_numpy(np.log(radiance)).permute(2, 0, 1).float()


@pytest.mark.parametrize(("turn", "still"), [(TURN, True), (TURN.T, False), (np.eye(3), False)])
def test_a_main_light_that_stands_still_while_the_camera_turns_costs_nothing(
    turn: np.ndarray, still: bool
) -> None:
    before = np.array([0.48, 0.6, 0.64])
    one, other = lit_towards(before), lit_towards(turn @ before)
    # Two pairs, all first frames first; the same again, as photos seen both ways are.
    lights = torch.stack((one, one, other, other) * 2)
    turns = torch.tensor(np.stack((TURN, TURN)), dtype=torch.float32)
    terms = join_steadiness(NOTHING, lights, turns, weight=2.0)
    jump = float(terms.reported[STEADY])
    assert (jump < 0.01) == still
    assert float(terms.weighted[STEADY]) == pytest.approx(2 * jump)


def test_photos_both_ways_have_the_same_spheres() -> None:
    photo, spheres = torch.rand(2, 3, 4, 5), torch.rand(2, 3, 3, 9)
    flipped = torch.tensor([True, False])
    both = both_ways(Inputs(photo, spheres, torch.zeros(2, dtype=torch.long), flipped))
    assert torch.equal(both.photo[2:], photo.flip(-1))
    assert torch.equal(both.spheres[:2], both.spheres[2:])
    assert torch.equal(both.flipped[2:], ~flipped)
    light = torch.rand(2, 3, 4, 4)  # of the scene as filmed: both halves turn back to it
    seen = torch.cat((turn_back(light, flipped), turn_back(light, ~flipped)))
    again = turn_back(seen, both.flipped)
    assert torch.equal(again[:2], again[2:])
    assert not torch.equal(turn_back(seen, replace(both, flipped=~both.flipped).flipped), again)
