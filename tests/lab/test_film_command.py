"""`python -m lab.film`: clips and truth that agree, resumed, with broken panoramas."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import run_command
from deeplight.io.radiance import write_exr
from deeplight.io.video import facts, video_frames
from deeplight.mappings import latlong
from deeplight.sphere import SPHERES

pytestmark = pytest.mark.needs("av")


WORDS = (
    "--film.size 96 --film.seconds 0.14 --film.clips 4 --film.no-vary-rig "
    "--film.troubles variable_rate dropped_frames"
).split()


def film(words: list[str]) -> int:
    return run_command("python -m lab.film", "lab.film.__main__", words)


@pytest.fixture(scope="module")
def hdri(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two test places, one of them broken, and one whose ground is made up."""
    folder = tmp_path_factory.mktemp("hdri")
    directions = latlong.directions(64, 128)
    sun = np.exp(40 * (directions @ np.array([0.6, 0.64, -0.48]) - 1))[..., None]
    for name in ("good", "broken", "sky"):
        write_exr(folder / f"{name}.exr", (0.3 + 30 * sun + 0 * directions).astype(np.float32))
    (folder / "broken.exr").write_bytes((folder / "broken.exr").read_bytes()[:300])
    rows = "file,split,place,scene,synthetic_ground\ngood.exr,test,good,outdoor,\n"
    rows += "broken.exr,test,broken,indoor,\nsky.exr,test,sky,outdoor,true\n"
    (folder / "manifest.csv").write_text(rows)
    return folder


@pytest.fixture(scope="module")
def films(hdri: Path) -> Path:
    out = hdri.parent / f"{hdri.name}-films"
    assert film(["--hdri", str(hdri), "--out", str(out), *WORDS]) == 0
    return out


def digests(folder: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("clips/*"))
    }


def test_truth_and_film_tell_the_same(films: Path) -> None:
    clips = sorted(films.glob("clips/*.mp4"))
    assert len(clips) == 2  # every other clip would be in the broken place
    assert "broken" in json.loads((films / "skipped.json").read_text())[0]["file"]
    for clip in clips:
        truth = json.loads(clip.with_suffix(".truth.json").read_text())
        shown = [frame for frame in truth["frames"] if not frame["dropped"]]
        got = list(video_frames(clip))
        assert len(got) == len(shown)
        times = [frame["time_s"] for frame in shown]
        np.testing.assert_allclose([still.time_s for still in got], times, atol=2e-5)
        known = facts(clip)
        assert (known.width, known.height) == (truth["camera"]["width"], truth["camera"]["height"])
        with np.load(clip.with_suffix(".truth.npz"), allow_pickle=False) as arrays:
            assert arrays["crops"].shape == (len(truth["frames"]), 3, 32, 32, 3)
            assert arrays["true_lighting"].shape[1:] == (32, 32, 3)
        assert truth["place"] == "good"
        assert set(truth["rig"]["spheres"]) == set(SPHERES)


def test_the_filmed_sphere_is_where_the_truth_says(films: Path) -> None:
    """The true crop's colour is found at the true place, and not next to it."""
    clip = sorted(films.glob("clips/*.mp4"))[0]
    truth = json.loads(clip.with_suffix(".truth.json").read_text())
    picture = next(video_frames(clip)).rgb().astype(float)
    with np.load(clip.with_suffix(".truth.npz"), allow_pickle=False) as arrays:
        crop = arrays["crops"][0, SPHERES.index("diffuse")].astype(float)
    ellipse = truth["rig"]["spheres"]["diffuse"]["ellipse_px"]
    column, row = (round(place) for place in ellipse["centre"])
    near = picture[row - 3 : row + 4, column - 3 : column + 4].mean((0, 1))
    assert np.abs(near - crop[12:20, 12:20].mean((0, 1))).max() < 8
    minor = round(ellipse["axes"][1])
    outside = picture[row - minor - 6 : row - minor - 3, column - 3 : column + 4].mean((0, 1))
    assert np.abs(outside - near).max() > 12


def test_what_is_missing_is_made_again_byte_for_byte(films: Path, hdri: Path) -> None:
    before = digests(films)
    first = sorted(films.glob("clips/*.truth.json"))[0]
    first.unlink()  # killed between the film and its truth
    kept = sorted(films.glob("clips/*.mp4"))[1]
    written = kept.stat().st_mtime_ns
    assert film(["--hdri", str(hdri), "--out", str(films), *WORDS]) == 0
    assert digests(films) == before
    assert kept.stat().st_mtime_ns == written


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--film.seed 9", "recipe"),
        ("--film.troubles quake", "quake"),
        ("--film.size 97", "even"),
        ("--film.clips 0", "film.clips"),
        ("--film.phone brick", "brick"),
        ("--film.seconds nan", "600 s"),
    ],
)
def test_impossible_settings_are_one_line(films, hdri, capfd, words, message) -> None:
    assert film(["--hdri", str(hdri), "--out", str(films), *WORDS, *words.split()]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert message in line


@pytest.mark.parametrize("split", ["train", "test"])
def test_nothing_to_film_leaves_nothing(tmp_path, hdri, capfd, split) -> None:
    folder = tmp_path / "hdri"
    folder.mkdir()
    (folder / "broken.exr").write_bytes((hdri / "broken.exr").read_bytes())
    (folder / "manifest.csv").write_text("file,split,place,scene\nbroken.exr,test,a,indoor\n")
    out = tmp_path / "out"
    words = ["--hdri", str(folder), "--out", str(out), *WORDS, "--film.split", split]
    assert film([*words]) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert not out.exists()
