"""Laws of the adversarial term: what D sees, what each player lowers, who learns."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from deeplight.errors import ConfigError
from deeplight.mappings.mirror_ball import coverage
from deeplight.sphere import PAPER_RIG, SphereView
from deeplight.training.adversary import Adversary
from deeplight.training.augment import Inputs, turn_back
from deeplight.training.config import TrainConfig
from deeplight.training.devices import fabric
from deeplight.training.losses import RigBases, pixels_of, reconstruction_terms
from deeplight.training.network.discriminator import (
    AdversarialConfig,
    Discriminator,
    clean_plate,
    discriminator_loss,
    generator_term,
    mirror_pictures,
)
from deeplight.training.share import ALONE

SIZE = 8
COVERAGE = torch.tensor(coverage(SIZE)).float()


def small_rig():
    views = {
        name: SphereView(view.ball_from_camera, view.angular_radius_rad, SIZE)
        for name, view in PAPER_RIG.views.items()
    }
    return replace(PAPER_RIG, views=views)


@pytest.fixture(scope="module")
def bases():
    rig = small_rig()
    return RigBases.from_rigs([rig, rig.mirrored()], light_size=SIZE)


@pytest.fixture
def random():
    return torch.Generator().manual_seed(1)


def inputs_of(spheres, rig=0, flipped=False):
    n = len(spheres)
    return Inputs(
        torch.zeros(n, 3, 4, 4), spheres, torch.full((n,), rig), torch.full((n,), flipped)
    )


def test_the_clean_plate_is_bilinear_between_the_corners_and_knows_nothing_else(random):
    y, x = torch.meshgrid(torch.arange(32.0), torch.arange(32.0), indexing="ij")
    ramp = 0.1 + 0.01 * x + 0.005 * y + 0.0002 * x * y
    crop = ramp.expand(2, 3, 32, 32).clone()
    torch.testing.assert_close(clean_plate(crop), crop)
    hidden = crop.clone()
    hidden[:, :, 1:-1, 1:-1] = torch.rand(2, 3, 30, 30, generator=random)
    torch.testing.assert_close(clean_plate(hidden), crop)
    hidden[:, :, 0, 0] = 1.0  # the twin: a corner does matter
    assert not torch.allclose(clean_plate(hidden), crop)


def test_what_is_predicted_as_it_was_filmed_looks_filmed(bases, random):
    """The right light gives the filmed picture; off the ball both are the plate, always."""
    q = torch.randn(2, 3, SIZE, SIZE, generator=random)
    rig = torch.zeros(2).long()
    shown = (COVERAGE.flatten() > 0).float().expand(2, 3, 1, 64)
    ball = pixels_of(bases.render(q, rig), shown)
    spheres = torch.where(COVERAGE.flatten() > 0, ball, torch.rand(2, 3, 3, 64, generator=random))
    real, fake = mirror_pictures(bases, "plain", q, inputs_of(spheres))
    torch.testing.assert_close(real, fake, atol=1e-5, rtol=0)
    plate = clean_plate(spheres[:, 0].reshape(2, 3, SIZE, SIZE))
    wrong_real, wrong = mirror_pictures(bases, "plain", q - 1.0, inputs_of(spheres))
    off, inside = COVERAGE < 0.99, COVERAGE > 0.999
    assert off.any()
    assert torch.equal(wrong[..., off], plate[..., off])
    assert torch.equal(wrong_real, real)
    assert (wrong - real)[..., inside].abs().max() > 0.1


@pytest.mark.parametrize("behind", [0.0, 1.0])
def test_at_the_rim_of_a_filmed_ball_the_background_tells_nothing(bases, random, behind):
    """A camera's crop, whose rim is part background: the right light looks filmed all the same."""
    q = 0.5 * torch.randn(2, 3, SIZE, SIZE, generator=random)
    rig = torch.zeros(2).long()
    camera = bases.render(q, rig) * COVERAGE.flatten() + behind * (1 - COVERAGE.flatten())
    filmed = pixels_of(camera, torch.ones(2, 3, 1, SIZE * SIZE))
    real, fake = mirror_pictures(bases, "plain", q, inputs_of(filmed))
    torch.testing.assert_close(real, fake, atol=1e-5, rtol=0)
    # The twin: laid over the plate by how much of a pixel is ball, the rim gives filmed away.
    plate = clean_plate(filmed[:, 0].reshape(2, 3, SIZE, SIZE))
    shown = (COVERAGE.flatten() > 0).float().expand(2, 3, 1, -1)
    rendered = pixels_of(bases.render(q, rig), shown)[:, 0].reshape(2, 3, SIZE, SIZE)
    both = [
        plate + COVERAGE * (ball - plate)
        for ball in (filmed[:, 0].reshape(2, 3, SIZE, SIZE), rendered)
    ]
    assert (both[0] - both[1]).abs().max() > 0.05


def test_a_flipped_example_shows_the_ball_of_the_mirrored_scene(bases, random):
    q = torch.randn(2, 3, SIZE, SIZE, generator=random)
    spheres = torch.rand(2, 3, 3, SIZE, SIZE, generator=random)
    flipped = torch.tensor([True, True])
    ours = mirror_pictures(
        bases, "consistent", turn_back(q, flipped), inputs_of(spheres.flatten(3), flipped=True)
    )
    direct = mirror_pictures(bases, "consistent", q, inputs_of(spheres.flip(-1).flatten(3), rig=1))
    for left, right in zip(ours, direct, strict=True):
        torch.testing.assert_close(left, right, atol=1e-4, rtol=0)
    unflipped = mirror_pictures(
        bases, "consistent", turn_back(q, flipped), inputs_of(spheres.flatten(3))
    )
    assert not torch.allclose(unflipped[1], direct[1], atol=1e-2)


def test_pictures_stay_in_float32_under_autocast(bases, random):
    q = torch.randn(2, 3, SIZE, SIZE, generator=random)
    inputs = inputs_of(torch.rand(2, 3, 3, 64, generator=random))
    exact = mirror_pictures(bases, "consistent", q, inputs)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        mixed = mirror_pictures(bases, "consistent", q, inputs)
    assert all(torch.equal(a, b) for a, b in zip(exact, mixed, strict=True))


def test_gradients_are_finite_for_black_and_for_blinding_light(bases):
    for level in (-100.0, 12.0):
        q = torch.full((1, 3, SIZE, SIZE), level, requires_grad=True)
        mirror_pictures(bases, "paper", q, inputs_of(torch.zeros(1, 3, 3, 64)))[1].sum().backward()
        assert torch.isfinite(q.grad).all()


def test_d_has_batch_norm_and_elu_after_every_layer_but_the_last():
    d = Discriminator((32, 64, 128))
    kinds = [type(m) for m in d.features]
    assert kinds == [nn.Conv2d, nn.BatchNorm2d, nn.ELU] * 3
    assert d.last.in_features == 128 * 4 * 4
    assert d(torch.rand(4, 3, 32, 32)).shape == (4,)


def test_both_players_lower_what_equation_5_says():
    real, fake = torch.tensor([2.0, -1.0]), torch.tensor([0.5, -3.0])
    d = torch.sigmoid
    adversarial = d(real).log().mean() + (1 - d(fake)).log().mean()
    torch.testing.assert_close(discriminator_loss(real, fake), -adversarial)
    torch.testing.assert_close(generator_term(fake, "minimax"), (1 - d(fake)).log().mean())
    torch.testing.assert_close(generator_term(fake, "non_saturating"), -d(fake).log().mean())
    sure = torch.tensor([-20.0], requires_grad=True)  # D is sure that it is a prediction
    slopes = {}
    for form in ("minimax", "non_saturating"):
        (slope,) = torch.autograd.grad(generator_term(sure, form), sure)
        slopes[form] = slope.item()
    assert slopes["minimax"] == pytest.approx(0.0, abs=1e-6)
    assert slopes["non_saturating"] == pytest.approx(-1.0)


def adversary(bases, **settings):
    chosen = AdversarialConfig(enabled=True, **settings)
    config = TrainConfig(adversarial=chosen)
    return Adversary(config, bases, fabric(replace(config.run, accelerator="cpu")), ALONE)


def round_of(bases, player, random, spheres=None):
    """Terms of one step, and G's output with its gradient."""
    q = torch.randn(8, 3, SIZE, SIZE, generator=random).requires_grad_()
    spheres = torch.rand(8, 3, 3, 64, generator=random) if spheres is None else spheres
    inputs = inputs_of(spheres)
    terms = reconstruction_terms(bases, TrainConfig().loss, q, inputs.spheres, inputs.rig)
    return terms, player.join(terms, q, inputs, 1.5e-4), q


def test_the_objective_is_equation_6(bases, random):
    alone, joint, _ = round_of(bases, adversary(bases), random)
    expected = 0.999 * alone.total().item() + 0.001 * joint.reported["adversarial"].item()
    assert joint.total().item() == pytest.approx(expected, rel=1e-6)
    assert joint.reported["adversarial"].item() < 0  # log(1 - D)


def test_d_learns_a_hundred_times_slower_and_stands_still_while_g_is_judged(bases, random):
    player = adversary(bases)
    before = [p.detach().clone() for p in player.discriminator.parameters()]
    _, joint, q = round_of(bases, player, random)
    moved = [
        (p - b).abs().max().item()
        for p, b in zip(player.discriminator.parameters(), before, strict=True)
    ]
    assert 0 < max(moved) <= 1.5e-6 * 1.1  # one step of Adam, and rounding
    player.fabric_optimiser.zero_grad()
    joint.weighted["adversarial"].backward()
    assert q.grad.abs().sum() > 0
    assert all(p.grad is None for p in player.discriminator.parameters())


@pytest.mark.parametrize("norm_over", ["both", "each"])
def test_d_learns_to_tell_white_balls_from_predicted_ones(bases, random, norm_over):
    player = adversary(bases, learning_rate_factor=20.0, norm_over=norm_over)
    for _ in range(40):
        _, joint, _ = round_of(bases, player, random, torch.ones(8, 3, 3, 64))
    assert joint.reported["d_real"].item() > 0.8
    assert joint.reported["d_fake"].item() > 0.8
    assert joint.reported["d_loss"].item() < 1.5 * math.log(2)  # 2 ln 2 is guessing


def test_a_weight_beyond_one_is_refused():
    with pytest.raises(ConfigError, match="lambda_rec"):
        AdversarialConfig(lambda_rec=1.5)
    assert np.isclose(AdversarialConfig().lambda_rec, 0.999)
