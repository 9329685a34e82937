"""Heads: they learn what can be learnt, keep what they say, and come back from a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from deeplight.contract import HEADS
from deeplight.deploy import onnx
from deeplight.deploy.network import Refinement, write_network
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.sureness import Sureness, camera_record, sureness_of
from deeplight.estimators.upright import SURE_CHANCE, guessed_tilt, turn_notes
from deeplight.training import heads as teaching
from deeplight.training.heads import (
    SCALES,
    Views,
    calibrate,
    fitted,
    light_errors,
    measured,
    turned,
)
from deeplight.training.indoors import learn_indoors
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator, NetworkConfig
from networks import EVERYTHING, EVERYTHING_CONTRACT, random_network, traced_once

SMALL = NetworkConfig(
    latent_size=32, decoder_widths=(8, 8), encoder_norm="none", decoder_norm="none", width=0.35,
    heads=True,
)  # fmt: skip
BIAS = "heads.outer.bias"


def network() -> Generator:
    torch.manual_seed(0)
    return Generator(SMALL).eval()


def views(count: int, seed: int) -> Views:
    """Features of which a third says the pitch, and another third how far off that is."""
    random, size = np.random.default_rng(seed), 11 * 56
    one, other = random.normal(0, 1, (2, count, 1))
    averaged = random.normal(0, 1, (count, size)).astype(np.float32)
    averaged[:, ::3] += one
    averaged[:, 1::3] += other
    spread = np.where(other[:, 0] > 0, 0.02, 0.3)
    pitch = 0.3 * one[:, 0] + spread * random.normal(0, 1, count)
    pitch[::5] = np.nan  # not known of some
    camera = np.stack((np.full(count, np.nan), pitch, np.zeros(count)), 1)
    errors = np.abs(random.normal(0, 1, (count, 4))) * spread[:, None]
    errors[::7] = np.nan
    return Views(
        torch.from_numpy(averaged), torch.tensor(camera, dtype=torch.float32),
        torch.tensor(errors, dtype=torch.float32), torch.zeros(count),
        torch.from_numpy(np.where(np.arange(count) % 5, one[:, 0] > 0, np.nan)),
        np.array([f"place{n % 7}" for n in range(count)]),
        np.array([f"take{n // 2}" for n in range(count)]),
    )  # fmt: skip


def test_they_learn_a_number_and_how_far_off_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(teaching, "STEPS", 250)
    heads = fitted(views(2000, 0), network())
    calibrate(heads, views(600, 1))
    found = measured(heads, views(1000, 2))
    assert found["pitch_scale"].error < 0.75 * found["pitch_scale"].plain
    for name in ("pitch_scale", "brightness_scale", "direction_scale"):
        assert found[name].within == pytest.approx(0.68 * 8 / 7, abs=0.1)  # of seven places
        assert found[name].surest < 0.75
    before = fitted(views(2000, 0), network())  # the twin: not calibrated to errors twice as large
    wide = views(1000, 2)
    twice = replace(wide, errors=2 * wide.errors)
    assert measured(before, twice)["brightness_scale"].within < 0.6


@torch.no_grad()
def test_scales_hold_in_new_places_that_of_colour_in_new_takes() -> None:
    heads, some = network().heads, views(600, 1)
    assert heads is not None
    assert measured(heads, some)["colour_scale"].within != pytest.approx(0.68, abs=0.02)  # the twin
    calibrate(heads, some)
    found = measured(heads, some)
    assert found["brightness_scale"].within == pytest.approx(0.68 * 8 / 7, abs=0.003)
    assert found["colour_scale"].within == pytest.approx(0.68 * 301 / 300, abs=0.003)


def test_scales_set_anew_change_nothing_else_in_the_file(
    everything_model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shallow_networks: None
) -> None:
    second = tmp_path / "second.onnx"
    monkeypatch.setattr(teaching, "views_of", lambda *_: views(300, 1))
    monkeypatch.setattr(onnx, "traced", traced_once)
    write_network(everything_model, second, refinement=Refinement(scales=("data",)))
    before, after = (load_network(path)[0].state_dict() for path in (everything_model, second))
    assert {name for name in before if not torch.equal(before[name], after[name])} == {BIAS}
    moved = (after[BIAS] != before[BIAS]).nonzero()[:, 0].tolist()
    assert {HEADS[number] for number in moved} <= set(SCALES)
    said = load_network(second)[0].heads
    assert said is not None
    assert measured(said, views(300, 1))["brightness_scale"].within == pytest.approx(0.78, abs=0.01)


def test_rooms_are_learnt_and_nothing_else_changes(
    everything_model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shallow_networks: None
) -> None:
    second, new = tmp_path / "second.onnx", views(300, 1)
    monkeypatch.setattr(teaching, "views_of", lambda *_: views(900, 0))
    monkeypatch.setattr(onnx, "traced", traced_once)
    write_network(everything_model, second, refinement=Refinement(indoors=("data",)))
    networks = [load_network(path)[0] for path in (everything_model, second)]
    before, after = (network.state_dict() for network in networks)
    changed = {name for name in before if not torch.equal(before[name], after[name])}
    # The graph is traced with a bias of zeros, which the exporter leaves out.
    assert changed - {"heads.indoors.bias"} == {"heads.indoors.weight"}
    said = [network.heads.read(new.averaged)[:, -1] for network in networks if network.heads]
    assert torch.equal(said[0], torch.full((300,), 0.5))  # the twin: nobody has taught it
    known = new.indoors.isfinite()
    assert ((said[1] > 0.5) == (new.indoors > 0.5))[known].float().mean() > 0.9


def test_of_one_kind_of_place_no_room_is_learnt() -> None:
    heads, some = network().heads, views(50, 1)
    assert heads is not None
    learn_indoors(heads, some.averaged, torch.ones(50), some.places)
    assert not heads.indoors.weight.any()


def test_errors_of_light_are_what_they_are_called() -> None:
    light = np.random.default_rng(0).uniform(0.5, 2, (32, 32, 3)).astype(np.float32)
    light[8, 20] = 200
    same = light_errors(light, light)
    assert same == pytest.approx([0, 0, 0, 0], abs=1e-3)
    brighter = light_errors(2 * light, light)
    assert brighter == pytest.approx([np.log(2), 0, 0, np.log(2)], abs=1e-3)
    image = light_errors(light[:, ::-1], light)
    assert image[2] > 0.2
    assert light_errors(light * np.float32([2, 1, 1]), light)[1] > 0.1


def test_a_photo_on_its_side_is_what_a_camera_would_give() -> None:
    photo = np.random.default_rng(0).integers(0, 256, (192, 135, 3)).astype(np.uint8)
    upright, head = turned(photo, 0), turned(photo, 2)
    np.testing.assert_allclose(head, upright[:, ::-1, ::-1])
    side = turned(photo, 1)
    assert side.shape == upright.shape
    assert not np.allclose(side, upright, atol=0.1)


@torch.no_grad()
def test_what_they_say_is_in_the_file_and_in_the_estimate(
    everything_model: Path, shallow_networks: None
) -> None:
    estimator = OnnxEstimator(everything_model)
    picture = np.random.default_rng(0).uniform(0, 1, (160, 120, 3))
    estimate = estimator.explain(picture)
    assert tuple(estimate.heads) == HEADS
    assert all(estimate.heads[name] > 0 for name in SCALES)
    chances = [estimate.heads[name] for name in HEADS if name.startswith("upright")]
    assert sum(chances) == pytest.approx(1, abs=1e-5)
    again, contract = load_network(everything_model)
    assert contract == EVERYTHING_CONTRACT
    photo = torch.rand(2, 3, 192, 135) - 0.5
    expected = random_network(EVERYTHING).everything(photo)[2]
    torch.testing.assert_close(again.everything(photo)[2], expected)
    said = sureness_of(estimate)
    assert said is not None
    assert said.record()["scale"]["brightness"] > 0
    guess = camera_record(estimate.heads)
    assert guess["pitch_deg"]["scale"] > 0
    assert 0.25 <= guess["upright_after_turning"]["chance"] <= 1


def test_a_model_without_heads_says_nothing(root: Path) -> None:
    plain = OnnxEstimator(root / "tests" / "golden" / "tiny.onnx", trusted=True)
    assert not plain.contract.heads
    estimate = plain.explain(np.full((160, 120, 3), 0.4))
    assert estimate.heads == {}
    assert sureness_of(estimate) is None


def test_words_follow_the_scales_and_warnings() -> None:
    heads = dict.fromkeys(HEADS, 0.25)
    known = Sureness(heads, True)
    assert set(known.words.values()) == {"roughly known", "not known"}  # 0.25 rad of colour: 14°
    assert known.words["direction"] == "roughly known"
    assert Sureness(heads | {"direction_scale": 1.2}, True).words["direction"] == "not known"
    assert Sureness(heads, False).words["direction"] == "not known"
    assert set(Sureness(heads, True, ("black",)).words.values()) == {"not known"}
    assert Sureness(heads, True, ("black",)).sentences == ("black",)


def test_a_photo_on_its_side_is_noted_where_the_network_is_sure() -> None:
    heads = dict.fromkeys(HEADS, 0.25)
    assert turn_notes(heads) == turn_notes({}) == ()
    lying = heads | {"upright_90": SURE_CHANCE + 0.01}
    (note,) = turn_notes(lying)
    assert "90 degrees clockwise" in note
    assert Sureness(lying, True).sentences[0] == note
    assert Sureness(lying, True).words["direction"] == "not known"
    assert turn_notes(heads | {"upright_0": 0.9}) == ()
    assert turn_notes(heads | {"upright_90": 0.1, "upright_270": SURE_CHANCE - 0.01}) == ()
    either = heads | {"upright_0": 0.04, "upright_90": 0.51, "upright_270": 0.45}
    assert "one way or the other" in turn_notes(either)[0]
    assert guessed_tilt(either | {"pitch_rad": 0.1, "pitch_scale": 0.1}) is None
