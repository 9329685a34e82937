"""The rivals of section 4.3: made-up skies come back, and each learns eight examples by heart."""

import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from deeplight.camera_response import LUMINANCE
from deeplight.dataset import open_dataset
from deeplight.errors import ConfigError, ModelError
from deeplight.estimators.onnx import shipped_model
from deeplight.evaluate.panorama_estimates import panorama_estimates
from deeplight.evaluate.rivals import gardner_2017, hold_geoffroy_2017
from deeplight.evaluate.rivals.crops import HEIGHT, Pair, ViewPlan, all_pairs, drawn_elevation
from deeplight.evaluate.rivals.predict import write_answers
from deeplight.evaluate.rivals.rival import (
    PRESETS,
    Rival,
    RivalConfig,
    inputs_of,
    load_rival,
    new_network,
)
from deeplight.evaluate.rivals.sky import Sky, fitted_sky
from deeplight.evaluate.rivals.training import Lessons, read_features, train_rival
from deeplight.frames import normalised, rotation, turned
from deeplight.mappings import latlong
from deeplight.training.model_file import load_network
from deeplight.training.network.imagenet import named_convolutions
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder
from made_up_places import places, rooms, towards
from toy_data import write_toy_data

pytestmark = pytest.mark.needs("scipy")


# -- what they learn from --------------------------------------------------------------------------

VIEWS = ViewPlan(64, 48, per_panorama=2, fov_deg=(50, 50))


@pytest.fixture(scope="module", autouse=True)
def skies_fitted_once() -> Iterator[None]:
    """Every training fits the same four skies, each for a quarter of a second."""
    found: dict[bytes, Sky] = {}

    def once(panorama: np.ndarray) -> Sky:
        key = panorama.tobytes()
        return found.get(key) or found.setdefault(key, fitted_sky(panorama))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hold_geoffroy_2017, "fitted_sky", once)
        yield


@pytest.fixture(scope="module")
def pairs() -> list[Pair]:
    return all_pairs(places(), VIEWS)


def test_a_pair_holds_the_light_of_its_own_view(pairs: list[Pair]) -> None:
    """The panorama around the view direction is what the photo shows, for every elevation."""
    for pair in pairs:
        rays = rotation("x", pair.elevation_rad) @ np.array([0.0, 0.0, -1.0])
        row, column = latlong.position(rays[None], HEIGHT, 2 * HEIGHT)
        near = pair.panorama[int(row[0]) - 1 : int(row[0]) + 3, int(column[0]) : int(column[0]) + 2]
        shown = (pair.photo[18:30, 24:40] / 255.0) ** 2.2
        ours, photos = near.mean((0, 1)) @ LUMINANCE, shown.mean((0, 1)) @ LUMINANCE
        assert abs(np.log2(min(ours, 1.0) / photos)) < 1.2
    assert len({round(pair.elevation_rad, 3) for pair in pairs}) == len(pairs)


def test_views_are_held_as_a_data_sets_phones_are_where_no_elevation_is_given() -> None:
    """Mostly downward; given, they look up as often as down."""
    random = np.random.default_rng(0)
    held, even = (
        np.degrees([drawn_elevation(replace(VIEWS, elevation_deg=e), random) for _ in range(300)])
        for e in (0, 30)
    )
    assert -18 < held.mean() < -10
    assert held.min() > -60
    assert abs(even.mean()) < 4
    assert np.abs(even).max() <= 30


def test_the_same_seed_gives_the_same_views(pairs: list[Pair]) -> None:
    again = all_pairs(places(), VIEWS)
    assert all((a.photo == b.photo).all() for a, b in zip(pairs, again, strict=True))
    assert (all_pairs(places(), VIEWS, seed=1)[0].photo != pairs[0].photo).any()


def test_the_light_of_a_mirrored_view_is_mirrored(pairs: list[Pair]) -> None:
    pair = pairs[3]
    mirrored = pair.mirror()
    np.testing.assert_array_equal(mirrored.photo, pair.photo[:, ::-1])
    np.testing.assert_array_equal(mirrored.panorama, pair.panorama[:, ::-1])
    np.testing.assert_array_equal(mirrored.mirror().panorama, pair.panorama)


def test_a_views_sky_is_its_places_turned_and_in_the_cameras_unit(pairs: list[Pair]) -> None:
    """Skies are fitted once a place; a fit to what each view itself sees says the same."""
    views = [pairs[1], pairs[4], pairs[4].mirror()]
    bins, parameters = hold_geoffroy_2017.labels_of(views)
    for pair, target, (log_scale, turbidity, elevation, _) in zip(
        views, bins, parameters, strict=True
    ):
        own = fitted_sky(pair.panorama / (pair.gain / (pair.gain @ LUMINANCE)))
        np.testing.assert_allclose(target, hold_geoffroy_2017.sun_target(own.sun), atol=0.02)
        assert turbidity == pytest.approx(own.turbidity, abs=0.2)
        assert np.exp(log_scale) == pytest.approx(own.scale, rel=0.05)
        assert elevation == pair.elevation_rad
    assert bins[1].argmax() != bins[2].argmax()


# -- the networks ----------------------------------------------------------------------------------


def smaller(config: RivalConfig, width: float, photo_size: tuple[int, int]) -> RivalConfig:
    """The same rival with fewer channels and smaller photos."""
    height, across = photo_size
    views = replace(config.views, height=height, width=across)
    return replace(config, width=width, photo_size=photo_size, views=views)


def smallest(**settings: Any) -> RivalConfig:
    return replace(smaller(PRESETS["hold_geoffroy_2017"], 0.05, (24, 32)), batch_size=4, **settings)


def test_as_published_they_have_the_papers_sizes() -> None:
    gardner = gardner_2017.Gardner2017()
    colours, intensity = gardner(torch.zeros(2, 3, 192, 256))
    assert colours.shape == (2, 3, 32, 64)
    assert intensity.shape == (2, 1, 32, 64)
    assert gardner.latent[1].in_features == 12_288
    assert gardner.latent[1].out_features == 1024
    hold = hold_geoffroy_2017.HoldGeoffroy2017()
    assert 43e6 < sum(p.numel() for p in hold.parameters()) < 47e6
    bins, parameters = hold(torch.zeros(2, 3, 240, 320))
    assert bins.shape == (2, 160)
    assert parameters.shape == (2, 4)
    torch.testing.assert_close(bins.exp().sum(1), torch.ones(2))


def test_suns_bins_are_a_grid_whose_target_peaks_at_the_sun() -> None:
    rays = hold_geoffroy_2017.bin_directions()
    assert (rays[:, 1] > 0).all()
    assert np.linalg.norm(rays, axis=1) == pytest.approx(1)
    sun = towards(40, -75)
    target = hold_geoffroy_2017.sun_target(sun)
    assert target.sum() == pytest.approx(1)
    assert np.degrees(np.arccos(rays[target.argmax()] @ sun)) < 11
    assert target.argmax() != hold_geoffroy_2017.sun_target(towards(40, 75)).argmax()


def test_the_filter_keeps_even_maps_and_sharpens_with_the_epoch() -> None:
    wide, narrow = (gardner_2017.filter_matrix(epoch) for epoch in (0.3, 20.0))
    for matrix in (wide, narrow):
        torch.testing.assert_close(matrix.sum(1), torch.ones(24 * 48))
    middle = 12 * 48 + 24
    assert wide[middle].max() < 0.1 * narrow[middle].max()

    def difference(matrix: torch.Tensor, columns: int) -> float:
        """Of a lamp and the same lamp some columns away."""
        lamp = torch.zeros(24, 48)
        lamp[7:9, 10:12] = 2.0
        moved = torch.roll(lamp, columns, 1)
        return float((((moved - lamp).ravel() @ matrix.T) ** 2).mean())

    # A blurred loss shows the way to a lamp that is far off; a sharp one does not.
    assert difference(wide, 6) < 0.5 * difference(wide, 20)
    assert difference(narrow, 6) > 0.9 * difference(narrow, 20)


def test_a_map_like_the_target_has_no_loss() -> None:
    light = torch.rand(2, 3, 64, 128) * 5
    wanted = gardner_2017.targets(light, 2.5)
    assert float(gardner_2017.loss(wanted, wanted, 1.0)) == 0
    other = (wanted[0], torch.roll(wanted[1], 10, 3))
    assert float(gardner_2017.loss(other, wanted, 1.0)) > 0
    assert (wanted[1] > 0).float().mean() < 1


def test_the_final_map_has_the_photos_colour_and_the_lamps_power() -> None:
    colours = np.full((64, 128, 3), 0.3)
    log_intensity = np.zeros((64, 128))
    log_intensity[10:14, 100:104] = 2.0
    photo = np.full((48, 64, 3), np.array([0.8, 0.6, 0.4]))
    found = gardner_2017.radiance_of(colours, log_intensity, photo)
    tint = photo[0, 0] ** 2.2 / (photo[0, 0] ** 2.2 @ LUMINANCE)
    assert found[12, 102] == pytest.approx(99 * tint, rel=1e-3)
    assert found[40, 5] == pytest.approx(0.3 * tint, rel=1e-3)


@pytest.mark.parametrize(
    "preset", [pytest.param("gardner_2017", marks=pytest.mark.slow), "hold_geoffroy_2017"]
)
def test_each_learns_eight_examples_by_heart(preset: str, tmp_path: Path) -> None:
    """And answers with its light where it is: the brightest direction within 25 degrees."""
    pairs = all_pairs(rooms() if preset == "gardner_2017" else places(), VIEWS)
    config = smaller(PRESETS[preset], 0.12, (48, 64))
    kept = {"learning_rate": 0.005, "steps": 100, "batch_size": 8, "epoch_steps": 12}
    torch.set_num_threads(1)
    rival = train_rival(type(config)(**{**vars(config), **kept}), pairs)
    losses = [row[1] for row in rival.history]
    assert losses[-1] < 0.25 * losses[0]
    off = [degrees_between(rival.panorama(p.photo), in_camera(p, preset)) for p in pairs]
    assert np.median(off) < 25
    shuffled = [
        degrees_between(rival.panorama(p.photo), in_camera(q, preset))
        for p, q in zip(pairs, [*pairs[3:], *pairs[:3]], strict=True)
    ]
    assert np.median(shuffled) > 40  # the twin: another photo's light
    rival.save(tmp_path / "rival.safetensors")
    again = load_rival(tmp_path / "rival.safetensors")
    np.testing.assert_allclose(
        again.panorama(pairs[0].photo), rival.panorama(pairs[0].photo), rtol=1e-5
    )
    data = open_dataset(write_toy_data(tmp_path / "data", {"val_indoor": 3}))
    write_answers(again, data.index("val"), range(3), tmp_path / "answers")
    (method,) = panorama_estimates([f"rival={tmp_path / 'answers'}"])
    assert np.isfinite(method.estimate_keys(data.index("val").keys)).all()


@pytest.mark.parametrize("preset", ["gardner_2017", "hold_geoffroy_2017"])
def test_bfloat16_changes_a_loss_by_less_than_a_hundredth(preset: str, pairs: list[Pair]) -> None:
    """And only convolutions and dense layers have it: answers, weights and slopes are float32."""
    losses, slopes = [], []
    for precision in ("32-true", "bf16-mixed"):
        torch.manual_seed(3)
        config = replace(smaller(PRESETS[preset], 0.1, (48, 64)), precision=precision)
        rival = Rival(config, new_network(config), {})
        lessons = Lessons(rival, pairs)
        rows = np.arange(len(pairs))
        assert all(answer.dtype == torch.float32 for answer in lessons.answer(rows))
        value = lessons.loss(rows, 1.0)
        value.backward()
        losses.append(value.item())
        slopes.append(torch.cat([p.grad.flatten() for p in rival.network.parameters()]))
    assert losses[0] != losses[1]
    assert losses[1] == pytest.approx(losses[0], rel=0.01)
    assert torch.cosine_similarity(*slopes, dim=0) > 0.98


def small_start(path: Path) -> Path:
    """An .npz of folded MobileNetV2 weights, made up."""
    torch.manual_seed(5)
    arrays = {}
    for name, layer in named_convolutions(MobileNetV2Encoder("none")):
        stored = "features.0.conv" if name == "features.0" else name
        torch.nn.init.kaiming_normal_(layer.conv.weight)  # else nothing of the photo is left
        arrays[f"{stored}.weight"] = layer.conv.weight.detach().numpy()
        arrays[f"{stored}.bias"] = 0.01 * torch.randn(len(layer.conv.weight)).numpy()
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize("name", ["gardner_2017-ours", "hold_geoffroy_2017-ours"])
def test_frozen_blocks_run_once_and_give_what_the_whole_network_gives(
    name: str, tmp_path: Path, pairs: list[Pair]
) -> None:
    config = smaller(replace(PRESETS[name], steps=2, batch_size=4), 0.1, (48, 64))
    checkpoint = tmp_path / "rival.checkpoint"
    start = small_start(tmp_path / "w.npz")
    rival = train_rival(config, pairs[:5], start=start, checkpoint=checkpoint)
    lessons = Lessons(rival, pairs[:5], mirrored=True)
    assert lessons.features is not None
    whole = rival.network(inputs_of([pairs[2].photo, pairs[2].mirror().photo], (48, 64)))
    for ours, theirs in zip(lessons.answer(np.array([2, 7])), whole, strict=True):
        torch.testing.assert_close(ours, theirs, atol=5e-3, rtol=5e-3)
    assert not torch.allclose(whole[0][0], whole[0][1], atol=5e-3)  # the twin
    kept = list(tmp_path.glob("features-*.safetensors"))
    for file in kept:  # used, not made again
        save_file({"features": 0 * read_features(file)}, file)
    assert float(Lessons(rival, pairs[:5], True, tmp_path).features.abs().max()) == 0
    new, *others = Lessons(rival, pairs[1:5], False, tmp_path).features  # less of the first place
    assert float(new.abs().max()) > 0
    assert all(float(of_kept.abs().max()) == 0 for of_kept in others)
    kept[0].write_bytes(b"nothing")
    with pytest.raises(ModelError, match="features"):
        train_rival(config, pairs[:5], start=start, checkpoint=checkpoint)
    with pytest.raises(ConfigError, match="--start"):
        train_rival(config, pairs[:5])


def test_a_rival_can_start_from_the_encoder_of_a_network_of_ours(pairs: list[Pair]) -> None:
    """And keeps it, since its blocks are frozen."""
    config = smaller(PRESETS["hold_geoffroy_2017-ours"], 0.02, (48, 64))
    config = replace(config, steps=1, batch_size=4)
    rival = train_rival(config, pairs[:4], start=shipped_model())
    ours = load_network(shipped_model())[0].encoder.state_dict()
    for name, weights in rival.network.encoder.state_dict().items():
        torch.testing.assert_close(weights, ours[name], rtol=0, atol=0)


def test_a_killed_training_goes_on_to_the_same_rival(
    tmp_path: Path, pairs: list[Pair], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deeplight.evaluate.rivals.training.CHECKPOINT_EVERY", 2)
    config = smallest(steps=7, cosine=True)
    held_out, checkpoint = pairs[6:], tmp_path / "rival.checkpoint"
    whole = train_rival(config, pairs[:6], held_out)

    def killed(step: int, loss: float) -> None:
        if step == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_rival(config, pairs[:6], held_out, checkpoint=checkpoint, progress=killed)
    with pytest.raises(ConfigError, match="checkpoint of these settings"):
        train_rival(replace(config, steps=9), pairs[:6], held_out, checkpoint=checkpoint)
    whole_file = checkpoint.read_bytes()
    for damaged in (b"nothing", whole_file[: len(whole_file) // 2], pickle.dumps(replace)):
        checkpoint.write_bytes(damaged)
        with pytest.raises(ModelError, match=r"checkpoint of a rival's training.*remove it"):
            train_rival(config, pairs[:6], held_out, checkpoint=checkpoint)
    checkpoint.write_bytes(whole_file)
    again = train_rival(config, pairs[:6], held_out, checkpoint=checkpoint)
    assert again.history == whole.history
    for name, weights in whole.network.state_dict().items():
        torch.testing.assert_close(again.network.state_dict()[name], weights, rtol=0, atol=0)
    assert not checkpoint.exists()


def test_a_training_whose_time_is_over_keeps_what_it_has(pairs: list[Pair]) -> None:
    config = smallest(steps=500)
    rival = train_rival(config, pairs[:6], pairs[6:], minutes=1e-4)
    assert 1 <= len(rival.history) < 10
    assert np.isfinite(rival.panorama(pairs[0].photo)).all()


def test_the_step_with_the_least_loss_on_held_out_views_is_kept(pairs: list[Pair]) -> None:
    config = smallest(steps=12, learning_rate=0.02)
    rival = train_rival(config, pairs[:4], pairs[4:])
    held_out = [row[2] for row in rival.history]
    rival.network.eval()
    assert Lessons(rival, pairs[4:]).mean_loss(12) == pytest.approx(min(held_out), rel=1e-4)
    assert min(held_out) < held_out[-1]  # else the last step would do


def in_camera(pair: Pair, preset: str) -> np.ndarray:
    """Direction of the brightest light; Gardner's panoramas stay upright, as the paper's do."""
    rows, columns = np.unravel_index(np.argmax(pair.panorama @ LUMINANCE), (HEIGHT, 2 * HEIGHT))
    level = latlong.directions(HEIGHT, 2 * HEIGHT)[rows, columns].astype(float)
    if preset == "gardner_2017":
        return level
    return np.asarray(turned(level, rotation("x", pair.elevation_rad).T))


def degrees_between(panorama: np.ndarray, direction: np.ndarray) -> float:
    height = len(panorama)
    weight = (panorama @ LUMINANCE) ** 2 * latlong.solid_angles(height, 2 * height)
    found = np.einsum("ij,ijk->k", weight, latlong.directions(height, 2 * height))
    return float(np.degrees(np.arccos(np.clip(normalised(found) @ direction, -1, 1))))


def test_another_file_is_no_rival(tmp_path: Path) -> None:
    (tmp_path / "a.safetensors").write_bytes(b"nothing")
    with pytest.raises(ModelError, match="trained rival"):
        load_rival(tmp_path / "a.safetensors")
