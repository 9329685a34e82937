"""The network with lamps: nothing of them is lost, and light follows the photo's exposure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from deeplight.estimators.network import lamps_of
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.lobe import lobe_on_ball
from deeplight.mappings import mirror_ball
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import (
    Generator,
    NetworkConfig,
    chroma,
)
from deeplight.training.slim import start_from
from networks import EVERYTHING, EVERYTHING_CONTRACT, SMALL, random_network


def network(config: NetworkConfig = SMALL, seed: int = 0) -> Generator:
    return random_network(config, seed)


def photos(count: int = 2, seed: int = 1) -> torch.Tensor:
    coarse = torch.rand(count, 3, 6, 5, generator=torch.Generator().manual_seed(seed))
    photo = torch.nn.functional.interpolate(coarse, (192, 135), mode="bilinear")
    return photo * torch.tensor([0.9, 0.6, 0.3]).reshape(3, 1, 1) - 0.5


def power(radiance: torch.Tensor) -> torch.Tensor:
    solid_angle = torch.tensor(mirror_ball.solid_angles(32), dtype=torch.float32)
    return torch.einsum("ij,ncij->nc", solid_angle, radiance)


@torch.no_grad()
def test_the_light_is_the_map_and_the_lamps() -> None:
    one = network()
    log_radiance, lamps = one.light(photos())
    assert lamps is not None
    flux = lamps[..., 3:6].exp().sum(1)
    without = network()
    without.lamps = None
    dim, none = without.light(photos())
    assert none is None
    expected = power(dim.exp()) + flux
    torch.testing.assert_close(power(log_radiance.exp()), expected, rtol=1e-4, atol=0)
    assert (flux > 0.05 * expected).all()  # the twin: it would not hold without the lamps


@torch.no_grad()
def test_numpy_draws_what_torch_draws() -> None:
    one = network()
    log_radiance, lamps = one.light(photos())
    assert lamps is not None
    one.lamps = None
    dim = one(photos()).exp().permute(0, 2, 3, 1).numpy()
    for number in range(2):
        drawn = sum(lobe_on_ball(lamp) for lamp in lamps_of(lamps[number].numpy()))
        expected = log_radiance[number].exp().permute(1, 2, 0).numpy()
        on = mirror_ball.coverage(32) > 0
        np.testing.assert_allclose((dim[number] + drawn)[on], expected[on], rtol=2e-4)


@torch.no_grad()
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_light_follows_the_photos_exposure(share: float) -> None:
    one = network(replace(SMALL, brightness=share))
    darker = (photos() + 0.5) * 0.5 ** (1 / 2.2) - 0.5  # one stop
    change = (one(darker) - one(photos())) / np.log(2)
    if share == 1:
        torch.testing.assert_close(change, torch.full_like(change, -1.0), rtol=0, atol=1e-3)
    else:  # half of it by construction, the rest as the network likes
        assert (change + 1.0).abs().max() > 1e-2


@torch.no_grad()
def test_a_new_network_gives_the_photos_colour_no_part() -> None:
    """The share is learnt; it starts at 0, and the paper's network has none of it."""
    torch.manual_seed(0)
    fresh = Generator(SMALL)
    assert fresh.colour is not None
    assert fresh.colour(torch.randn(3, 32)).abs().max() == 0
    assert chroma(photos()).sum(1).abs().max() < 1e-5
    assert chroma(photos())[:, 0].min() > 0.3  # red, as the photos are
    assert Generator(replace(SMALL, lamps=0, brightness=0.0, colour=False)).colour is None


@torch.no_grad()
def test_the_file_gives_light_and_lamps(everything_model: Path, shallow_networks: None) -> None:
    expected, lamps = network(EVERYTHING).light(photos())
    assert lamps is not None
    found, given, _ = OnnxEstimator(everything_model).run_fully(photos().numpy())
    np.testing.assert_allclose(found, expected, atol=5e-3, rtol=0)
    np.testing.assert_allclose(given, lamps, atol=5e-3, rtol=0)
    other, _, _ = OnnxEstimator(everything_model).run_fully(photos(seed=5).numpy())
    assert np.abs(other - expected.numpy()).max() > 1e-2  # the twin that must fail


def test_an_estimate_has_lamps_the_strongest_first(everything_model: Path) -> None:
    estimator = OnnxEstimator(everything_model)
    picture = np.random.default_rng(0).uniform(0, 1, (160, 120, 3))
    estimate = estimator.explain(picture)
    fluxes = [lamp.luminous_flux for lamp in estimate.lamps]
    assert 3 < len(fluxes) <= 6  # of two looks
    assert fluxes == sorted(fluxes, reverse=True)
    assert len(estimator.explain(picture, fov_deg=40).lamps) == 3  # of one
    drawn = np.sum([lobe_on_ball(lamp) for lamp in estimate.lamps], axis=0)
    on = mirror_ball.coverage(32) > 0
    assert (estimate.lighting.radiance[on] >= drawn[on] * 0.999).all()
    assert estimator.estimate(picture).radiance == pytest.approx(estimate.lighting.radiance)


@torch.no_grad()
def test_the_file_can_be_learnt_from_again(everything_model: Path, shallow_networks: None) -> None:
    again, contract = load_network(everything_model)
    assert contract == EVERYTHING_CONTRACT
    torch.testing.assert_close(again(photos()), network(EVERYTHING)(photos()), atol=5e-3, rtol=0)


@torch.no_grad()
def test_a_network_without_lamps_becomes_one_with_lamps() -> None:
    plain = replace(SMALL, lamps=0, brightness=0.0, colour=False)
    teacher, student = network(plain), Generator(SMALL).eval()
    start_from(student, SMALL, teacher, photos(8))
    even = photos(8) + 0.5
    even = even * (0.45 / even.mean((1, 2, 3), keepdim=True)) - 0.5  # brightness plays no part
    ours, theirs = power(student(even).exp()), power(teacher(even).exp())
    assert ((ours / theirs).log().abs() < 0.6).all()  # dimmer map and new lamps make up
    _, lamps = student.light(even)
    assert lamps is not None
    assert (lamps[..., 1] > 0).all()  # they start above the horizon


@torch.no_grad()
@pytest.mark.parametrize("mirrored", [True, False])
def test_features_read_both_ways_give_mirrored_light(mirrored: bool) -> None:
    one = network(replace(SMALL, mirrored=mirrored, colour=False))
    seen = torch.rand(2, *one.features(photos()).shape[1:])
    even = torch.zeros(2, 3, 192, 135)  # whose brightness is its mirror image's
    one.features = lambda _: seen  # type: ignore[method-assign]
    light, lamps = one.light(even)
    one.features = lambda _: seen.flip(-1)  # type: ignore[method-assign]
    other, others = one.light(even)
    assert lamps is not None
    assert others is not None
    image = others.flip(1)
    image[..., 0] *= -1
    assert torch.allclose(other.flip(-1), light, atol=1e-4) == mirrored
    assert torch.allclose(image, lamps, atol=1e-4) == mirrored


@torch.no_grad()
def test_a_network_that_reads_both_ways_keeps_it_in_its_file(
    everything_model: Path, shallow_networks: None
) -> None:
    found, *_ = OnnxEstimator(everything_model).run_fully(photos().numpy())
    again, _ = load_network(everything_model)
    assert again.mirrored
    np.testing.assert_allclose(found, again(photos()), atol=5e-3, rtol=0)
    again.mirrored = False  # the twin: read one way
    assert np.abs(found - again(photos()).numpy()).max() > 1e-2
