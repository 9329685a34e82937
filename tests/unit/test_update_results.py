"""The documents' numbers come from evaluations, and from nothing else."""

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from scripts import loaded

BLOCKS = {
    "README.md": "summary",
    "MODEL_CARD.md": "summary",
    "docs/results.md": "tables",
    "docs/results-full.md": "full tables",
}
DOCUMENTS = tuple(BLOCKS)


@pytest.fixture(scope="module")
def script(root: Path) -> ModuleType:
    return loaded(root / "lab" / "evidence" / "update_results.py")


def row(split: str, estimator: str, scene: str, metric: str, value: float) -> dict[str, Any]:
    number = {"value": value, "low": value - 0.01, "high": value + 0.01}
    ratio = {"training_mean": {"value": 0.5, "low": 0.4, "high": 0.6}}
    names = {"split": split, "estimator": estimator, "scene": scene, "metric": metric}
    return {**names, "mean": number, "ratio": ratio, "examples": 9, "undefined": 1, "places": 3}


@pytest.fixture
def folder(script: ModuleType, tmp_path: Path) -> Path:
    rows = [
        row(split, name, scene, metric, 0.123 if name == "deeplight" else 0.456)
        for split in ("val", "test")
        for name in ("deeplight", "training_mean")
        for scene in script.SCENES
        for metric in script.FORMS
    ]
    found = {"split": "val", "data_manifest_sha256": "abc", "summary": rows}
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.json").write_text(json.dumps(found))
    (tmp_path / "out" / "run.toml").write_text('[run_facts]\ndata_manifest_sha256 = "abc"\n')
    return tmp_path / "out"


@pytest.fixture
def documents(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    for name, block in BLOCKS.items():
        text = (
            f"Before.\n<!-- results: {block} -->\nold 0.999\n<!-- results end -->\nAfter 0.999.\n"
        )
        (tmp_path / name).write_text(text)
    return tmp_path


def test_only_what_is_between_the_markers_changes(
    script: ModuleType, folder: Path, documents: Path
) -> None:
    assert len(script.update([folder], documents)) == 4
    for name in DOCUMENTS:
        text = (documents / name).read_text()
        assert text.startswith("Before.\n<!-- results: ")
        assert text.endswith("<!-- results end -->\nAfter 0.999.\n")
        assert "old" not in text
        assert "0.123" in text
        assert "0.456" in text
    short, full = ((documents / f"docs/results{part}.md").read_text() for part in ("", "-full"))
    assert all("0.123 (0.113 to 0.133)" in text for text in (short, full))
    assert "indoor" in full
    assert "indoor" not in short
    assert "0.50 / 0.50 / 0.50" in (documents / "README.md").read_text()
    assert script.update([folder], documents) == []  # and again nothing


def test_numbers_without_their_run_are_refused(
    script: ModuleType, folder: Path, documents: Path
) -> None:
    before = [(documents / name).read_text() for name in DOCUMENTS]
    (folder / "run.toml").write_text('[run_facts]\ndata_manifest_sha256 = "other"\n')
    with pytest.raises(script.RefusedError, match="other data"):
        script.update([folder], documents)
    (folder / "run.toml").unlink()
    with pytest.raises(script.RefusedError, match=r"no run\.toml"):
        script.update([folder], documents)
    assert [(documents / name).read_text() for name in DOCUMENTS] == before


def test_a_document_without_markers_is_reported_and_none_is_written(
    script: ModuleType, folder: Path, documents: Path
) -> None:
    before = (documents / "README.md").read_text()
    (documents / "docs" / "results.md").write_text("No markers.\n")
    with pytest.raises(script.RefusedError, match="markers"):
        script.update([folder], documents)
    assert (documents / "README.md").read_text() == before


def test_the_documents_have_their_markers(script: ModuleType, root: Path) -> None:
    assert tuple(script.DOCUMENTS) == DOCUMENTS
    for name, block in BLOCKS.items():
        text = (root / name).read_text()
        assert text.count(f"<!-- results: {block} -->") == 1
        assert text.count("<!-- results: ") == text.count("<!-- results end -->")
