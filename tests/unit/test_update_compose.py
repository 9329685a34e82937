"""The numbers of docs/compose.md come from one run with the shipped weights."""

from hashlib import sha256
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from scripts import loaded

NAMES = ("deeplight", "mean_spheres", "khan_2006")
OBJECT = {"deeplight": 0.1, "mean_spheres": 0.12, "khan_2006": 0.3}


@pytest.fixture(scope="module")
def script(root: Path) -> ModuleType:
    return loaded(root / "lab" / "evidence" / "update_compose.py")


@pytest.fixture
def project(script: ModuleType, tmp_path: Path) -> Path:
    """A document, weights, and a run of six photos; in the shade the constant light wins."""
    tables = script.sys.modules["lab.evidence.compose_evidence_tables"]
    rows = []
    for number, kind in enumerate(("indoor", "shade", "sun") * 2):
        for material in tables.MATERIALS:
            for name in (*NAMES, tables.AGAIN, tables.UNSHADOWED):
                value = OBJECT.get(name, 0.01) + 0.002 * number
                if (kind, name) == ("shade", "mean_spheres"):
                    value = 0.05
                side = 120.0 if (kind, name) == ("indoor", "deeplight") else 20.0
                numbers = (value, 0.06, 0.05, 0.5, side, 30.0, 40.0, 0.25)
                rows.append(tables.Row(f"k{number}", f"p{number}", kind, material, name, *numbers))
    run = tmp_path / "run"
    run.mkdir()
    tables.write_tables(run, rows, list(NAMES))
    for name in script.PICTURES:
        Image.fromarray(np.zeros((20, 2000, 3), np.uint8)).save(run / name)
    weights = tmp_path / script.WEIGHTS
    weights.parent.mkdir(parents=True)
    weights.write_bytes(b"weights")
    model = sha256(b"weights").hexdigest()
    (run / "run.toml").write_text(f'[run_facts]\nmodel = "{model}"\n')
    (tmp_path / "docs" / "pictures").mkdir(parents=True)
    (tmp_path / script.DOCUMENT).write_text(
        "Before.\n<!-- results: compose -->\nold\n<!-- results end -->\nAfter.\n"
    )
    return tmp_path


def test_tables_sentences_and_pictures_are_the_runs(script: ModuleType, project: Path) -> None:
    written = script.main(project / "run", project)
    text = (project / script.DOCUMENT).read_text()
    assert text.startswith("Before.\n")
    assert text.endswith("After.\n")
    assert "\nold\n" not in text
    assert "6 photos in 6 places: 2 indoors, 2 in shade, 2 in the sun." in text
    assert "| khan 2006 | 0.305 (" in text
    plain = " ".join(text.split())
    assert "object, diffuse: nearer to the truth than under khan 2006, the whole interval" in plain
    assert "object, diffuse, shade (2 photos): better than the model (0.105): mean spheres" in plain
    assert "k0 (indoor; diffuse and silver): the true light stands 40 degrees high" in plain
    assert Image.open(written[1]).size == (1800, 18)


def test_sentences_follow_the_rows(script: ModuleType, project: Path) -> None:
    """A model that is worse everywhere is said to be so."""
    path = project / "run" / "errors.csv"
    swapped = path.read_text().replace(",deeplight,", ",x,").replace(",khan_2006,", ",deeplight,")
    path.write_text(swapped.replace(",x,", ",khan_2006,"))
    found = script.Evidence(script.read_rows(project / "run"))
    found.names.sort(key=NAMES.index)
    assert "object, silver: not nearer than under mean spheres and khan 2006" in script.sentences(
        found
    )


def test_a_run_of_other_weights_is_refused(script: ModuleType, project: Path) -> None:
    (project / script.WEIGHTS).write_bytes(b"newer weights")
    before = (project / script.DOCUMENT).read_text()
    with pytest.raises(script.RefusedError, match="other weights"):
        script.main(project / "run", project)
    assert (project / script.DOCUMENT).read_text() == before


def test_an_old_table_is_refused(script: ModuleType, project: Path) -> None:
    path = project / "run" / "errors.csv"
    path.write_text(path.read_text().replace("power", "share"))
    with pytest.raises(ValueError, match="other columns"):
        script.read_rows(project / "run")
