"""`deeplight estimate`: real files in, results or one clear line out, nothing half-written."""

import errno
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.cli.main import main
from deeplight.contract import CONTRACT_VERSION
from deeplight.io import lighting_file
from deeplight.io.environment_file import load_lighting, read_environment
from deeplight.io.photos import read_photo
from deeplight.io.radiance import read_hdr, write_exr

RESULTS = {".exr", ".json", ".preview.png"}


def results(tmp_path: Path) -> set[str]:
    return {file.name for file in (tmp_path / "out").iterdir()}


def test_a_photo_gives_environment_description_and_preview(photos, estimate, tmp_path, capsys):
    assert estimate(photos / "scene.jpg", small=False, drawn=True) == 0
    assert results(tmp_path) == {f"scene{suffix}" for suffix in RESULTS}
    environment = read_hdr(tmp_path / "out/scene.exr")
    assert environment.shape == (256, 512, 3)
    assert environment.dtype == np.float32
    record = json.loads((tmp_path / "out/scene.json").read_text())
    assert record["contract_version"] == CONTRACT_VERSION
    assert len(record["model"]["sha256"]) == 64
    assert record["photo"] == {"file": "scene.jpg", "width": 360, "height": 480}
    assert record["framing"]["fov_source"] == "assumed"
    assert str(tmp_path) not in (tmp_path / "out/scene.json").read_text()
    with Image.open(tmp_path / "out/scene.preview.png") as preview:
        assert min(preview.size) > 600
    printed = capsys.readouterr().out
    assert "scene.exr" in printed
    assert "assumed 66 degrees" in printed


def test_the_light_is_the_networks(photos, estimate, tmp_path):
    """The tiny model gives the photo's mean colour from everywhere, and a lamp. So narrow a photo
    is looked at once."""
    Image.new("RGB", (300, 400), (200, 100, 50)).save(photos / "flat.png")
    assert estimate(photos / "flat.png", "--fov", 50, "--light-only") == 0
    lighting = load_lighting(tmp_path / "out/flat.json")
    np.testing.assert_allclose(
        lighting.radiance[20, 16], (np.array([200, 100, 50]) / 255) ** 2.2, rtol=1e-3
    )
    lamp = lighting.radiance[8, 24] / lighting.radiance[20, 16]
    np.testing.assert_allclose(lamp, np.exp(5), rtol=1e-3)


def test_the_photo_stands_in_its_environment(photos, estimate, tmp_path):
    """And the lamp of the tiny model, up to the right behind, is a light of its own."""
    Image.new("RGB", (300, 400), (200, 100, 50)).save(photos / "flat.png")
    assert estimate(photos / "flat.png", "--fov", 66, "--seen", "--height", 128) == 0
    environment = read_environment(tmp_path / "out/flat.json")
    whole = read_hdr(tmp_path / "out/flat.exr")
    assert whole.shape == (128, 256, 3)
    np.testing.assert_array_equal(environment.radiance, whole)
    shown = (np.array([200, 100, 50]) / 255) ** 2.2
    np.testing.assert_allclose(whole[64, 128], shown, rtol=1e-3)
    assert environment.seen[64, 128] == 1
    assert environment.seen[:, :64].max() == 0
    record = json.loads((tmp_path / "out/flat.json").read_text())
    (lamp,) = record["lamps"]["lamps"]
    assert lamp["direction"][0] > 0.5
    assert estimate(photos / "flat.png", "--fov", 66, "--lamps-apart", "--height", 128) == 0
    rest = read_hdr(tmp_path / "out/flat.exr")
    assert rest.max() < 0.2 * whole.max()
    again = read_environment(tmp_path / "out/flat.json").radiance  # with its lamps, not twice
    np.testing.assert_allclose(again, whole, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("level", "word"), [(0, "black"), (255, "white"), (120, "one colour")])
def test_a_photo_that_shows_nothing_is_said_to(photos, estimate, capsys, level, word):
    Image.new("RGB", (300, 400), (level,) * 3).save(photos / "blank.png")
    assert estimate(photos / "blank.png", "--height", 64, drawn=True) == 0
    assert f"{word} all over: its light is a guess" in " ".join(capsys.readouterr().out.split())


def test_detail_is_made_up_on_request_where_the_photo_does_not_look(photos, estimate, tmp_path):
    plain, rich = [], []
    for found, more in ((plain, ()), (rich, ("--fill", "indoor"))):
        assert estimate(photos / "scene.jpg", "--height", 64, "--lamps-apart", *more) == 0
        found.append(read_hdr(tmp_path / "out/scene.exr"))
        found.append(json.loads((tmp_path / "out/scene.json").read_text())["seen"])
    assert plain[1]["elsewhere"] == "estimated"
    assert rich[1]["elsewhere"] == "estimated, its detail invented"
    assert rich[1]["detail_of"]
    assert rich[1]["levels"] == plain[1]["levels"]
    np.testing.assert_allclose(rich[0][32, 64], plain[0][32, 64], rtol=1e-5)  # the photo
    assert np.abs(np.log(rich[0][20:40, :20] / plain[0][20:40, :20])).max() > 0.05


def test_pixels_are_those_of_the_file_though_a_large_jpeg_is_read_smaller(
    photos, estimate, tmp_path
):
    Image.new("RGB", (1800, 2400), (200, 100, 50)).save(photos / "large.jpg")
    corner = ("--fov", 66, "--sun-at", 1800, 0, "--height", 64)
    assert estimate(photos / "large.jpg", *corner) == 0
    record = json.loads((tmp_path / "out/large.json").read_text())
    assert read_photo(photos / "large.jpg", 896).reduced_from == (2400, 1800)
    assert (record["photo"]["width"], record["photo"]["height"]) == (1800, 2400)
    used = record["framing"]["seen_by_the_network"]
    assert used["top"] == pytest.approx(0, abs=1)
    assert used["bottom"] == pytest.approx(2400, abs=2)  # of the second look
    right, up, back = record["sun"]["direction"]
    assert (right / -back, up / -back) == pytest.approx(
        (0.75 * np.tan(np.radians(33)), np.tan(np.radians(33))), rel=1e-3
    )


@pytest.mark.parametrize("words", [["--height", 63], ["--light-only", "--lamps-apart"]])
def test_options_that_cannot_be_are_refused(photos, estimate, capsys, words):
    assert estimate(photos / "scene.jpg", *words) == 2
    assert "--" in capsys.readouterr().err


def test_a_given_field_of_view_is_used_and_a_narrow_one_is_reported(
    photos, estimate, tmp_path, capsys
):
    assert estimate(photos / "scene.jpg", "--fov", 30) == 0
    framing = json.loads((tmp_path / "out/scene.json").read_text())["framing"]
    assert framing["fov_source"] == "given"
    assert framing["vertical_fov_deg"] == pytest.approx(30)
    assert framing["visible_fraction"] < 0.5
    printed = capsys.readouterr().out
    assert "of the view the network was trained on" in printed
    assert "assumed" not in printed


def test_exif_gives_orientation_and_field_of_view(photos, estimate, tmp_path):
    with Image.open(photos / "scene.jpg") as upright:
        stored = upright.transpose(Image.Transpose.ROTATE_90)
        exif = Image.Exif()
        exif[0x0112] = 6  # stored lying on its side
        exif.get_ifd(0x8769)[0xA405] = 28  # 35 mm equivalent
        stored.save(photos / "turned.png", exif=exif)
        upright.save(photos / "upright.png")
    assert estimate(photos / "turned.png", photos / "upright.png", "--fov", 60) == 0
    turned = load_lighting(tmp_path / "out/turned.json").radiance
    np.testing.assert_allclose(
        turned, load_lighting(tmp_path / "out/upright.json").radiance, rtol=1e-4
    )
    assert estimate(photos / "turned.png") == 0
    framing = json.loads((tmp_path / "out/turned.json").read_text())["framing"]
    assert framing["fov_source"] == "exif"
    assert framing["vertical_fov_deg"] == pytest.approx(63.4, abs=0.5)


@pytest.mark.parametrize("size", [(32, 1500), (1500, 32)])
@pytest.mark.parametrize("fov", [1, 179])
def test_odd_shapes_and_extreme_fields_of_view_give_results(photos, estimate, tmp_path, size, fov):
    Image.new("RGB", size, (90, 90, 90)).save(photos / "写真 [b].png")
    assert estimate(photos / "写真 [b].png", "--fov", fov, drawn=True) == 0
    assert results(tmp_path) == {f"写真 [b]{suffix}" for suffix in RESULTS}


@pytest.mark.parametrize(("tool", "quarter"), [("blender", -1), ("unreal", 1), ("mitsuba", 0)])
def test_for_a_tool_the_environment_is_turned_and_says_so(
    photos, estimate, tmp_path, tool, quarter
):
    assert estimate(photos / "scene.jpg") == 0
    ours = read_hdr(tmp_path / "out/scene.exr")
    assert estimate(photos / "scene.jpg", "--for", tool, "--hdr") == 0
    np.testing.assert_array_equal(
        read_hdr(tmp_path / "out/scene.exr"), np.roll(ours, quarter * 32, axis=1)
    )
    environment = json.loads((tmp_path / "out/scene.json").read_text())["environment"]
    assert environment["made_for"] == tool
    assert environment["view_u"] == 0.5 + quarter / 4
    assert environment["files"] == ["scene.exr", "scene.hdr"]


def test_for_webxr_there_is_a_light_estimate(photos, estimate, tmp_path):
    assert estimate(photos / "scene.jpg", "--for", "webxr") == 0
    light = json.loads((tmp_path / "out/scene.webxr.json").read_text())
    assert len(light["sphericalHarmonicsCoefficients"]) == 27


def test_a_folder_goes_on_past_bad_photos_and_names_each(photos, estimate, tmp_path, capsys):
    (photos / "empty.jpg").write_bytes(b"")
    (photos / "text.png").write_text("no picture")
    whole = (photos / "scene.jpg").read_bytes()
    (photos / "cut.jpg").write_bytes(whole[: len(whole) // 2])
    assert estimate(photos, tmp_path / "nowhere.jpg") == 2
    assert results(tmp_path) == {f"scene{suffix}" for suffix in RESULTS}
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 5
    assert all(line.startswith("deeplight estimate: ") for line in lines)
    for name in ("empty.jpg", "text.png", "cut.jpg", "nowhere.jpg"):
        assert sum(name in line for line in lines) == 1
    assert "4 of 5" in lines[-1]


FAULTS = [
    IndexError("list index out of range"),
    RuntimeError("no planes"),
    RecursionError(),
    EOFError(),
]


@pytest.mark.parametrize("fault", FAULTS, ids=repr)
def test_whatever_a_decoder_raises_the_batch_goes_on(
    photos, estimate, tmp_path, capfd, monkeypatch, fault
):
    from deeplight.io import photos as reader

    decode = reader.decode_photo

    def fails(path: Path, start: bytes):
        if path.name == "broken.jpg":
            raise fault
        return decode(path, start)

    monkeypatch.setattr(reader, "decode_photo", fails)
    monkeypatch.setattr(reader, "decode_reduced", lambda *_: None, raising=False)
    shutil.copy(photos / "scene.jpg", photos / "broken.jpg")
    assert estimate(photos) == 2
    assert results(tmp_path) == {f"scene{suffix}" for suffix in RESULTS}
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "broken.jpg" in lines[0]


def test_files_that_once_ended_a_batch_are_one_line_each(estimate, tmp_path, cases, capfd):
    pytest.importorskip("av")
    bad = "indexerror.png runtimeerror.avif eoferror.heic video-1-52-other.mp4 concat_rel.mp4"
    names = [*(f"hostile/{name}" for name in bad.split()), "sound/damaged.avif"]
    good = [cases / "sound/upright.png", cases / "sound/take:1.mp4"]
    assert estimate(*(cases / name for name in names), *good, drawn=True) == 2
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == len(names) + 1
    for name in names:
        assert sum(Path(name).name in line for line in lines) == 1
    made = {"upright", "take:1_000000", "take:1_000001"}
    assert results(tmp_path) == {f"{stem}{suffix}" for stem in made for suffix in RESULTS}


def bad_photo(kind: str, folder: Path) -> Path:
    path = folder / f"{kind}.png"
    if kind == "tiny":
        Image.new("RGB", (1, 1)).save(path)
    elif kind == "wide":
        Image.new("RGB", (60_000, 40)).save(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "nan":
        path = folder / "nan.exr"
        write_exr(path, np.full((64, 64, 3), np.nan, np.float32))
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "text":
        path.write_text("no picture")
    return path  # "missing" stays so


@pytest.mark.parametrize("kind", ["tiny", "wide", "folder", "nan", "empty", "text", "missing"])
def test_one_bad_photo_is_one_line_and_no_file(photos, estimate, tmp_path, capfd, kind):
    assert estimate(bad_photo(kind, photos)) == 2
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("deeplight estimate: ")
    assert not (tmp_path / "out").exists()


def test_photos_of_equal_name_do_not_overwrite_each_other(photos, estimate, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(photos, other)
    with Image.open(photos / "scene.jpg") as picture:
        picture.save(photos / "scene.png")
    assert estimate(photos, other, photos / "scene.jpg") == 0
    stems = {name.removesuffix(".json") for name in results(tmp_path) if name.endswith(".json")}
    assert stems == {"scene", "photos_scene", "other_scene"}


def test_a_name_as_long_as_a_disk_allows_ends_no_batch(photos, estimate, tmp_path):
    content = (photos / "scene.jpg").read_bytes()
    for name in ("a" * 251 + ".jpg", "a" * 250 + ".jpg", "b.jpg"):
        (photos / name).write_bytes(content)
    assert estimate(photos, "--light-only", drawn=True) == 0
    assert len(results(tmp_path)) == 4 * len(RESULTS)


def test_a_result_never_replaces_the_photo_it_came_from(estimate, tmp_path):
    (tmp_path / "out").mkdir()
    write_exr(tmp_path / "out/room.exr", np.full((64, 48, 3), 0.5, np.float32))
    before = (tmp_path / "out/room.exr").read_bytes()
    assert estimate(tmp_path / "out/room.exr") == 0
    assert (tmp_path / "out/room.exr").read_bytes() == before
    assert (tmp_path / "out/out_room.exr").exists()


def test_a_video_gives_a_result_per_frame(estimate, tmp_path):
    av = pytest.importorskip("av")
    with av.open(str(tmp_path / "clip.mp4"), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = 96, 128, "yuv420p"
        for level in (40, 120, 200):
            frame = av.VideoFrame.from_ndarray(np.full((128, 96, 3), level, np.uint8), "rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    assert estimate(tmp_path / "clip.mp4") == 0
    assert results(tmp_path) == {f"clip_{i:06d}{suffix}" for i in range(3) for suffix in RESULTS}
    powers = [load_lighting(tmp_path / f"out/clip_{i:06d}.json").power().sum() for i in range(3)]
    assert powers[0] < powers[1] < powers[2]


@pytest.mark.parametrize("failing", ["write_exr", "write_png"])
def test_a_full_disk_leaves_nothing_of_the_photo(
    photos, estimate, tmp_path, monkeypatch, capsys, failing
):
    def full(path: Path, *_: object) -> None:
        Path(path).write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    owner = lighting_file if failing == "write_exr" else "deeplight.estimators.results"
    target = f"{owner if isinstance(owner, str) else owner.__name__}.{failing}"
    monkeypatch.setattr(target, full)
    assert estimate(photos / "scene.jpg") == 2
    assert "No space left" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_reported(photos, tmp_path, tiny_model, capsys):
    (tmp_path / "file").write_text("in the way")
    words = [photos / "scene.jpg", "--out", tmp_path / "file/out", "--model", tiny_model]
    assert main(["estimate", *map(str, words)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [(["--fov", "0"], "--fov"), (["--fov", "nan"], "--fov"), (["--fov", "200"], "--fov")],
)
def test_impossible_options_are_one_line(photos, estimate, capsys, words, message):
    assert estimate(photos / "scene.jpg", *words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_an_unknown_tool_is_refused_with_the_known_ones(photos, estimate, capsys):
    with pytest.raises(SystemExit) as caught:
        estimate(photos / "scene.jpg", "--for", "maya")
    assert caught.value.code == 2
    assert "blender" in capsys.readouterr().err
