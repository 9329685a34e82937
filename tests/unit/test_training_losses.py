"""Laws of the relighting loss."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from deeplight import camera_response
from deeplight.io.basis_file import load_bases, save_bases
from deeplight.reflectance import ReflectanceBasis, analytic_basis
from deeplight.sphere import PAPER_RIG, SPHERES, SphereView
from deeplight.training.augment import turn_back
from deeplight.training.losses import (
    LossConfig,
    RigBases,
    masked_l1,
    reconstruction_terms,
    soft_clip,
    target_pixels,
)

RIG = torch.zeros(2, dtype=torch.int64)


def small_rig():
    """The paper's rig with crops of 8 pixels: fast."""
    views = {
        name: SphereView(view.ball_from_camera, view.angular_radius_rad, 8)
        for name, view in PAPER_RIG.views.items()
    }
    return replace(PAPER_RIG, views=views)


@pytest.fixture(scope="module")
def bases():
    rig = small_rig()
    return RigBases.from_rigs([rig, rig.mirrored()], light_size=8)


@pytest.fixture
def random():
    return torch.Generator().manual_seed(1)


def test_soft_clip_is_equation_3_and_does_not_overflow():
    p = torch.tensor([0.0, 0.3, 0.9, 1.0, 1.1, 2.0, 1e5])
    expected = camera_response.soft_clip(p.double().numpy())
    np.testing.assert_allclose(soft_clip(p).numpy(), expected, atol=1e-6)


@pytest.mark.parametrize(("p", "slope"), [(0.5, 1.0), (1.0, 0.5), (1.1, 0.018), (1.2, 3e-4)])
def test_soft_clip_has_the_slope_of_the_sigmoid(p, slope):
    x = torch.tensor(p, requires_grad=True)
    soft_clip(x).backward()
    assert x.grad.item() == pytest.approx(slope, rel=0.15)


def test_gradient_is_finite_for_black_and_for_blinding_light(bases):
    for level in (-100.0, -8.0, 0.0, 12.0):
        q = torch.full((2, 3, 8, 8), level, requires_grad=True)
        terms = reconstruction_terms(bases, LossConfig(), q, torch.zeros(2, 3, 3, 64), RIG)
        terms.total().backward()
        assert torch.isfinite(q.grad).all()


def test_a_clipped_mirror_teaches_nothing_but_a_grey_diffuse_sphere_does(bases):
    """Recovering the sun is left to the other spheres."""
    slopes = {}
    for name in ("mirror", "diffuse"):
        only = {sphere: float(sphere == name) for sphere in SPHERES}
        q = torch.full((2, 3, 8, 8), math.log(2.0), requires_grad=True)
        white = torch.ones(2, 3, 3, 64)
        reconstruction_terms(bases, LossConfig(**only), q, white, RIG).total().backward()
        slopes[name] = q.grad.abs().max().item()
    assert slopes["mirror"] < 1e-6 < 1e-4 < slopes["diffuse"]


def best_radiance_for_white(form):
    p = torch.linspace(0.9, 1.5, 6001)
    rendered = p[:, None, None, None].expand(-1, 1, 3, 1)
    losses = masked_l1(rendered, torch.ones(6001, 1, 3, 1), torch.ones(6001, 1, 1, 1), form)
    return p[losses.argmin()].item()


def test_what_a_saturated_pixel_is_taken_for():
    """Read to the letter, equation 4 says 0.9685."""
    assert best_radiance_for_white("paper") == pytest.approx(0.9685, abs=1e-3)
    assert best_radiance_for_white("consistent") == pytest.approx(1.0, abs=2e-3)
    assert best_radiance_for_white("plain") > 1.2


@pytest.mark.parametrize("form", ["paper", "consistent", "plain"])
def test_forms_agree_on_dark_pixels(form):
    dark = torch.linspace(0.05, 0.7, 20)
    torch.testing.assert_close(target_pixels(dark, form), dark, atol=2e-4, rtol=0)


def test_sum_is_mean_times_what_is_counted(bases, random):
    rendered = torch.rand(2, 3, 3, 64, generator=random)
    pixels = torch.rand(2, 3, 3, 64, generator=random)
    mask = bases.masks(RIG)
    mean = masked_l1(rendered, pixels, mask)
    total = masked_l1(rendered, pixels, mask, reduction="sum")
    torch.testing.assert_close(total, mean * 3 * mask.sum((2, 3)))


def test_pixels_outside_the_mask_do_not_matter(bases, random):
    rendered = torch.rand(2, 3, 3, 64, generator=random)
    pixels = torch.rand(2, 3, 3, 64, generator=random)
    mask = bases.masks(RIG)
    off = (mask == 0).expand_as(pixels)
    before = masked_l1(rendered, pixels, mask)
    assert off.any()
    torch.testing.assert_close(masked_l1(rendered, pixels.masked_fill(off, 0.7), mask), before)
    inside = pixels.masked_fill(~off, 0.7)  # the twin that must change
    assert not torch.allclose(masked_l1(rendered, inside, mask), before)


def test_each_example_is_rendered_with_its_own_rig(bases, random):
    q = torch.randn(5, 3, 8, 8, generator=random)
    rig = torch.tensor([0, 1, 1, 0, 1])
    together = bases.render(q, rig)
    for i in range(5):
        alone = bases.render(q[i : i + 1], rig[i : i + 1])
        torch.testing.assert_close(together[i : i + 1], alone)
    assert not torch.allclose(bases.render(q, 1 - rig), together)


def test_turning_the_light_back_is_the_mirrored_rig(bases, random):
    """The loss of a flipped example = that of the flipped spheres in the mirrored rig."""
    q = torch.randn(2, 3, 8, 8, generator=random)
    spheres = torch.rand(2, 3, 3, 8, 8, generator=random)
    flipped = torch.tensor([True, True])
    config = LossConfig()
    ours = reconstruction_terms(bases, config, turn_back(q, flipped), spheres.flatten(3), RIG)
    mirrored_rig = RIG + 1
    direct = reconstruction_terms(bases, config, q, spheres.flip(-1).flatten(3), mirrored_rig)
    assert ours.total().item() == pytest.approx(direct.total().item(), rel=1e-4)
    wrong = reconstruction_terms(bases, config, q, spheres.flip(-1).flatten(3), RIG)
    assert ours.total().item() != pytest.approx(wrong.total().item(), rel=1e-4)


def test_the_loss_stays_in_float32_under_autocast(bases, random):
    q = torch.randn(2, 3, 8, 8, generator=random)
    spheres = torch.rand(2, 3, 3, 64, generator=random)
    exact = reconstruction_terms(bases, LossConfig(), q, spheres, RIG).total()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        mixed = reconstruction_terms(bases, LossConfig(), q, spheres, RIG).total()
    assert mixed.dtype == torch.float32
    assert mixed.item() == exact.item()


def test_total_is_the_weighted_sum(bases, random):
    q = torch.randn(2, 3, 8, 8, generator=random)
    spheres = torch.rand(2, 3, 3, 64, generator=random)
    terms = reconstruction_terms(bases, LossConfig(), q, spheres, RIG)
    expected = sum(
        {"mirror": 0.2, "diffuse": 0.6, "matte_silver": 0.2}[name] * value
        for name, value in terms.reported.items()
    )
    assert terms.total().item() == pytest.approx(float(expected), rel=1e-6)


def test_photographed_bases_are_turned_to_every_rig(tmp_path):
    """A darker diffuse sphere in the file renders darker; the mirror is made, whatever is filed."""
    rig = small_rig()
    straight = SphereView(size=8)
    diffuse = analytic_basis("diffuse", straight, 8)
    darker = ReflectanceBasis(diffuse.weights * 0.5, straight, 8)
    black = ReflectanceBasis(diffuse.weights * 0.0, straight, 8)
    save_bases(tmp_path / "bases.npz", {"diffuse": darker, "mirror": black}, {})
    rigs = [rig, rig.mirrored()]
    made = RigBases.from_rigs(rigs, 8)
    ours = RigBases.of([load_bases(tmp_path / "bases.npz", rig, 8) for rig in rigs])
    white = torch.zeros(2, 3, 8, 8)
    each = torch.tensor([0, 1])
    inside = made.masks(each)[:, 2, 0] > 0
    ratio = (ours.render(white, each) / made.render(white, each))[:, 2].mean(1)[inside]
    torch.testing.assert_close(ratio, torch.full_like(ratio, 0.5), atol=0.02, rtol=0)
    torch.testing.assert_close(ours.basis[:, :2], made.basis[:, :2])
    assert not torch.allclose(ours.basis[0, 2], ours.basis[1, 2], atol=1e-4)  # each rig its own
