"""The comparison of two checkouts' files: bytes, values where bytes differ, and files missing."""

import json
from pathlib import Path

import pytest

from lab.evidence.same_bytes import few_panoramas, row_of_files, row_of_means


def test_files_are_alike_by_bytes_or_by_what_they_hold(tmp_path: Path) -> None:
    written = {"a.hdr": ("x", "x"), "b.hdr": ("x", "y"), "losses.csv": ("10", "20"), "c.js": ("x",)}
    for name, contents in written.items():
        for folder, content in zip(("here", "other"), contents, strict=False):
            (tmp_path / folder).mkdir(exist_ok=True)
            rows = f"step,loss,images_per_second\n1,0.5,{content}\n"
            (tmp_path / folder / name).write_text(rows if name == "losses.csv" else content)
    here, other = (sorted((tmp_path / folder).iterdir()) for folder in ("here", "other"))
    assert row_of_files("some", here, other) == "| some | 3 | 1 | 2 | 1 .hdr, only one has c.js |"
    (tmp_path / "other" / "losses.csv").write_text("step,loss,images_per_second\n1,0.6,20\n")
    assert "| 3 | 1 | 1 | 1 .hdr, 1 loss .csv," in row_of_files("some", here, other)  # the twin


def test_means_that_differ_are_named_with_how_far(tmp_path: Path) -> None:
    for folder, value in (("here", 0.1), ("other", 0.2)):
        (tmp_path / folder).mkdir()
        keys = [("own", "l1", 0.3), ("own", "l2", None), ("mean", "l1", value)]
        summary = [
            {"estimator": name, "scene": "both", "metric": metric, "mean": {"value": mean}}
            for name, metric, mean in keys
        ]
        (tmp_path / folder / "results.json").write_text(json.dumps({"summary": summary}))
    row = row_of_means(tmp_path / "here", tmp_path / "other")
    assert row == "| means of 2 estimators | 2 | | 1 | mean by 0.1 |"


@pytest.mark.parametrize("places", [1, 2])
def test_panoramas_of_every_split_and_scene_are_taken(tmp_path: Path, places: int) -> None:
    hdri = tmp_path / "hdri"
    hdri.mkdir()
    lines = ["file,split,place,scene,synthetic_ground"]
    for split in ("train", "val", "test"):
        for scene in ("indoor", "outdoor"):
            for number in range(3):
                name = f"{split}-{scene}-{number}"
                (hdri / f"{name}.exr").touch()
                lines.append(f"{name}.exr,{split},{name},{scene},{str(number == 0).lower()}")
    (hdri / "manifest.csv").write_text("\n".join(lines) + "\n")
    few = few_panoramas(hdri, tmp_path / "few", places)
    assert len(list(few.glob("*.exr"))) == 6 * places
    assert not list(few.glob("*-0.exr"))  # their ground is made up
    assert (few / "manifest.csv").read_text().count("\n") == 1 + 6 * places
