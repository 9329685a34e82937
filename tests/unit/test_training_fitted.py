"""Lighting fitted to 8-bit spheres, its principal components, a network that starts from them."""

import numpy as np
import pytest
import torch

from deeplight.mappings.mirror_ball import coverage
from deeplight.sphere import PAPER_RIG, Rig, SphereView
from deeplight.training.data import Batch
from deeplight.training.fitted import fit, fit_all, principal_components
from deeplight.training.losses import LossConfig, RigBases, pixels_of
from deeplight.training.network.generator import Generator, NetworkConfig, fold_batch_norm
from deeplight.training.optimiser import OptimiserConfig, make_optimiser, set_learning_rate

SIZE = 8
INSIDE = torch.tensor(coverage(SIZE) > 0.99)


@pytest.fixture(scope="module")
def bases():
    views = {
        name: SphereView(view.ball_from_camera, view.angular_radius_rad, SIZE)
        for name, view in PAPER_RIG.views.items()
    }
    return RigBases.from_rigs([Rig("small", views)], SIZE)


def filmed(bases, q):
    """What the spheres look like in the light q, as bytes."""
    rig = torch.zeros(len(q)).long()
    pixels = pixels_of(bases.render(q, rig), torch.ones(len(q), 3, 1, SIZE**2)).clamp(0, 1)
    spheres = (pixels * 255).round().byte().transpose(2, 3).unflatten(2, (SIZE, SIZE))
    return Batch(torch.zeros(len(q), 4, 4, 3, dtype=torch.uint8), spheres, rig)


def smooth_lights(n, seed=0):
    random = torch.Generator().manual_seed(seed)
    coarse = 0.5 * torch.randn(n, 3, 3, 3, generator=random) - 1.5
    return torch.nn.functional.interpolate(coarse, (SIZE, SIZE), mode="bilinear")


def test_light_is_found_again_from_its_spheres(bases):
    q = smooth_lights(3)
    found = fit(bases, filmed(bases, q), LossConfig())
    error = (found - q)[..., INSIDE].abs().mean()
    assert error < 0.15
    assert (found - q.roll(1, 0))[..., INSIDE].abs().mean() > 2 * error  # the twin: others' lights


def test_light_beyond_white_is_found_through_the_diffuse_sphere(bases):
    """Half of the ball at 3 times white: the mirror is clipped there and says only 'white'."""
    q = torch.full((1, 3, SIZE, SIZE), -2.5)
    q[:, :, : SIZE // 2] = np.log(3.0)
    found = fit(bases, filmed(bases, q), LossConfig())
    bright = found[:, :, : SIZE // 2][..., INSIDE[: SIZE // 2]].exp().mean().item()
    assert 1.8 < bright < 4.0


def test_a_killed_fit_goes_on(bases, tmp_path, monkeypatch):
    from deeplight.training import fitted

    monkeypatch.setattr(fitted, "CHUNK", 2)
    monkeypatch.setattr(fitted, "STEPS", 10)
    table = filmed(bases, smooth_lights(5))
    whole = fit_all(bases, table, LossConfig(), tmp_path / "whole")
    calls = []

    def killed(done, count):
        calls.append((done, count))
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_all(bases, table, LossConfig(), tmp_path / "killed", killed)
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "killed").iterdir()}
    assert len(before) == 2
    again = fit_all(bases, table, LossConfig(), tmp_path / "killed")
    assert torch.equal(again, whole)
    for name, written in before.items():
        assert (tmp_path / "killed" / name).stat().st_mtime_ns == written
    assert calls == [(2, 5), (4, 5)]


def test_components_span_what_they_were_made_of():
    random = torch.Generator().manual_seed(0)
    true = torch.randn(3, 3, SIZE, SIZE, generator=random)
    weights = torch.randn(40, 3, generator=random) * torch.tensor([3.0, 1.0, 0.5])
    fits = 0.7 + (weights @ true.flatten(1)).reshape(40, 3, SIZE, SIZE)
    mean, components = principal_components(fits, 3, flips=False, shuffles=False)
    left = (fits - mean).flatten(1)
    basis = components.flatten(1)
    solution = torch.linalg.lstsq(basis.T, left.T).solution
    torch.testing.assert_close(solution.T @ basis, left, atol=1e-3, rtol=0)
    torch.testing.assert_close(solution.square().mean(1), torch.ones(3), atol=1e-2, rtol=0)
    two = torch.linalg.lstsq(basis[:2].T, left.T).solution.T @ basis[:2]
    assert (two - left).abs().max() > 0.1  # the twin: two do not span three


def test_lights_of_flipped_and_recoloured_scenes_are_as_likely():
    fits = smooth_lights(20)
    mean, components = principal_components(fits, 4, flips=True, shuffles=True)
    torch.testing.assert_close(mean, mean.flip(-1))
    torch.testing.assert_close(mean, mean.roll(1, 0))
    plain_mean, _ = principal_components(fits, 4, flips=False, shuffles=False)
    assert not torch.allclose(plain_mean, mean, atol=1e-2)
    assert components.shape == (4, 3, SIZE, SIZE)


def test_more_components_than_lights_are_zero():
    _, components = principal_components(smooth_lights(3), 6, flips=False, shuffles=False)
    assert components[:2].abs().sum() > 0
    assert torch.equal(components[3:], torch.zeros(3, 3, SIZE, SIZE))


def test_a_network_starts_at_the_mean_and_first_mixes_components_only():
    config = NetworkConfig(width=0.35, latent_size=32, components=4)
    torch.manual_seed(0)
    generator = Generator(config)
    generator.mixture.components.normal_()
    photo = torch.rand(4, 3, 192, 135) - 0.5
    with torch.no_grad():
        started = generator(photo)
    torch.testing.assert_close(started, generator.mixture.mean.expand(4, -1, -1, -1))
    optimiser = make_optimiser(generator, OptimiserConfig(decoder_after=2))
    resting = {k: v.clone() for k, v in generator.decoder.named_parameters()}
    for step in range(3):
        set_learning_rate(optimiser, 1e-2, step)
        optimiser.zero_grad()
        generator(photo).square().mean().backward()
        optimiser.step()
        moved = [not torch.equal(v, resting[k]) for k, v in generator.decoder.named_parameters()]
        assert any(moved) == (step == 2)
    basis = generator.mixture.components.flatten(1)
    assert generator.mixture.mix.weight.abs().sum() > 0
    assert basis.shape == (4, 3 * 32 * 32)
    generator.eval()
    with torch.no_grad():
        before = generator(photo)
        fold_batch_norm(generator)
        torch.testing.assert_close(generator(photo), before, atol=1e-4, rtol=0)
