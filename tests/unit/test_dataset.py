"""Data sets: what goes in comes out, shards are deterministic, kills and damage are survived."""

import dataclasses
import json
import pickle
import tarfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from deeplight.dataset import (
    Example,
    ExampleMeta,
    ShardJob,
    ShardPlan,
    Skipped,
    open_dataset,
    plan_split,
)
from deeplight.dataset.members import from_members, to_members
from deeplight.errors import DataSetError
from deeplight.io import atomic
from deeplight.io.photos import decode_rgb, encode_jpeg
from deeplight.sphere import PAPER_RIG, SPHERES

RIGS = {"paper": PAPER_RIG.to_dict()}


def an_example(number: int, split: str = "train", /, **changes: object) -> Example:
    random = np.random.default_rng(number)
    scene = "outdoor" if split.endswith("outdoor") else "indoor"
    meta = {
        "place": f"{split}-place-{number % 3}",
        "take": f"take-{number // 2}",
        "frame": number,
        "scene": scene,
        "split": split,
        "rig": "paper",
        "camera": "phone",
        "licence": "CC0" if number % 2 else "BSD",
        "source": "test",
        "details": {"exposure_stops": -0.5},
    }
    fields: dict[str, object] = {
        "key": f"{split}-{number:06d}",
        "background": np.full((192, 135, 3), random.integers(256), np.uint8),
        "spheres": {name: random.integers(0, 256, (32, 32, 3), np.uint8) for name in SPHERES},
        "meta": ExampleMeta(**meta | {k: v for k, v in changes.items() if k in meta}),
        "background_jpeg": None,
        "true_lighting": None if split == "train" else random.random((32, 32, 3), np.float32),
    }
    return Example(**fields | {k: v for k, v in changes.items() if k in fields})


def examples_of(job: ShardJob) -> Iterator[Example | Skipped]:
    for number in range(job.first, job.first + job.count):
        if number == 3:
            yield Skipped("broken.exr", "cut short")
        else:
            yield an_example(number, job.split)


def begin(folder: Path) -> ShardPlan:
    jobs = plan_split("train", 7, 3) + plan_split("val_indoor", 2) + plan_split("val_outdoor", 2)
    return ShardPlan.begin(folder, jobs, RIGS, {"seed": 1, "size": (192, 135)})


def make(folder: Path) -> Path:
    plan = begin(folder)
    for job in plan.missing():
        plan.write(job, examples_of(job))
    plan.finish()
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("data") / "set")


# -- examples ----------------------------------------------------------------------------------


def test_training_examples_never_hold_hdr_light() -> None:
    lighting = np.ones((32, 32, 3), np.float32)
    with pytest.raises(DataSetError, match="8-bit spheres only"):
        an_example(0, "train", true_lighting=lighting)
    assert an_example(0, "val_indoor", true_lighting=lighting).true_lighting is not None


@pytest.mark.parametrize(
    "changes",
    [
        {"key": "a.b"},
        {"key": ""},
        {"background": np.zeros((135, 192, 3), np.uint8)},
        {"spheres": {}},
        {"frame": -1},
        {"scene": "underwater"},
        {"split": "val_outdoor", "scene": "indoor"},
        {"split": "holdout"},
        {"place": ""},
    ],
)
def test_what_is_no_example_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(DataSetError):
        an_example(0, "train", **changes)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_true_lighting_is_finite_and_not_negative(value: float) -> None:
    lighting = np.ones((32, 32, 3), np.float32)
    lighting[4, 4, 1] = value
    with pytest.raises(DataSetError, match="true lighting"):
        an_example(0, "val_indoor", true_lighting=lighting)


def test_an_example_is_frozen_and_keeps_no_reference() -> None:
    background = np.zeros((192, 135, 3), np.uint8)
    example = an_example(0, background=background)
    background[:] = 9
    assert example.background.max() == 0
    with pytest.raises(ValueError, match="read-only"):
        example.background[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        example.key = "other"  # type: ignore[misc]


def test_members_round_trip() -> None:
    example = an_example(5, "unseen_outdoor")
    again = from_members(example.key, to_members(example))
    assert again.meta == example.meta
    for name in SPHERES:
        np.testing.assert_array_equal(again.spheres[name], example.spheres[name])
    np.testing.assert_array_equal(again.true_lighting, example.true_lighting)


def test_the_cameras_jpeg_is_stored_as_it_is() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (192, 135, 3), np.uint8)
    jpeg = encode_jpeg(noise, 60)
    example = an_example(0, background=decode_rgb(jpeg), background_jpeg=jpeg)
    members = to_members(example)
    assert members["background.jpg"] == jpeg
    again = from_members(example.key, members)
    np.testing.assert_array_equal(again.background, example.background)


def test_without_the_jpeg_the_background_is_compressed_again() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (192, 135, 3), np.uint8)
    example = an_example(0, background=decode_rgb(encode_jpeg(noise, 60)))
    again = from_members(example.key, to_members(example))
    assert (again.background != example.background).any()


def test_unknown_metadata_is_refused() -> None:
    values = an_example(0).meta.to_dict()
    assert ExampleMeta.from_dict(values) == an_example(0).meta
    with pytest.raises(DataSetError, match="colour"):
        ExampleMeta.from_dict({**values, "colour": "red"})
    del values["place"]
    with pytest.raises(DataSetError, match="place"):
        ExampleMeta.from_dict(values)


# -- splits ------------------------------------------------------------------------------------


def test_finishing_refuses_a_leak_between_splits(tmp_path: Path) -> None:
    jobs = plan_split("train", 1) + plan_split("val_indoor", 1)
    plan = ShardPlan.begin(tmp_path, jobs, RIGS, {})
    for job in plan.missing():
        plan.write(job, [an_example(0, job.split, place="one room")])
    with pytest.raises(DataSetError, match="one room"):
        plan.finish()
    assert not (tmp_path / "manifest.json").exists()


# -- shards ------------------------------------------------------------------------------------


def test_every_example_is_read_back_in_order(folder: Path) -> None:
    data = open_dataset(folder)
    numbers = [0, 1, 2, 4, 5, 6]  # 3 was skipped
    keys = [f"train-{number:06d}" for number in numbers]
    index = data.index("train")
    assert [example.key for example in data.examples("train")] == keys == list(index.keys)
    for at, number in enumerate(numbers):
        example, wanted = index[at], an_example(number)
        assert example.meta == wanted.meta
        np.testing.assert_array_equal(example.spheres["diffuse"], wanted.spheres["diffuse"])
        background, spheres = index.pixels(at)
        np.testing.assert_array_equal(background, example.background)
        np.testing.assert_array_equal(spheres, [example.spheres[name] for name in SPHERES])
    assert index[-1].key == keys[-1]
    with pytest.raises(IndexError):
        index[6]


def test_a_group_joins_its_splits(folder: Path) -> None:
    data = open_dataset(folder)
    index = data.index("val")
    assert list(index.scenes) == ["indoor"] * 2 + ["outdoor"] * 2
    assert index.has_lighting.all()
    assert not data.index("train").has_lighting.any()
    assert data.rigs["paper"].name == "paper"
    with pytest.raises(DataSetError, match="test"):
        data.index("test")


def test_the_manifest_counts(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["version"] == 1
    assert manifest["splits"]["train"]["examples"] == 6
    assert manifest["splits"]["train"]["places"] == {
        f"train-place-{i}": n for i, n in enumerate((2, 2, 2))
    }
    assert manifest["skipped"] == [{"file": "broken.exr", "reason": "cut short"}]
    assert manifest["licences"] == {"BSD": 6, "CC0": 4}
    assert manifest["recipe"] == {"seed": 1, "size": [192, 135]}


def test_the_same_examples_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    assert contents(make(tmp_path / "again")) == contents(folder)


def test_other_pixels_give_other_bytes(folder: Path, tmp_path: Path) -> None:
    plan = begin(tmp_path)
    job = plan.jobs[0]
    plan.write(job, (an_example(number + 1) for number in range(3)))
    assert (tmp_path / job.file).read_bytes() != (folder / job.file).read_bytes()


def test_a_shard_is_a_webdataset_tar(folder: Path) -> None:
    """Neighbouring members whose names agree up to the first dot are one sample."""
    samples: dict[str, list[str]] = {}
    with tarfile.open(folder / "val_indoor-000000.tar") as tar:
        for member in tar:
            key, suffix = member.name.split(".", 1)
            assert key == next(reversed(samples), key) or key not in samples
            samples.setdefault(key, []).append(suffix)
            assert member.isfile()
            assert (member.mtime, member.uid, member.gid, member.uname) == (0, 0, 0, "")
    suffixes = [
        "background.jpg",
        "mirror.png",
        "matte_silver.png",
        "diffuse.png",
        "json",
        "lighting.npy",
    ]
    assert samples == {"val_indoor-000000": suffixes, "val_indoor-000001": suffixes}


@pytest.mark.parametrize(
    "items",
    [
        [an_example(0, "val_indoor")],
        [an_example(0), an_example(1, key="train-000000")],
    ],
    ids=["other split", "same key"],
)
def test_a_shard_refuses(items: list[Example], tmp_path: Path) -> None:
    plan = begin(tmp_path)
    with pytest.raises(DataSetError):
        plan.write(plan.jobs[0], items)
    assert sorted(contents(tmp_path)) == ["plan.json"]


# -- kills, resumes, damage --------------------------------------------------------------------


def test_a_killed_run_goes_on_to_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    def until_killed(job: ShardJob) -> Iterator[Example | Skipped]:
        for count, item in enumerate(examples_of(job)):
            if count == 1:
                raise KeyboardInterrupt
            yield item

    plan = begin(tmp_path)
    first, second, *_ = plan.missing()
    plan.write(first, examples_of(first))
    with pytest.raises(KeyboardInterrupt):
        plan.write(second, until_killed(second))
    # What kill -9 leaves: a temporary tar, and a tar whose index was not written yet.
    left = f".train-000001.dl-{atomic._where()}-{2**22 + 1:x}-0badcafe.tar"  # of no process
    (tmp_path / left).write_bytes(b"half a shard")
    atomic._remove_leftovers.cache_clear()
    (tmp_path / second.file).write_bytes(b"whole, but nothing vouches for it")
    with pytest.raises(DataSetError, match="unfinished"):
        open_dataset(tmp_path)

    resumed = begin(tmp_path)
    assert resumed.missing() == plan.jobs[1:]
    assert make(tmp_path) == tmp_path
    assert contents(tmp_path) == contents(folder)


def test_finishing_early_is_refused(tmp_path: Path) -> None:
    plan = begin(tmp_path)
    plan.write(plan.jobs[0], examples_of(plan.jobs[0]))
    with pytest.raises(DataSetError, match="4 of them missing"):
        ShardPlan.open(tmp_path).finish()


def test_a_folder_of_another_plan_is_refused(folder: Path) -> None:
    with pytest.raises(DataSetError, match="other recipe"):
        ShardPlan.begin(folder, begin(folder).jobs, RIGS, {"seed": 2})


def damage_a_byte(folder: Path) -> None:
    path = folder / "train-000001.tar"
    content = bytearray(path.read_bytes())
    content[2000] ^= 1
    path.write_bytes(content)


def damage_the_index(folder: Path) -> None:
    path = folder / "train-000001.json"
    path.write_text(path.read_text().replace("[512,", "[513,").replace("[512, ", "[513, "))


def damage_nothing(folder: Path) -> None:
    path = folder / "train-000001.tar"
    path.write_bytes(path.read_bytes())


@pytest.mark.parametrize("damage", [damage_a_byte, damage_the_index])
def test_damage_is_found(damage: object, tmp_path: Path) -> None:
    data = open_dataset(make(tmp_path))
    damage(tmp_path)
    with pytest.raises(DataSetError, match="train-000001"):
        data.verify()


def test_a_rewritten_file_is_not_damage(tmp_path: Path) -> None:
    data = open_dataset(make(tmp_path))
    damage_nothing(tmp_path)
    data.verify()


def test_a_damaged_picture_names_its_example(tmp_path: Path) -> None:
    make(tmp_path)
    path = tmp_path / "train-000000.tar"
    content = path.read_bytes()
    path.write_bytes(content.replace(b"\x89PNG", b"\x89GNP"))
    with pytest.raises(DataSetError, match=r"train-000000\.mirror\.png"):
        open_dataset(tmp_path).index("train")[0]


def test_a_cut_shard_is_found_on_opening(tmp_path: Path) -> None:
    make(tmp_path)
    path = tmp_path / "train-000000.tar"
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(DataSetError, match="train-000000"):
        open_dataset(tmp_path)
    assert begin(tmp_path).missing() == (begin(tmp_path).jobs[0],)


def test_hdr_smuggled_into_training_is_found(tmp_path: Path) -> None:
    data = open_dataset(make(tmp_path))
    shards = data.manifest.splits
    smuggled = {"train": shards["val_indoor"]}
    leaky = dataclasses.replace(data.manifest, splits=smuggled)
    index = json.loads((tmp_path / "val_indoor-000000.json").read_text())
    (tmp_path / "val_indoor-000000.json").write_text(json.dumps({**index, "split": "train"}))
    with pytest.raises(DataSetError, match="8-bit spheres only"):
        dataclasses.replace(data, manifest=leaky).verify()


def test_where_there_is_no_data_set_the_message_says_how_to_make_one(tmp_path: Path) -> None:
    for missing in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(DataSetError, match="deeplight simulate"):
            open_dataset(missing)


def test_another_version_is_refused(tmp_path: Path) -> None:
    path = make(tmp_path) / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "version": 99}))
    with pytest.raises(DataSetError, match="version 99"):
        open_dataset(tmp_path)
    path.write_text("{")
    with pytest.raises(DataSetError, match="JSON"):
        open_dataset(tmp_path)


def test_an_index_travels_to_worker_processes(folder: Path) -> None:
    index = open_dataset(folder).index("train")
    first = index[0]  # the shard is mapped now; a map cannot be pickled
    again = pickle.loads(pickle.dumps(index))
    np.testing.assert_array_equal(again[0].background, first.background)
