"""`deeplight convert`: what comes in, what goes out, and one line for everything that cannot."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.cli.main import main
from deeplight.edit import direction_of
from deeplight.formats.labelled import labelled_environment
from deeplight.harmonics import dominant_light
from deeplight.io.environment_file import load_lighting
from deeplight.io.lighting_file import save_lighting
from deeplight.io.radiance import read_hdr, write_exr, write_hdr
from deeplight.lighting import Lighting
from deeplight.mappings.layouts import cube_from_latlong, probe_from_latlong
from deeplight.mappings.mirror_ball import pixel_directions

HEIGHT = 64


@pytest.fixture(scope="module")
def labelled() -> np.ndarray:
    return labelled_environment(HEIGHT).radiance


@pytest.fixture
def studio(tmp_path: Path, labelled: np.ndarray) -> Path:
    path = tmp_path / "studio.exr"
    write_exr(path, labelled)
    return path


def convert(*words: str | Path) -> int:
    return main(["convert", *map(str, words)])


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("a.exr", {"a.exr"}),
        ("a.hdr", {"a.hdr"}),
        ("a.jpg", {"a.jpg"}),
        ("a.json", {"a.json", "a.exr"}),
        ("a.webxr.json", {"a.webxr.json"}),
        ("a.py", {"a.py", "a.blender.exr"}),
        ("a.js", {"a.js", "a.three.exr"}),
        ("a.py --for unreal", {"a.py", "a.unreal.hdr"}),
    ],
)
def test_the_suffix_gives_the_format(studio, name, written, capsys) -> None:
    out = studio.parent / "out"
    name, *flags = name.split()
    assert convert(studio, "--out", out / name, *flags) == 0
    assert {path.name for path in out.iterdir()} == written
    assert {Path(line).name for line in capsys.readouterr().out.split()} == written


@pytest.mark.parametrize(
    "mapping", ["angular", "cross", "horizontal-cross", "strip", "column", "mirror-ball"]
)
def test_a_picture_in_another_mapping_comes_back(studio, labelled, mapping) -> None:
    there, back = studio.with_name("there.exr"), studio.with_name("back.exr")
    assert convert(studio, "--out", there, "--mapping", mapping) == 0
    flags = ["--in-mapping", mapping] if mapping in ("angular", "mirror-ball") else []
    assert convert(there, "--out", back, "--size", str(HEIGHT), *flags) == 0
    assert np.abs(read_hdr(back) - labelled).mean() < 0.3
    assert np.median(np.abs(read_hdr(back) - labelled)) < 0.02


def test_six_faces_are_written_and_read(studio, labelled) -> None:
    assert convert(studio, "--out", studio.with_name("c.exr"), "--mapping", "cube") == 0
    faces = [studio.with_name(f"c_{face}.exr") for face in ("px", "nx", "py", "ny", "pz", "nz")]
    np.testing.assert_allclose(read_hdr(faces[5]), cube_from_latlong(labelled, 32)[5], rtol=1e-6)
    assert convert(*faces, "--out", studio.with_name("back.exr")) == 0
    back = read_hdr(studio.with_name("back.exr"))
    assert np.median(np.abs(back - labelled)) < 0.02


def test_a_cube_for_three_comes_back_as_one(studio, labelled) -> None:
    there, back = studio.with_name("there.exr"), studio.with_name("back.exr")
    flags = ["--mapping", "strip", "--for", "three"]
    assert convert(studio, "--out", there, *flags) == 0
    assert convert(there, "--out", back, "--from", "three") == 0
    assert np.median(np.abs(read_hdr(back) - labelled)) < 0.02


@pytest.mark.parametrize("tool", ["blender", "three", "mitsuba", "unity", "unreal"])
def test_for_and_from_undo_each_other(studio, labelled, tool) -> None:
    there, back = studio.with_name("there.hdr"), studio.with_name("back.exr")
    assert convert(studio, "--out", there, "--for", tool) == 0
    assert convert(there, "--out", back, "--from", tool) == 0
    np.testing.assert_allclose(read_hdr(back), labelled, rtol=0.02, atol=0.01)


def test_an_exr_of_ours_says_how_it_is_turned(studio, labelled) -> None:
    there, back = studio.with_name("there.exr"), studio.with_name("back.exr")
    assert convert(studio, "--out", there, "--for", "unreal") == 0
    assert convert(there, "--out", back) == 0
    np.testing.assert_array_equal(read_hdr(back), labelled)


def test_a_lighting_file_goes_in(tmp_path) -> None:
    lighting = Lighting(np.exp(pixel_directions(32)).astype(np.float32))
    save_lighting(lighting, tmp_path / "photo")
    assert convert(tmp_path / "photo.json", "--out", tmp_path / "new.json") == 0
    back = load_lighting(tmp_path / "new.json")
    np.testing.assert_allclose(back.power(), lighting.power(), rtol=1e-3)
    assert json.loads((tmp_path / "new.json").read_text())["environment"]["height"] == 256


def test_edits_on_the_command_line(studio, labelled) -> None:
    out = studio.with_name("out.exr")
    flags = "--stops 1 --tint 1 0.5 1 --main-light-to -90 20".split()
    assert convert(studio, "--out", out, *flags) == 0
    light = dominant_light(load_lighting(out))
    assert light.direction @ direction_of(-90, 20) > 0.98
    mean, before = read_hdr(out).mean(axis=(0, 1)), labelled.mean(axis=(0, 1))
    np.testing.assert_allclose(mean, before * [2, 1, 2], rtol=0.25)  # rows are not solid angles


def test_the_test_panorama_needs_no_input(tmp_path) -> None:
    assert convert("--test-panorama", "--out", tmp_path / "test.exr", "--size", "64") == 0
    assert read_hdr(tmp_path / "test.exr").shape == (64, 128, 3)


@pytest.fixture
def broken(tmp_path: Path, labelled: np.ndarray) -> Path:
    """A folder of files that are no light."""
    folder = tmp_path / "in"
    folder.mkdir()
    write_exr(folder / "square.exr", labelled[:, :HEIGHT])
    write_exr(folder / "wide.exr", labelled[:50])
    write_exr(folder / "black.exr", labelled * 0)
    write_exr(folder / "negative.exr", labelled - 1)
    nan = labelled.copy()
    nan[0, 0] = np.nan
    write_exr(folder / "nan.exr", nan)
    (folder / "cut.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 128\nxx")
    (folder / "text.exr").write_text("no light")
    (folder / "empty.json").write_text("{}")
    for number in range(6):
        size = 8 if number < 5 else 9
        write_exr(folder / f"face{number}.exr", np.ones((size, size, 3), np.float32))
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 20000 +X 40000\n"
    (folder / "huge.hdr").write_bytes(header)
    return folder


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["square.exr"], "mirror-ball or angular"),
        (["wide.exr"], "twice as wide"),
        (["wide.exr", "--in-mapping", "latlong"], "twice as wide"),
        (["black.exr"], "black"),
        (["negative.exr"], "negative"),
        (["nan.exr"], "NaN"),
        (["cut.hdr"], "cut.hdr"),
        (["text.exr"], "text.exr"),
        (["empty.json"], "empty.json"),
        (["huge.hdr"], "huge.hdr"),
        (["missing.exr"], "No such file"),
        ([f"face{number}.exr" for number in range(6)], "one size"),
        (["face0.exr", "face1.exr"], "six faces"),
        ([], "one file"),
        (["face0.exr", "--in-mapping", "cube"], "six files"),
        (["studio.exr", "--stops", "500"], "stops"),
        (["studio.exr", "--for", "blender", "--mapping", "cross"], "latlong or a cube"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(broken, words, said, capsys, labelled) -> None:
    write_exr(broken / "studio.exr", labelled)
    paths = [broken / word if "." in word else word for word in words]
    assert convert(*paths, "--out", broken.parent / "out.exr") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("deeplight convert: ")
    assert said in line
    assert [path.name for path in broken.parent.iterdir()] == ["in"]


def test_an_unknown_suffix_is_refused_before_anything_is_read(tmp_path, capsys) -> None:
    assert convert(tmp_path / "missing.exr", "--out", tmp_path / "a.tga") == 2
    assert ".glb" in capsys.readouterr().err


def test_a_panorama_of_odd_rows_gives_one_up_for_a_tool(tmp_path) -> None:
    write_exr(tmp_path / "odd.exr", np.ones((51, 102, 3), np.float32))
    assert convert(tmp_path / "odd.exr", "--out", tmp_path / "a.js") == 0
    assert read_hdr(tmp_path / "a.three.exr").shape == (50, 100, 3)


def test_an_input_is_never_replaced(studio, labelled) -> None:
    assert convert(studio, "--out", studio, "--stops", "1") == 2
    assert convert(studio, "--out", studio.with_suffix(".json")) == 2
    np.testing.assert_array_equal(read_hdr(studio), labelled)


def test_a_1k_panorama_takes_seconds(tmp_path) -> None:
    write_hdr(tmp_path / "big.hdr", labelled_environment(512).radiance)
    start = time.process_time()
    assert convert(tmp_path / "big.hdr", "--out", tmp_path / "a.exr", "--for", "three") == 0
    assert time.process_time() - start < 10


def test_a_cross_of_a_photographed_probe_reads_right_way_up(tmp_path, labelled) -> None:
    write_exr(tmp_path / "cross.exr", probe_from_latlong(labelled, "cross", 32))
    assert convert(tmp_path / "cross.exr", "--out", tmp_path / "a.exr") == 0
    assert np.median(np.abs(read_hdr(tmp_path / "a.exr") - labelled)) < 0.02


@pytest.fixture(scope="module")
def estimated(root: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A photo, and the panorama of `deeplight estimate`."""
    photo = root / "examples/photos/hall.jpg"
    folder = tmp_path_factory.mktemp("estimated")
    assert main(["estimate", str(photo), "--out", str(folder), "--height", "64"]) == 0
    return photo, folder / "hall.exr"


def test_a_photo_is_estimated_on_the_way(estimated, tmp_path) -> None:
    photo, light = estimated
    assert convert(photo, "--out", tmp_path / "a.exr", "--size", "64") == 0
    np.testing.assert_array_equal(read_hdr(tmp_path / "a.exr"), read_hdr(light))
    assert convert(photo, "--out", tmp_path / "b.exr", "--size", "64", "--fov", "30") == 0
    assert np.abs(read_hdr(tmp_path / "b.exr") - read_hdr(light)).max() > 0.1


def test_a_photo_of_any_kind_goes_where_its_light_goes(estimated, tmp_path, capsys) -> None:
    photo, light = estimated
    png = tmp_path / "photo.tif"  # of whole numbers, so no radiance
    Image.open(photo).save(png)
    assert convert(png, "--out", tmp_path / "a.json") == 0
    assert "66 degrees" in capsys.readouterr().out  # what was assumed
    assert json.loads((tmp_path / "a.json").read_text())["seen"]
    assert convert(photo, "--out", tmp_path / "a.webxr.json", "--size", "64") == 0
    described = light.with_suffix(".json")  # which lists the lamps; an .exr alone does not
    assert convert(described, "--out", tmp_path / "b.webxr.json") == 0
    one, other = (json.loads((tmp_path / f"{n}.webxr.json").read_text()) for n in "ab")
    one, other = (np.array(file["sphericalHarmonicsCoefficients"]) for file in (one, other))
    # The .json's light is the 32 x 32 ball, coarser than the rows that go on in the environment.
    np.testing.assert_allclose(one, other, atol=0.03 * np.abs(other).max())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["hall.jpg", "--in-mapping", "angular"], "--in-mapping with a photo"),
        (["hall.jpg", "--fov", "200"], "--fov between"),
        (["hall.jpg", "--size", "32"], "rows from 64"),
        (["wide.jpg"], "as panoramas are"),
        (["clip.mp4"], "deeplight fuse"),
        (["text.jpg"], "text.jpg"),
        (["missing.jpg"], "No such file"),
        (["studio.exr", "--fov", "40"], "--fov with what is light already"),
    ],
)
def test_what_is_no_single_photo_is_one_line_too(estimated, words, said, studio, capsys) -> None:
    folder = studio.parent
    picture = Image.open(estimated[0])
    picture.save(folder / "hall.jpg")
    picture.resize((400, 200)).save(folder / "wide.jpg")
    (folder / "clip.mp4").write_bytes(b"no film")
    (folder / "text.jpg").write_text("no photo")
    assert convert(folder / words[0], *words[1:], "--out", folder / "out/light.exr") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("deeplight convert: ")
    assert said in line
    assert not (folder / "out").exists()
