"""HDR images as renderers, cameras and Radiance's own tools write them: what they say is obeyed."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from deeplight.cli.main import main
from deeplight.errors import ImageFileError
from deeplight.io.colour import ACES_AP0, ACES_AP1, BT709, BT2020, CIE_XYZ, bt709_from_primaries
from deeplight.io.environment_file import read_environment
from deeplight.io.photos import read_photo
from deeplight.io.radiance import read_hdr, write_exr
from profiles import rgb_profile

HEIGHT, WIDTH = 32, 64


def light(height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """Smooth radiance whose corners and channels all differ."""
    rows, columns = np.mgrid[0:height, 0:width] / width
    channels = (0.5 + rows, 1.5 - columns, 0.3 + columns + 2 * rows)
    return np.stack(channels, axis=-1).astype(np.float32)


def rgbe(radiance: np.ndarray) -> bytes:
    exponent = np.ceil(np.log2(np.maximum(radiance.max(axis=-1), 1e-9) * 256 / 255)).astype(int)
    mantissa = np.floor(radiance / 2.0 ** exponent[..., None] * 256)
    return np.dstack([mantissa, exponent + 128]).astype(np.uint8).tobytes()


def write_radiance(
    path: Path, stored: np.ndarray, line: str = "", header: str = "", kind: str = "rgbe"
) -> Path:
    rows, columns = stored.shape[:2]
    line = line or f"-Y {rows} +X {columns}"
    text = f"#?RADIANCE\n# made here\nFORMAT=32-bit_rle_{kind}\n{header}\n{line}\n"
    path.write_bytes(text.encode() + rgbe(stored))
    return path


LINES = ["-Y +X", "-Y -X", "+Y -X", "+Y +X", "+X -Y", "-X -Y", "-X +Y", "+X +Y"]


@pytest.mark.parametrize("axes", LINES)
def test_every_resolution_line_is_obeyed(tmp_path: Path, axes: str) -> None:
    """Stored by the words of Radiance's manual: the first axis goes from scanline to scanline."""
    slow, fast = axes.split()
    picture = light()
    y_up, x_right = picture[::-1], picture  # rows counted upwards, columns to the right
    stored = np.empty((HEIGHT, WIDTH, 3) if "Y" in slow else (WIDTH, HEIGHT, 3), np.float32)
    for scanline in range(stored.shape[0]):
        at = scanline if slow[0] == "+" else stored.shape[0] - 1 - scanline
        values = y_up[at] if "Y" in slow else x_right[:, at][::-1]
        stored[scanline] = values if fast[0] == "+" else values[::-1]
    line = f"{slow} {stored.shape[0]} {fast} {stored.shape[1]}"
    path = write_radiance(tmp_path / "a.hdr", stored, line)
    np.testing.assert_allclose(read_hdr(path), picture, rtol=0.02, atol=0.02)
    assert np.abs(read_hdr(path) - picture[:, ::-1]).max() > 0.3  # the test can fail
    wanted = np.clip(picture, 0, 1) ** (1 / 2.2) * 255
    assert np.abs(read_photo(path).pixels - wanted).max() < 6


HEADERS = {
    "EXPOSURE=4.0\n": (4, 4, 4),
    "EXPOSURE=2\nEXPOSURE=0.25\n": (0.5, 0.5, 0.5),
    "COLORCORR=1 2 0.5\nEXPOSURE= 2\n": (2, 4, 1),
    "EXPOSURE=0\nCOLORCORR=1 2\nEXPOSURE=nan\nEXPOSURE=x\n": (1, 1, 1),
    "SOFTWARE=x\nVIEW= -vta\nPIXASPECT=1\n": (1, 1, 1),
    "pcompos a.hdr b.hdr\n\tEXPOSURE=4\nEXPOSURE=2\n": (2, 2, 2),  # the first is a.hdr's
}


@pytest.mark.parametrize("header", HEADERS)
def test_exposure_and_colour_correction_are_divided_out(tmp_path: Path, header: str) -> None:
    stored = light() * np.array(HEADERS[header], np.float32)
    path = write_radiance(tmp_path / "a.hdr", stored, header=header)
    np.testing.assert_allclose(read_hdr(path), light(), rtol=0.02, atol=0.02)


def test_a_gamma_is_undone_before_the_exposure(tmp_path: Path) -> None:
    stored = (2 * light()) ** np.float32(1 / 2.2)
    path = write_radiance(tmp_path / "a.hdr", stored, header="EXPOSURE=2\nGAMMA=2.2\n")
    np.testing.assert_allclose(read_hdr(path), light(), rtol=0.03, atol=0.02)


@pytest.mark.parametrize("value", ["1", "0", "-2", "nan", "1e9", "x"])
def test_a_gamma_that_makes_no_sense_counts_as_missing(tmp_path: Path, value: str) -> None:
    path = write_radiance(tmp_path / "a.hdr", light(), header=f"GAMMA={value}\n")
    np.testing.assert_allclose(read_hdr(path), light(), rtol=0.02, atol=0.02)


def test_primaries_of_a_hdr_are_converted(tmp_path: Path) -> None:
    wide = light() @ np.linalg.inv(bt709_from_primaries(BT2020)).T.astype(np.float32)
    header = f"PRIMARIES= {' '.join(map(str, BT2020))}\n"
    path = write_radiance(tmp_path / "a.hdr", wide, header=header)
    np.testing.assert_allclose(read_hdr(path), light(), atol=0.05)
    assert np.abs(read_hdr(write_radiance(tmp_path / "b.hdr", wide)) - light()).max() > 0.1


def test_xyz_pixels_become_rgb(tmp_path: Path) -> None:
    xyz = light() @ np.linalg.inv(bt709_from_primaries(CIE_XYZ)).T.astype(np.float32)
    path = write_radiance(tmp_path / "a.hdr", xyz, kind="xyze")
    np.testing.assert_allclose(read_hdr(path), light(), atol=0.06)


Parts = list[tuple[str, dict[str, np.ndarray]]]


def write_parts(path: Path, parts: Parts, window: tuple[int, ...] = (), **said: object) -> Path:
    """An EXR of one or more parts, each with channels by name."""
    specs = []
    for name, channels in parts:
        height, width = next(iter(channels.values())).shape
        spec = oiio.ImageSpec(width, height, len(channels), "float")
        spec.channelnames = tuple(channels)
        if name:
            spec.attribute("oiio:subimagename", name)
        if window:
            spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = window
        for key, value in said.items():
            kind = oiio.TypeDesc(f"float[{len(value)}]") if isinstance(value, tuple) else None
            spec.attribute(key, kind, value) if kind else spec.attribute(key, value)
        specs.append(spec)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), tuple(specs) if len(specs) > 1 else specs[0])
    for number, (_, channels) in enumerate(parts):
        if number:
            assert file.open(str(path), specs[number], "AppendSubimage")
        assert file.write_image(np.ascontiguousarray(np.dstack(list(channels.values()))))
    assert file.close()
    return path


def layer(name: str, values: np.ndarray | None = None, colours: str = "R G B") -> dict:
    values = light() if values is None else values
    return {f"{name}{word}": values[..., i] for i, word in enumerate(colours.split())}


WRONG = np.full((HEIGHT, WIDTH, 3), 0.25, np.float32)
DEPTH = {"ViewLayer.Depth.Z": WRONG[..., 0]}
FOUND: dict[str, Parts] = {
    "Blender": [("", layer("ViewLayer.DiffCol.", WRONG) | DEPTH | layer("ViewLayer.Combined."))],
    "plain before layers": [("", layer("albedo.", WRONG) | layer(""))],
    "one layer alone": [("", layer("sky.") | {"Z": WRONG[..., 0]})],
    "beauty": [("", layer("diffuse.", WRONG) | layer("beauty.") | layer("N.", WRONG))],
    "Nuke's words": [("", layer("rgba.", colours="red green blue") | layer("d.", WRONG))],
    "small letters": [("", layer("", colours="r g b") | {"a": WRONG[..., 0]})],
    "parts": [("albedo", layer("", WRONG)), ("rgba", layer(""))],
    "a part of Blender": [
        ("ViewLayer.DiffCol", layer("ViewLayer.DiffCol.", WRONG)),
        ("ViewLayer.Combined", layer("ViewLayer.Combined.")),
    ],
    "a part without colour": [("depth", {"Z": WRONG[..., 0]}), ("main", layer(""))],
    "one plain part": [("a", layer("x.", WRONG)), ("b", layer("")), ("c", layer("y.", WRONG))],
}


@pytest.mark.parametrize("kind", ["half", "uint"])
def test_a_part_of_numbers_may_come_first(tmp_path: Path, kind: str) -> None:
    """Object numbers are no light, whatever part they are; colours in whole numbers are none."""
    specs = [oiio.ImageSpec(WIDTH, HEIGHT, n, k) for n, k in ((1, "uint"), (3, kind))]
    specs[0].channelnames = ("id",)
    for spec, name in zip(specs, ("id", "rgba"), strict=True):
        spec.attribute("oiio:subimagename", name)
    path = tmp_path / "a.exr"
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), tuple(specs))
    assert file.write_image(np.ones((HEIGHT, WIDTH, 1), np.uint32))
    assert file.open(str(path), specs[1], "AppendSubimage")
    assert file.write_image(light())
    assert file.close()
    if kind == "half":
        np.testing.assert_array_equal(read_hdr(path), light().astype(np.float16))
    else:
        with pytest.raises(ImageFileError, match="uint pixels"):
            read_hdr(path)


@pytest.mark.parametrize("name", FOUND)
def test_the_light_is_found_among_layers_and_parts(tmp_path: Path, name: str) -> None:
    path = write_parts(tmp_path / "a.exr", FOUND[name])
    np.testing.assert_array_equal(read_hdr(path), light())


ASKED: dict[str, tuple[Parts, str]] = {
    "two passes": ([("", layer("DiffDir.") | layer("GlossDir."))], "DiffDir, GlossDir"),
    "two view layers": (
        [("", layer("Back.Combined.") | layer("Front.Combined."))],
        "Back.Combined, Front.Combined",
    ),
    "two parts": ([("left", layer("")), ("right", layer(""))], "left, right"),
}


@pytest.mark.parametrize("name", ASKED)
def test_which_layer_is_asked_where_several_could_be_the_light(tmp_path: Path, name: str) -> None:
    parts, listed = ASKED[name]
    with pytest.raises(ImageFileError) as caught:
        read_hdr(write_parts(tmp_path / "a.exr", parts))
    assert listed in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_layer_is_taken_by_its_name(tmp_path: Path) -> None:
    parts = [("", layer("Back.Combined.", WRONG) | layer("Front.Combined."))]
    path = write_parts(tmp_path / "a.exr", parts)
    np.testing.assert_array_equal(read_hdr(path, "front.combined"), light())
    np.testing.assert_array_equal(read_environment(path, layer="Front.Combined").radiance, light())
    np.testing.assert_array_equal(read_hdr(path, "Back.Combined"), WRONG)
    with pytest.raises(ImageFileError, match=r"'Combined'.*with Back.Combined, Front.Combined"):
        read_hdr(path, "Combined")
    out = tmp_path / "light.exr"
    assert main(["convert", str(path), "--layer", "Front.Combined", "--out", str(out)]) == 0
    np.testing.assert_allclose(read_hdr(out), light(), rtol=1e-6)
    assert main(["convert", str(path), "--out", str(tmp_path / "no.exr")]) == 2


def test_a_deep_file_is_said_to_be_deep(tmp_path: Path) -> None:
    """OpenImageIO gives what lay in memory, without an error."""
    spec = oiio.ImageSpec(8, 4, 3, "float")
    spec.deep = True
    file = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    assert file.open(str(tmp_path / "a.exr"), spec)
    deep = oiio.DeepData()
    deep.init(spec)
    assert file.write_deep_image(deep)
    assert file.close()
    with pytest.raises(ImageFileError, match="deep"):
        read_hdr(tmp_path / "a.exr")


@pytest.mark.parametrize("offset", [(8, 4), (0, 0), (-5, 3), (60, 0), (200, 200)])
@pytest.mark.parametrize("display", [(HEIGHT, WIDTH), (20, 40), (48, 96)])
def test_the_display_window_is_the_picture(
    tmp_path: Path, offset: tuple[int, int], display: tuple[int, int]
) -> None:
    """`offset` is where the display window's corner lies in the data window."""
    (x, y), (height, width) = offset, display
    window = (0, 0, x, y, width, height)
    path = write_parts(tmp_path / "a.exr", [("", layer(""))], window)
    got = read_hdr(path)
    rows, columns = np.mgrid[y : y + height, x : x + width]
    inside = (rows >= 0) & (rows < HEIGHT) & (columns >= 0) & (columns < WIDTH)
    wanted = light()[rows.clip(0, HEIGHT - 1), columns.clip(0, WIDTH - 1)] * inside[..., None]
    np.testing.assert_array_equal(got, wanted.astype(np.float32))


@pytest.mark.parametrize("primaries", [ACES_AP0, ACES_AP1, BT2020, CIE_XYZ])
def test_chromaticities_of_an_exr_are_converted(tmp_path: Path, primaries: tuple) -> None:
    stored = light() @ np.linalg.inv(bt709_from_primaries(primaries)).T.astype(np.float32)
    parts = [("", layer("", stored.astype(np.float32)))]
    path = write_parts(tmp_path / "a.exr", parts, chromaticities=primaries)
    np.testing.assert_allclose(read_hdr(path), light(), atol=1e-4)
    assert np.abs(stored - light()).max() > 0.05
    grey = write_parts(tmp_path / "b.exr", [("", layer("", WRONG))], chromaticities=primaries)
    np.testing.assert_allclose(read_hdr(grey), WRONG, atol=1e-6)  # white stays white


@pytest.mark.parametrize(
    ("primaries", "said"),
    [
        (ACES_AP1, {"colorInteropID": "lin_ap1_scene"}),
        (ACES_AP1, {"oiio:ColorSpace": "ACEScg"}),
        (ACES_AP0, {"oiio:ColorSpace": "ACES2065-1"}),
        (BT709, {"oiio:ColorSpace": "lin_rec709_scene"}),
    ],
)
def test_the_name_of_a_space_is_known(tmp_path: Path, primaries: tuple, said: dict) -> None:
    stored = light() @ np.linalg.inv(bt709_from_primaries(primaries)).T.astype(np.float32)
    parts = [("", layer("", stored.astype(np.float32)))]
    path = write_parts(tmp_path / "a.exr", parts, **said)
    np.testing.assert_allclose(read_hdr(path), light(), atol=1e-4)


@pytest.mark.parametrize("names", ["X Y Z", "Y RY BY", "Z", "View.Depth.Z", "A", "c.r c.g c.b c.a"])
def test_what_is_no_light_is_refused(tmp_path: Path, names: str) -> None:
    names = names.replace("c.", "View.CryptoObject00.")
    channels = {name: light()[..., i % 3] for i, name in enumerate(names.split())}
    with pytest.raises(ImageFileError, match="R, G, B"):
        read_hdr(write_parts(tmp_path / "a.exr", [("", channels)]))


def test_a_tiffs_profile_and_orientation_are_obeyed(tmp_path: Path) -> None:
    stored = light() @ np.linalg.inv(bt709_from_primaries(BT2020)).T.astype(np.float32)
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, "float")
    profile = np.frombuffer(rgb_profile(BT2020, 1.0, "linear BT.2020"), np.uint8)
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(profile)}]"), profile)
    spec.attribute("Orientation", 4)
    file = oiio.ImageOutput.create(str(tmp_path / "a.tif"))
    assert file.open(str(tmp_path / "a.tif"), spec)
    assert file.write_image(np.ascontiguousarray(stored[::-1].astype(np.float32)))
    assert file.close()
    np.testing.assert_allclose(read_hdr(tmp_path / "a.tif"), light(), atol=2e-3)


def test_random_damage_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(3)
    for name in ("a.exr", "a.hdr"):
        path = tmp_path / name
        if name == "a.exr":
            write_parts(path, FOUND["Blender"])
        else:
            write_radiance(path, light())
        whole = np.frombuffer(path.read_bytes(), np.uint8)
        for _ in range(60):
            broken = whole.copy()
            places = random.integers(0, min(len(whole), random.choice([400, 10**9])), 6)
            broken[places] = random.integers(0, 256, 6)
            path.write_bytes(broken.tobytes())
            try:
                read_hdr(path)
            except ImageFileError as error:
                lines = str(error).splitlines()
                if len(lines) != 1 or name not in lines[0]:
                    raise
    assert capfd.readouterr().err == ""


SAME = "top.hdr bottom_up.hdr exposure4.hdr blender_layers.exr acescg.exr overscan.exr".split()


@pytest.mark.parametrize("name", [f"light_{name}" for name in SAME] + ["light.tif"])
def test_lights_of_other_programs(cases: Path, name: str) -> None:
    wanted = read_environment(cases / "sound/light.exr").radiance
    got = read_environment(cases / "sound" / name)
    np.testing.assert_allclose(got.radiance, wanted, rtol=0.02, atol=0.03)
    np.testing.assert_allclose(got.main_light.direction, (0.45, 0.83, -0.33), atol=0.01)


def test_an_undecodable_name_in_a_header_is_one_line(cases: Path) -> None:
    with pytest.raises(ImageFileError, match=r"unicodedecode\.exr") as caught:
        read_hdr(cases / "hostile/unicodedecode.exr")
    assert len(str(caught.value)) < 400


def test_a_huge_display_window_is_refused(tmp_path: Path) -> None:
    window = (0, 0, 0, 0, 25_000, 25_000)
    path = write_parts(tmp_path / "a.exr", [("", layer(""))], window)
    with pytest.raises(ImageFileError, match="25000 x 25000"):
        read_hdr(path)


def test_an_exr_of_ours_says_its_primaries_and_keeps_its_values(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", light())
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert spec.getattribute("chromaticities") == pytest.approx(BT709)
    np.testing.assert_array_equal(read_hdr(tmp_path / "a.exr"), light())
