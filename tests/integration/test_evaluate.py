"""`deeplight evaluate` from a data set to tables and files."""

import csv
import json
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeplight.camera_response import encode, soft_clip
from deeplight.cli import evaluate as command
from deeplight.dataset import (
    DataSet,
    Example,
    ExampleMeta,
    ShardJob,
    add_bases,
    open_dataset,
)
from deeplight.errors import ConfigError, DataSetError
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate import run as measuring
from deeplight.evaluate import scores as scoring
from deeplight.evaluate.baselines.baseline import ConstantLighting
from deeplight.evaluate.baselines.suite import CACHE, baselines_for
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.figures.spheres import answer_column, filmed_column
from deeplight.evaluate.leaderboard import read_leaderboard
from deeplight.evaluate.panorama_estimates import panorama_estimates
from deeplight.frames import world_from_camera
from deeplight.io.basis_file import save_bases
from deeplight.io.photos import decode_rgb, encode_jpeg
from deeplight.io.radiance import write_exr
from deeplight.reflectance import ReflectanceBasis, analytic_basis, rig_bases
from deeplight.solve import SphereCounts, solve_constant
from deeplight.sphere import PAPER_RIG
from toy_data import write_toy_data

SPLITS = {"train": 10, "seen_indoor": 4, "val_indoor": 9, "val_outdoor": 6}


def brightness_of(number: int) -> int:
    """The pixel value all over an example's photo."""
    return 20 + 2 * number


def log_light(brightness: int) -> np.ndarray:
    """The only light of an example: uniform grey, given by the photo's pixel value."""
    return np.full((32, 32, 3), np.log(brightness / 100), np.float32)


def examples_of(job: ShardJob) -> Iterator[Example]:
    kind = "home" if job.split in ("train", "seen_indoor") else job.split
    scene = "outdoor" if job.split.endswith("outdoor") else "indoor"
    for number in range(job.first, job.first + job.count):
        brightness = brightness_of(number)
        rendered = scoring.rendered_radiance(rig_bases(PAPER_RIG), log_light(brightness)[None])
        spheres = {
            name: np.floor(encode(soft_clip(r[0])) * 255 + 0.5).astype(np.uint8)
            for name, r in rendered.items()
        }
        jpeg = encode_jpeg(np.full((192, 135, 3), brightness, np.uint8))
        meta = ExampleMeta(
            f"{kind}-{number % 3}",
            "t",
            number,
            scene,
            job.split,
            "paper",
            "phone",
            "CC0",
            "test",
            {"world_from_camera": world_from_camera(0.02 * number).tolist()},
        )
        truth = None if job.split == "train" else np.exp(log_light(brightness))
        yield Example(f"{job.split}-{number}", decode_rgb(jpeg), spheres, meta, truth, jpeg)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> DataSet:
    return open_dataset(write_toy_data(tmp_path_factory.mktemp("data"), SPLITS, examples_of))


@pytest.fixture(autouse=True)
def short_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    def fit(pixels: list[SphereCounts], start: np.ndarray) -> np.ndarray:
        return solve_constant(pixels, start, steps=20)

    monkeypatch.setattr("deeplight.evaluate.baselines.suite.solve_constant", fit)


@pytest.fixture(autouse=True)
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Intervals from 40 draws of places; tests/unit/test_bootstrap.py looks at theirs."""

    def few(places: np.ndarray, _: int) -> PlaceBootstrap:
        return PlaceBootstrap(places, 40)

    for module in ("summary", "temporal"):
        monkeypatch.setattr(f"deeplight.evaluate.{module}.PlaceBootstrap", few)


class Knowing(OnnxEstimator):
    """Stands in for the network: reads the light off the photo."""

    sha256 = "0" * 64
    path = Path("model.onnx")

    class contract:  # noqa: N801
        trained_on = "nothing"
        height, width = 192, 135

    def __init__(self, path: Path | None = None) -> None:
        self.batches: list[int] = []

    def estimate_inputs(self, inputs: np.ndarray) -> np.ndarray:
        self.batches.append(len(inputs))
        values = np.round((inputs.mean((1, 2, 3)) + 0.5) * 255).astype(int)
        return np.stack([log_light(value) for value in values])

    def estimate_fully(self, inputs: np.ndarray) -> tuple[Any, ...]:
        return self.estimate_inputs(inputs), [()] * len(inputs), [{}] * len(inputs)


def mean_l1(report: scoring.Report, name: str) -> float:
    l1 = report.scores[name].l1
    return float(np.mean([l1[sphere].mean() for sphere in ("mirror", "diffuse")]))


def test_who_knows_the_light_beats_who_does_not(
    data: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measuring, "BATCH", 8)  # more than one
    knowing = Knowing()
    estimators: Sequence[measuring.BatchEstimator] = [knowing, *baselines_for(data, "val")]
    seen: list[int] = []
    report = measuring.evaluate(estimators, data, "val", progress=seen.append)
    names = ["deeplight", "mean_spheres", "best_constant", "training_mean"]
    names += ["photo_mean", "khan_2006", "nearest_neighbour"]
    assert list(report.scores) == [*names, "true_lighting"]
    assert sum(seen) == len(report.keys) == 15
    assert max(knowing.batches) > 1  # the network is run on batches
    assert mean_l1(report, "true_lighting") < 0.003  # 8-bit rounding
    assert mean_l1(report, "deeplight") < 0.003
    assert mean_l1(report, "best_constant") > 0.03
    assert report.scores["deeplight"].relative_radiance == pytest.approx(0, abs=0.02)
    assert report.keys == data.index("val").keys


def rough(material: str) -> ReflectanceBasis:
    """The basis of a rougher sphere than the analytic one: its light spread over neighbours."""
    basis = analytic_basis(material, PAPER_RIG.views[material])
    weights = basis.weights.reshape(-1, 32, 32)
    blurred = sum(np.roll(weights, (i, j), (1, 2)) for i in (-2, 0, 2) for j in (-2, 0, 2)) / 9
    return ReflectanceBasis(blurred.reshape(basis.weights.shape), basis.view, 32)


def test_measured_spheres_are_scored_and_drawn_as_measured(data: DataSet, tmp_path: Path) -> None:
    """True light renders a rougher silver as it was filmed only with that sphere's basis."""
    silver = rough("matte_silver")
    light = np.log(np.random.default_rng(0).gamma(0.3, 1, (32, 32, 3)) + 0.01).astype(np.float32)

    def filmed(job: ShardJob) -> Iterator[Example]:
        bases = rig_bases(PAPER_RIG) | {"matte_silver": silver}
        for example in examples_of(job):
            shown = scoring.rendered_radiance(bases, light[None])
            spheres = {
                name: np.floor(encode(soft_clip(r[0])) * 255 + 0.5).astype(np.uint8)
                for name, r in shown.items()
            }
            truth = None if job.split == "train" else np.exp(light)
            yield replace(example, spheres=spheres, true_lighting=truth)

    folder = write_toy_data(tmp_path / "data", {"train": 6, "val_indoor": 4}, filmed)
    save_bases(tmp_path / "measured.npz", {"matte_silver": silver}, {})
    analytic = open_dataset(folder)
    measured = analytic.with_bases(tmp_path / "measured.npz")
    assert analytic.bases_sha256 == "analytic"
    add_bases(folder, tmp_path / "measured.npz")
    travelling = open_dataset(folder)
    assert measured.bases_sha256 == travelling.bases_sha256 != "analytic"
    error = {}
    for name, one in (("analytic", analytic), ("measured", measured), ("travels", travelling)):
        own = ConstantLighting("own", light)
        report = measuring.evaluate([own, *baselines_for(one, "val")], one, "val")
        error[name] = report.scores["true_lighting"].l1["matte_silver"].mean()
        shown = answer_column(report, one, 0, "own")
        differs = np.abs(shown.astype(int) - filmed_column(one.index("val")[0], one)).mean()
        assert (differs < 0.3) == (name != "analytic")
    assert error["measured"] == error["travels"] < 0.003
    assert error["analytic"] > 3 * error["measured"]
    best = {one.bases_sha256: baselines_for(one, "val")[1] for one in (analytic, measured)}
    assert np.abs(np.diff([b.log_radiance for b in best.values()], axis=0)).max() > 0.01


def test_the_true_light_ranks_first_against_itself_where_film_clips(tmp_path: Path) -> None:
    """The filmed diffuse sphere is white all over: against it the true light looks too bright."""
    bright = np.full((32, 32, 3), np.log(8.0), np.float32)

    def filmed(job: ShardJob) -> Iterator[Example]:
        for example in examples_of(job):
            spheres = {name: np.full((32, 32, 3), 255, np.uint8) for name in example.spheres}
            yield replace(example, spheres=spheres, true_lighting=np.exp(bright))

    data = open_dataset(write_toy_data(tmp_path, {"val_indoor": 4}, filmed))
    dim = ConstantLighting("dim", np.full((32, 32, 3), np.log(2.9), np.float32))
    report = measuring.evaluate([dim], data, "val")
    columns = {name: scores.metrics() for name, scores in report.scores.items()}
    film, true = (
        {name: column[metric].mean() for name, column in columns.items()}
        for metric in ("radiance_absolute", "true_radiance_absolute")
    )
    assert film["true_lighting"] > 1 > film["dim"]
    assert true["true_lighting"] == pytest.approx(0, abs=1e-6)
    assert true["dim"] == pytest.approx(1 - 2.9 / 8, abs=1e-3)
    np.testing.assert_allclose(columns["dim"]["true_radiance_red"], 2.9 / 8 - 1, rtol=1e-3)


def test_measured_light_takes_the_place_of_what_examples_carry(
    data: DataSet, tmp_path: Path
) -> None:
    """Truth for three of six examples, twice as bright as those say: only they are measured."""
    for number in range(3):
        light = 2 * np.exp(log_light(brightness_of(number))).mean()
        write_exr(tmp_path / f"val_outdoor-{number}.exr", np.full((64, 128, 3), light, np.float32))
    (truth,) = panorama_estimates([f"truth={tmp_path}"])
    report = measuring.evaluate([Knowing()], data, "val_outdoor", truth=truth)
    assert report.keys == tuple(f"val_outdoor-{number}" for number in range(3))
    energy = report.scores["deeplight"].metrics()["energy_stops"]
    assert energy == pytest.approx(-1, abs=0.01)
    assert report.scores["true_lighting"].l1["diffuse"].mean() > 0.05


def test_a_sample_is_spread_over_the_split(data: DataSet) -> None:
    report = measuring.evaluate([Knowing()], data, "val", at_most=10)
    assert len(report.keys) == 10
    assert set(report.scenes) == {"indoor", "outdoor"}


def test_broken_light_is_counted_and_not_averaged(data: DataSet) -> None:
    broken = ConstantLighting("broken", np.full((32, 32, 3), np.nan, np.float32))
    report = measuring.evaluate([broken], data, "val_outdoor")
    assert np.isnan(report.scores["broken"].l1["diffuse"]).all()


@pytest.fixture
def knowing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deeplight.evaluate.models.open_model", Knowing)


@pytest.mark.usefixtures("knowing")
def test_the_command_writes_tables_and_files(
    data: DataSet,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "60")  # a narrow pipe gets all columns
    before = {path: path.read_bytes() for path in data.folder.glob("*.tar")}
    command.run(command.Args(str(data.folder), out=tmp_path / "out"))
    shown = capsys.readouterr().out
    names = ("deeplight", "mean_spheres", "best_constant", "photo_mean", "true_lighting")
    for text in ("val, indoor", "val, outdoor", "θ rgb", "against the true light", *names):
        assert text in shown
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert files == ["pictures", "report.html", "results.csv", "results.json", "run.toml"]
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["data_manifest_sha256"] == data.manifest_sha256
    assert results["splits"] == {"val": {"examples": 15, "places": 6}}
    assert {s["scene"] for s in results["summary"]} == {"indoor", "outdoor", "both"}
    assert {f["estimator"] for f in results["flicker"]["val"]} >= set(names)
    assert results["three_spheres"] == {}
    with (tmp_path / "out" / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 15 * 9
    own = [float(r["l1_diffuse"]) for r in rows if r["estimator"] == "deeplight"]
    both = found(results, "deeplight", "l1_diffuse")
    assert both["mean"]["value"] == pytest.approx(np.mean(own), rel=1e-4)
    assert both["ratio"]["mean_spheres"]["value"] < 0.1
    assert both["difference"]["photo_mean"]["high"] < 0
    run_toml = tomllib.loads((tmp_path / "out" / "run.toml").read_text())
    assert run_toml["settings"]["split"] == "val"
    assert run_toml["run_facts"]["model_sha256"] == "0" * 64
    assert {path: path.read_bytes() for path in data.folder.glob("*.tar")} == before
    assert (data.folder / CACHE).exists()
    check_page((tmp_path / "out" / "report.html").read_text(), names)


def found(results: dict[str, Any], estimator: str, metric: str) -> dict[str, Any]:
    """The summary over indoor and outdoor together."""
    wanted = (estimator, "both", metric)
    return next(
        s for s in results["summary"] if (s["estimator"], s["scene"], s["metric"]) == wanted
    )


def check_page(page: str, names: Sequence[str]) -> None:
    """It needs no other file, and it holds what it must."""
    assert not re.findall(r"(?:src|href)=\"(?!data:|#)[^\"]*", page)
    assert "<script" not in page
    for text in (*names, "paper: L1(m)", "Calibration", "worst places"):
        assert text in page
    assert page.count("<img") >= 6


@pytest.mark.usefixtures("knowing")
def test_several_models_splits_and_other_methods_stand_in_one_report(
    data: DataSet, tmp_path: Path
) -> None:
    """A folder of panoramas that hold the truth scores as the truth does."""
    (tmp_path / "other").mkdir()
    for number in range(SPLITS["val_outdoor"]):
        light = np.exp(log_light(brightness_of(number))).mean()
        panorama = np.full((64, 128, 3), light, np.float32)
        write_exr(tmp_path / "other" / f"val_outdoor-{number}.exr", panorama)
    command.run(
        command.Args(
            str(data.folder),
            split=("val_outdoor", "val"),
            examples=4,
            model=(("first=a.onnx",), ("second=b.onnx",)),
            panoramas=((f"other={tmp_path / 'other'},30",),),
            out=tmp_path / "out",
            three_spheres=True,
        )
    )
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert list(results["models"]) == ["first", "second"]
    # Only what every method answered is compared, so both splits come down to these.
    assert results["splits"]["val_outdoor"]["examples"] == 4
    assert results["splits"]["val"]["examples"] == 4
    other, first = (found(results, name, "l1_diffuse")["mean"] for name in ("other", "first"))
    assert other["value"] < 0.003
    assert first["value"] < 0.003
    assert set(results["three_spheres"]["val"]) == {"as_published", "corrected"}
    assert "three-sphere" in (tmp_path / "out" / "report.html").read_text()
    assert tomllib.loads((tmp_path / "out" / "run.toml").read_text())["settings"]["splits"] == [
        "val_outdoor",
        "val",
    ]


@pytest.mark.usefixtures("knowing")
def test_a_leaderboard_grows_and_catches_numbers_that_do_not_come_again(
    data: DataSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "board.json"
    args = command.Args(str(data.folder), ("val_outdoor",), examples=4, leaderboard=board)
    command.run(args)
    assert "0 verified, 1 added" in capsys.readouterr().out
    written = board.read_bytes()
    command.run(args)
    assert "1 verified, 0 added" in capsys.readouterr().out
    assert board.read_bytes() == written
    command.run(replace(args, split=("val_indoor",)))
    assert [entry.split for entry in read_leaderboard(board)] == ["val_outdoor", "val_indoor"]
    values = json.loads(board.read_text())
    values["entries"][0]["numbers"]["l1_diffuse"][0] *= 0.9
    board.write_text(json.dumps(values))
    with pytest.raises(DataSetError, match=r"l1_diffuse .* where board\.json says"):
        command.run(args)
    board.write_text("{}")
    with pytest.raises(DataSetError, match="a leaderboard in"):
        command.run(args)


@pytest.mark.usefixtures("knowing")
def test_without_true_light_the_report_says_what_it_can(data: DataSet, tmp_path: Path) -> None:
    """As in a real capture; here the training split, which holds none."""
    command.run(command.Args(str(data.folder), ("train",), out=tmp_path / "out", examples=4))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert {s["estimator"] for s in results["summary"]} >= {"deeplight", "photo_mean"}
    assert not {s["metric"] for s in results["summary"]} & {"energy_stops", "direction_deg"}
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Calibration" not in page
    assert "No two neighbouring frames" in page


@pytest.mark.usefixtures("knowing")
def test_a_split_the_data_set_lacks_is_reported(data: DataSet, tmp_path: Path) -> None:
    with pytest.raises(DataSetError, match="test"):
        command.run(command.Args(str(data.folder), ("test",)))
    with pytest.raises(DataSetError, match="choose one of"):
        command.run(command.Args(str(data.folder), ("holdout",)))
    with pytest.raises(ConfigError, match="at least 1 example"):
        command.run(command.Args(str(data.folder), out=tmp_path / "out", examples=0))
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("knowing")
def test_an_out_that_is_a_file_is_refused_before_the_work(data: DataSet, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("not a folder")
    with pytest.raises(FileExistsError):
        command.run(command.Args(str(data.folder), out=tmp_path / "out"))
