"""Simulated clips through the whole program: capture, train, evaluate; on any engine."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main, run_command
from deeplight.dataset import open_dataset
from deeplight.io.radiance import write_exr

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

FILM = ["--film.clips", "2", "--film.seconds", "1", "--film.size", "360", "--film.seed", "3"]


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A training and a validation clip, filmed in two made-up rooms."""
    folder = tmp_path_factory.mktemp("film")
    rng = np.random.default_rng(0)
    for name in ("hall", "park"):
        coarse = rng.lognormal(-1.5, 0.8, (32, 64, 3)).repeat(8, 0).repeat(8, 1)
        coarse[40:60, 100:140] = 20.0
        write_exr(folder / f"{name}.exr", coarse.astype(np.float32))
    (folder / "manifest.csv").write_text(
        "file,split,place,scene,licence\nhall.exr,train,hall,indoor,CC0\n"
        "park.exr,val,park,outdoor,CC0\n"
    )
    words = ["--hdri", str(folder), "--out", str(folder / "films")]
    assert run_command("python -m lab.film", "lab.film.__main__", [*words, *FILM]) == 0
    return folder / "films" / "clips"


def test_film_capture_train_evaluate(
    clips: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    out, run = tmp_path / "data", tmp_path / "run"
    assert main(["capture", str(clips), "--out", str(out), "--workers", "1"]) == 0
    data = open_dataset(out)
    data.verify()
    assert set(data.splits) == {"train", "val_outdoor"}
    assert data.index("val").has_lighting.any()
    words = ["train", "--data", str(out), "--out", str(run), "--preset", "small"]
    for setting in (
        "schedule.steps=2",
        "schedule.batch_size=2",
        "data.workers=0",
        'data.validation_splits=["val_outdoor"]',
        "run.validate_every=2",
        "run.constant_steps=5",
        "run.accelerator=cpu",
    ):
        words += ["--set", setting]
    model = tmp_path / "model.onnx"
    assert main([*words, "--export", str(model)]) == 0
    lines = capsys.readouterr().out.splitlines()[-2:]
    assert lines == [f"{run}: best at step 2; look at {run / 'curves.png'}", f"wrote {model}"]
    assert (run / "curves.png").is_file()
    results = tmp_path / "results"
    words = ["evaluate", "--data", str(out), "--split", "val", "--model", str(model)]
    assert main([*words, "--out", str(results)]) == 0
    assert (results / "results.json").stat().st_size > 100


def test_engines_and_workers_change_no_byte(clips: Path, tmp_path: Path) -> None:
    pytest.importorskip("ray")
    found = []
    for n, words in enumerate((["--workers", "1"], ["--workers", "2"], ["--engine", "ray"])):
        out = tmp_path / str(n)
        assert main(["capture", str(clips), "--out", str(out), *words]) == 0
        files = sorted(path for path in out.rglob("*") if path.is_file())
        found.append({p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files})
    assert found[0] == found[1] == found[2]
    assert len(found[0]) >= 9
