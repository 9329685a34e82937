"""From a folder of panoramas to a data set: whole, resumed, in parallel, with broken files."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.dataset import open_dataset
from deeplight.errors import ConfigError, DataSetError
from deeplight.io.radiance import write_exr
from deeplight.jobs import Engine
from deeplight.mappings import latlong
from deeplight.simulate.run import Recipe, plan, simulate

RECIPE = Recipe(train_takes=2, eval_takes=1, seen_takes=1, frames=2, shard_takes=2)


RECIPE_V1 = [
    [[89.44, 92.63, 93.85], [95.42, 94.48, 89.96], [98.67, 98.6, 95.24], [82.85, 83.81, 82.69]],
    [[99.6, 103.0, 104.28], [86.87, 89.03, 89.17], [105.07, 107.55, 107.44], [96.0, 98.68, 99.19]],
    [
        [99.59, 104.54, 103.92],
        [119.67, 123.99, 121.09],
        [122.28, 127.5, 126.45],
        [102.54, 108.01, 108.63],
    ],
    [
        [105.76, 108.04, 108.14],
        [108.72, 108.97, 106.8],
        [120.17, 121.03, 119.57],
        [104.95, 106.46, 106.2],
    ],
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three training places (one broken), a validation and a test place."""
    hdri = tmp_path_factory.mktemp("hdri")
    rows = ["file,split,place,scene,licence"]
    directions = latlong.directions(64, 128)
    for number, split in enumerate(("train", "train", "train", "val", "test")):
        sun = np.exp(40 * (directions @ np.roll([0.6, 0.64, -0.48], number) - 1))[..., None]
        ground = 0.2 + (directions[..., 1:2] > 0) * np.array([0.3, 0.4, 0.6])
        write_exr(hdri / f"p{number}.exr", (ground + 30 * sun).astype(np.float32))
        rows.append(f"p{number}.exr,{split},venue{number},outdoor,CC0")
    (hdri / "p1.exr").write_bytes((hdri / "p1.exr").read_bytes()[:400])
    (hdri / "manifest.csv").write_text("\n".join(rows))
    return hdri


@pytest.fixture(scope="module")
def whole(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What one process makes without a break."""
    out = tmp_path_factory.mktemp("whole") / "data"
    shards, simulation = plan(folder, out, RECIPE)
    simulate(shards, simulation, engine=Engine(workers=1))
    return out


def digests(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.glob("*.*"))}


def test_a_run_makes_every_split_and_lists_what_it_skipped(whole: Path) -> None:
    data = open_dataset(whole)
    manifest = data.manifest
    assert manifest.examples("train") == 8  # two takes of two frames in each place that opens
    assert set(manifest.places("train")) == {"venue0", "venue2"}
    assert [item.file for item in manifest.skipped] == ["p1.exr"]
    assert all(example.true_lighting is None for example in data.examples("train"))
    held_out = list(data.examples("unseen_outdoor"))
    assert {example.meta.place for example in held_out} == {"venue4"}
    assert all(example.true_lighting is not None for example in held_out)


def mean_colours(folder: Path) -> np.ndarray:
    """Of the first photo of every split and of its crops, (splits, 4, 3), in grey levels."""
    data = open_dataset(folder)
    firsts = [next(iter(data.examples(split))) for split in data.splits]
    pictures = [[e.background, *(e.spheres[name] for name in sorted(e.spheres))] for e in firsts]
    return np.array([[picture.mean((0, 1)) for picture in of_one] for of_one in pictures])


def test_recipe_v1_stays_what_it_was(folder: Path, whole: Path, tmp_path: Path) -> None:
    """The numbers were made before recipe v2 was added; v1 is what old results were made with.

    Means, not bytes: sums of matrix products, and with them single grey levels, differ from one
    kind of processor to another.
    """
    np.testing.assert_allclose(mean_colours(whole), RECIPE_V1, atol=0.05)
    shards, simulation = plan(folder, tmp_path / "v2", replace(RECIPE, phones="v2"))
    simulate(shards, simulation, engine=Engine(workers=1))
    assert np.abs(mean_colours(tmp_path / "v2") - RECIPE_V1).max() > 1


def test_v2_keeps_one_camera_for_test(folder: Path, tmp_path: Path) -> None:
    """Test takes come in pairs that are held alike; the kept camera is nowhere else."""
    recipe = replace(RECIPE, phones="v2", eval_takes=2)
    shards, simulation = plan(folder, tmp_path / "v2", recipe)
    simulate(shards, simulation, engine=Engine(workers=1))
    data = open_dataset(tmp_path / "v2")
    for split in set(data.splits) - {"unseen_outdoor"}:
        assert {e.meta.camera for e in data.examples(split)} <= {"family"}, split
    test = list(data.examples("unseen_outdoor"))
    assert [e.meta.camera for e in test] == ["family", "family", "kept", "kept"]
    for one, other in zip(test[:2], test[2:], strict=True):
        details, others = one.meta.details, other.meta.details
        assert details["world_from_camera"] == others["world_from_camera"]
        assert details["height"] == others["height"]
        assert details["vertical_fov_rad"] != others["vertical_fov_rad"]


def test_killed_in_the_middle_it_goes_on_to_the_same_bytes(
    folder: Path, whole: Path, tmp_path: Path
) -> None:
    broken, simulation = plan(folder, tmp_path / "broken", RECIPE)

    def kill(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(broken, simulation, engine=Engine(workers=1), progress=kill)
    assert len(broken.missing()) == len(broken.jobs) - 1
    again, simulation = plan(folder, tmp_path / "broken", RECIPE)
    simulate(again, simulation, engine=Engine(workers=1))
    assert digests(whole) == digests(tmp_path / "broken")


def test_processes_change_nothing(folder: Path, whole: Path, tmp_path: Path) -> None:
    shards, simulation = plan(folder, tmp_path / "two", RECIPE)
    simulate(shards, simulation, Engine(workers=2))
    assert digests(whole) == digests(tmp_path / "two")


def test_another_seed_films_something_else(folder: Path, whole: Path, tmp_path: Path) -> None:
    shards, simulation = plan(folder, tmp_path / "other", replace(RECIPE, seed=1))
    shards.write(shards.jobs[0], simulation.examples(shards.jobs[0]))
    file = shards.jobs[0].file
    assert digests(whole)[file] != digests(tmp_path / "other")[file]


def test_another_recipe_needs_another_folder(folder: Path, tmp_path: Path) -> None:
    plan(folder, tmp_path / "data", RECIPE)
    with pytest.raises(DataSetError, match="recipe"):
        plan(folder, tmp_path / "data", Recipe(seed=9))


def test_impossible_recipes_are_refused() -> None:
    with pytest.raises(ConfigError):
        Recipe(phone="brick")
    with pytest.raises(ConfigError):
        Recipe(frames=0)
    with pytest.raises(ConfigError, match="v1 or v2"):
        Recipe(phones="v3")
    with pytest.raises(ConfigError, match="drop one"):
        Recipe(phone="wide", phones="v2")


def test_the_command_films_and_draws_a_contact_sheet(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "data"
    words = ["simulate", "--hdri", str(folder), "--out", str(out), "--workers", "1"]
    words += ["--recipe.train-takes", "1", "--recipe.frames", "1", "--recipe.eval-takes", "1"]
    assert main(words) == 2  # of one file
    assert (out / "contact_sheet.png").stat().st_size > 1000
    printed = capsys.readouterr()
    assert "skipped p1.exr" in printed.out
    assert "1 that cannot be used, named above; the others are done" in printed.err


def test_a_missing_folder_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "--hdri", str(tmp_path / "no"), "--out", str(tmp_path / "data")]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "folder of HDR panoramas" in error
    assert not (tmp_path / "data").exists()


def test_a_place_may_have_any_name_that_a_disk_holds(folder: Path, tmp_path: Path) -> None:
    hdri, recipe = tmp_path / "hdri", Recipe(train_takes=1, eval_takes=1, seen_takes=0, frames=1)
    hdri.mkdir()
    for name in ("n\udcff.exr", "z" * 251 + ".exr"):
        (hdri / name).write_bytes((folder / "p0.exr").read_bytes())
    shards, simulation = plan(hdri, tmp_path / "data", recipe)
    manifest = simulate(shards, simulation, engine=Engine(workers=1))
    assert sum(manifest.examples(split) for split in manifest.splits) >= 2
    assert not manifest.skipped
