"""Baselines: what they answer, and that the best constant is one."""

from collections.abc import Iterator

import numpy as np
import pytest

from deeplight.camera_response import decode, encode, soft_clip
from deeplight.dataset import (
    DataSet,
    Example,
    ExampleMeta,
    ShardJob,
    open_dataset,
)
from deeplight.evaluate.baselines.khan_2006 import Khan2006
from deeplight.evaluate.baselines.nearest_neighbour import (
    NearestNeighbour,
    chosen_photos,
    descriptor,
    descriptors_of,
)
from deeplight.evaluate.baselines.photo_mean import PhotoMean
from deeplight.evaluate.baselines.suite import (
    CACHE,
    DESCRIPTORS,
    baselines_for,
    constant_baselines,
    nearest_neighbour,
)
from deeplight.evaluate.baselines.training_mean import training_mean
from deeplight.evaluate.baselines.training_pixels import training_pixels
from deeplight.evaluate.metrics import masked_l1
from deeplight.evaluate.scores import rendered_radiance
from deeplight.mappings import mirror_ball
from deeplight.preprocess import normalise
from deeplight.reflectance import rig_bases
from deeplight.solve import (
    SphereCounts,
    constant_loss,
    light_from_spheres,
    solve_constant,
    solve_mean,
)
from deeplight.sphere import PAPER_RIG, SPHERES, Rig
from toy_data import write_toy_data

TURNED = Rig(
    "turned",
    {name: PAPER_RIG.views[name].mirrored() for name in SPHERES},
)
RIGS = {rig.name: rig for rig in (PAPER_RIG, TURNED)}
DISC = mirror_ball.coverage(32) > 0.99


def light(number: int) -> np.ndarray:
    """A dim room with a lamp above to the right, brighter from example to example."""
    directions = mirror_ball.pixel_directions(32)
    towards = np.array([0.6, 0.7, 0.4]) / np.linalg.norm([0.6, 0.7, 0.4])
    lamp = np.exp(20 * (directions @ towards - 1))[..., None]
    radiance = 0.2 + (2 + 0.4 * number) * lamp * np.array([1.0, 0.8, 0.6])
    return (radiance * (mirror_ball.coverage(32) > 0)[..., None]).astype(np.float32)


def example(number: int, split: str, rig: Rig) -> Example:
    scene = "outdoor" if split.endswith("outdoor") else "indoor"
    place = f"{'home' if split in ('train', 'seen_indoor') else split}-{number % 3}"
    with np.errstate(divide="ignore"):
        q = np.log(light(number))[None]
    spheres = {
        name: np.floor(encode(soft_clip(r[0])) * 255 + 0.5).astype(np.uint8)
        for name, r in rendered_radiance(rig_bases(rig), q).items()
    }
    meta = ExampleMeta(place, "take", number, scene, split, rig.name, "phone", "CC0", "test")
    background = np.full((192, 135, 3), 100 + number, np.uint8)
    true_lighting = None if split == "train" else light(number)
    return Example(f"{split}-{number}", background, spheres, meta, true_lighting)


def examples_of(job: ShardJob) -> Iterator[Example]:
    for number in range(job.first, job.first + job.count):
        yield example(number, job.split, TURNED if number % 4 == 3 else PAPER_RIG)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> DataSet:
    counts = {"train": 12, "seen_indoor": 4, "val_indoor": 3, "val_outdoor": 3}
    return open_dataset(write_toy_data(tmp_path_factory.mktemp("data"), counts, examples_of, RIGS))


def test_pixels_are_counted_by_rig(data: DataSet) -> None:
    rigs = training_pixels(data)
    assert [rig.examples for rig in rigs] == [9, 3]
    assert (rigs[0].counts.sum(-1) == 9).all()
    spheres = np.stack([data.index("train")[n].spheres["diffuse"] for n in range(12) if n % 4 != 3])
    mean = decode(spheres / 255).mean(0).reshape(-1, 3)
    np.testing.assert_allclose(rigs[0].mean_linear("diffuse"), mean, atol=1e-9)


def test_the_mean_spheres_is_as_bright_as_the_mean_diffuse_sphere(data: DataSet) -> None:
    rigs = training_pixels(data)
    q = solve_mean(rigs[:1])
    rendered = rendered_radiance(rig_bases(PAPER_RIG), q[None])["diffuse"][0]
    mask = PAPER_RIG.views["diffuse"].mask()
    filmed = rigs[0].mean_linear("diffuse").reshape(32, 32, 3)
    np.testing.assert_allclose(rendered[mask].sum(0), filmed[mask].sum(0), rtol=1e-3)


def test_the_mean_spheres_has_its_lamp_where_the_lamp_is(data: DataSet) -> None:
    """In the camera frame, though the mirror sphere was seen in its own frames."""
    q = solve_mean(training_pixels(data))
    brightest = np.where(DISC, q.sum(-1), -np.inf).argmax()
    direction = mirror_ball.pixel_directions(32).reshape(-1, 3)[brightest]
    towards = np.array([0.6, 0.7, 0.4]) / np.linalg.norm([0.6, 0.7, 0.4])
    assert np.degrees(np.arccos(direction @ towards)) < 15
    assert np.degrees(np.arccos(direction @ (towards * [-1, 1, 1]))) > 30  # the twin: mirrored


def test_the_counted_loss_is_the_loss_of_the_examples(data: DataSet) -> None:
    q = np.log(np.maximum(light(2), 1e-4))
    expected = 0.0
    for item in data.examples("train"):
        rig = data.rigs[item.meta.rig]
        for name, weight in (("mirror", 0.2), ("matte_silver", 0.2), ("diffuse", 0.6)):
            linear = rendered_radiance(rig_bases(rig), q[None])[name]
            filmed = item.spheres[name][None] / np.float32(255)
            error = masked_l1(encode(soft_clip(linear)), filmed, rig.views[name].mask())
            expected += weight * error[0] / 12
    assert constant_loss(training_pixels(data), q) == pytest.approx(expected, rel=1e-4)


def test_no_other_constant_answers_training_better(data: DataSet) -> None:
    rigs = training_pixels(data)
    start = solve_mean(rigs)
    best = solve_constant(rigs, start, steps=60)
    loss = constant_loss(rigs, best)
    assert loss < 0.9 * constant_loss(rigs, start)
    random = np.random.default_rng(0)
    for _ in range(2):
        other = best + random.normal(0, 0.2, best.shape).astype(np.float32)
        assert constant_loss(rigs, other) > loss
    for number in (0, 5, 11):  # nor does the true light of any one example
        truth = np.log(np.maximum(light(number), 1e-4))
        assert constant_loss(rigs, truth) > loss - 2e-3


def test_the_mean_true_light_is_that_of_the_seen_split(data: DataSet) -> None:
    found = training_mean(data)
    assert found is not None
    expected = np.mean([np.log(np.maximum(light(number), 1e-4)) for number in range(4)], axis=0)
    np.testing.assert_allclose(found.log_radiance, expected, atol=1e-5)


def test_constants_are_kept_next_to_the_data_and_made_again_when_it_changed(
    data: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = "deeplight.evaluate.baselines.suite"
    calls = []

    def counted(data: DataSet) -> list[SphereCounts]:
        calls.append(data)
        return training_pixels(data)

    monkeypatch.setattr(f"{module}.training_pixels", counted)
    monkeypatch.setattr(f"{module}.solve_constant", lambda p, q: solve_constant(p, q, steps=2))
    first = constant_baselines(data)
    again = constant_baselines(data)
    assert len(calls) == 1
    assert [b.name for b in first] == ["mean_spheres", "best_constant", "training_mean"]
    for one, other in zip(first, again, strict=True):
        assert one.name == other.name
        np.testing.assert_array_equal(one.log_radiance, other.log_radiance)
    cache = data.folder / CACHE
    cache.write_bytes(cache.read_bytes()[:100])
    constant_baselines(data)
    assert len(calls) == 2
    manifest = data.folder / "manifest.json"
    manifest.write_text(manifest.read_text() + "\n")
    constant_baselines(data)
    assert len(calls) == 3


def test_true_light_of_the_seen_split_is_no_baseline_for_the_seen_split(
    data: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = "deeplight.evaluate.baselines.suite"
    monkeypatch.setattr(f"{module}.solve_constant", lambda p, q: solve_constant(p, q, steps=2))
    assert "training_mean" in [b.name for b in baselines_for(data, "val")]
    assert "nearest_neighbour" not in [b.name for b in baselines_for(data, "train")]
    for split in ("seen", "seen_indoor"):
        assert "nearest_neighbour" in [b.name for b in baselines_for(data, split)]
        assert "training_mean" not in [b.name for b in baselines_for(data, split)]


@pytest.mark.parametrize("value", [0, 1, 128, 255])
def test_photo_mean_is_uniform_light_in_the_photos_colour(value: int) -> None:
    photos = np.zeros((2, 192, 135, 3), np.uint8)
    photos[0], photos[1, :, :, 0] = value, value
    q = PhotoMean().estimate_inputs(normalise(photos))
    assert q.shape == (2, 32, 32, 3)
    assert np.isfinite(q).all()
    linear = max((value / 255) ** 2.2, 1e-4)
    np.testing.assert_allclose(np.exp(q[0]), linear, rtol=1e-3)
    np.testing.assert_allclose(np.exp(q[1, :, :, 0]), linear, rtol=1e-3)
    np.testing.assert_allclose(np.exp(q[1, :, :, 1:]), 1e-4, rtol=1e-3)


def test_photo_mean_averages_light_and_not_pixel_values() -> None:
    photo = np.zeros((1, 192, 135, 3), np.uint8)
    photo[:, :96] = 255
    q = PhotoMean().estimate_inputs(normalise(photo))
    np.testing.assert_allclose(np.exp(q), 0.5, rtol=1e-3)


def test_khan_shows_the_photo_in_front_and_mirrors_it_behind() -> None:
    photo = np.zeros((1, 192, 135, 3), np.uint8)
    photo[:, :96, 67:] = 255  # the upper right quarter
    radiance = np.exp(Khan2006().estimate_inputs(normalise(photo))[0])
    directions = mirror_ball.pixel_directions(32)
    clear = DISC & (np.abs(directions[..., :2]) > 0.2).all(-1)
    lit = (directions[..., 0] > 0) & (directions[..., 1] > 0)
    np.testing.assert_allclose(radiance[clear & lit], 1, rtol=1e-3)
    np.testing.assert_allclose(radiance[clear & ~lit], 1e-4, rtol=1e-3)
    for behind in (True, False):
        assert (clear & lit & ((directions[..., 2] > 0) == behind)).any()


def test_khan_gives_a_plain_photo_its_own_colour() -> None:
    photo = np.full((2, 192, 135, 3), (255, 128, 64), np.uint8)
    radiance = np.exp(Khan2006().estimate_inputs(normalise(photo)))
    expected = np.broadcast_to(decode(np.array([255, 128, 64]) / 255), radiance[:, DISC].shape)
    np.testing.assert_allclose(radiance[:, DISC], expected, rtol=1e-3)


def test_a_baseline_takes_photos_of_any_size() -> None:
    lighting = PhotoMean().estimate(np.full((400, 300, 3), 255, np.uint8))
    np.testing.assert_allclose(lighting.radiance[DISC], 1, rtol=1e-3)


# -- nearest neighbour -------------------------------------------------------------------------


def test_a_training_photo_is_its_own_nearest_neighbour(data: DataSet) -> None:
    index = data.index("train")
    numbers = chosen_photos(index)
    found = NearestNeighbour(data, descriptors_of(index, numbers), numbers)
    for number in (0, 7, 11):
        item = index[number]
        answer = found.estimate_inputs(normalise(item.background[None]))[0]
        own = light_from_spheres(dict(item.spheres), rig_bases(data.rigs[item.meta.rig])).radiance
        np.testing.assert_allclose(np.exp(answer), np.maximum(own, 1e-4), rtol=1e-5)


def test_the_fitted_light_renders_the_filmed_spheres(data: DataSet) -> None:
    """Though the lamp saturates the mirror: its strength comes back from the diffuse sphere."""
    item = data.index("train")[11]
    bases = rig_bases(data.rigs[item.meta.rig])
    assert (item.spheres["mirror"] == 255).any()
    radiance = light_from_spheres(dict(item.spheres), bases).radiance
    mask = bases["diffuse"].view.mask()
    filmed = item.spheres["diffuse"] / np.float32(255)

    def error(light: np.ndarray) -> float:
        q = np.log(np.maximum(light, 1e-4)).astype(np.float32)
        linear = rendered_radiance(bases, q[None])["diffuse"]
        return float(masked_l1(encode(soft_clip(linear)), filmed[None], mask)[0])

    assert error(radiance) < 0.03
    assert error(np.minimum(radiance, 1.2)) > 2 * error(radiance)  # the twin: left clipped


def test_the_descriptor_sees_colours_and_edges() -> None:
    random = np.random.default_rng(0)
    photo = random.uniform(0, 1, (192, 135, 3)).astype(np.float32)
    stripes = np.broadcast_to((np.arange(135) // 8 % 2)[None, :, None], photo.shape).astype(
        np.float32
    )
    upright, lying = descriptor(stripes), descriptor(stripes[:135].transpose(1, 0, 2))
    assert descriptor(photo).shape == (416,)
    assert np.linalg.norm(upright - lying) > 1
    assert np.linalg.norm(descriptor(photo) - descriptor(photo * [1, 0.5, 0.5])) > 1
    nearly = descriptor(np.clip(photo + random.normal(0, 0.01, photo.shape), 0, 1))
    assert np.linalg.norm(descriptor(photo) - nearly) < 0.3


def test_descriptors_are_kept_next_to_the_data(
    data: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = nearest_neighbour(data)
    assert (data.folder / DESCRIPTORS).exists()
    monkeypatch.setattr("deeplight.evaluate.baselines.suite.descriptors_of", None)  # not again
    photo = normalise(data.index("train")[3].background[None])
    np.testing.assert_array_equal(
        nearest_neighbour(data).estimate_inputs(photo), first.estimate_inputs(photo)
    )
