"""Photos of any colour space come out as the same photo in sRGB."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image, ImageCms

from deeplight.camera_response import decode
from deeplight.io.colour import (
    ACES_AP1,
    ADOBE_RGB,
    BT709,
    BT2020,
    DISPLAY_P3,
    bt709_from_primaries,
    from_cicp,
    from_gamma,
    hlg_from_radiance,
    srgb_decode,
    srgb_encode,
)
from deeplight.io.colour_profile import from_icc
from deeplight.io.photos import photo_of_pillow, read_photo
from profiles import SRGB_CURVE, cmyk_profile, grey_profile, rgb_profile

PROPHOTO = (0.7347, 0.2653, 0.1596, 0.8404, 0.0366, 0.0001, 0.3457, 0.3585)
LOSSY = (".jpg", ".avif", ".heic")


def photo() -> np.ndarray:
    """A smooth picture with colours enough that a forgotten conversion shows."""
    rows, columns = np.mgrid[0:64, 0:96] / 96
    channels = (0.1 + 0.8 * rows, 0.7 - 0.5 * columns, 0.2 + 0.4 * columns + 0.2 * rows)
    return np.round(np.stack(channels, axis=-1) * 255).astype(np.uint8)


def in_space(
    chromaticities: tuple[float, ...], encode: object, radiance: bool = False
) -> np.ndarray:
    """The photo as a signal 0 to 1 of another space."""
    linear = decode(photo() / 255) if radiance else srgb_decode(photo() / 255)
    linear = linear @ np.linalg.inv(bt709_from_primaries(chromaticities)).T
    return np.clip(encode(np.clip(linear, 0, None)), 0, 1)


def eight(signal: np.ndarray) -> np.ndarray:
    return np.round(signal * 255).astype(np.uint8)


def far(got: np.ndarray, wanted: np.ndarray) -> float:
    assert got.shape == wanted.shape
    return float(np.abs(got.astype(int) - wanted).mean())


SPACES = {
    "Display P3": (DISPLAY_P3, SRGB_CURVE, srgb_encode),
    "Adobe RGB": (ADOBE_RGB, 563 / 256, lambda x: x ** (256 / 563)),
    "ProPhoto": (PROPHOTO, 1.8, lambda x: x ** (1 / 1.8)),
    "table": (BT2020, srgb_decode(np.linspace(0, 1, 1024)), srgb_encode),
}


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".webp", ".tif", ".avif", ".heic"])
@pytest.mark.parametrize("name", SPACES)
def test_a_profile_is_applied_in_every_format(tmp_path: Path, name: str, suffix: str) -> None:
    chromaticities, curve, encode = SPACES[name]
    stored = eight(in_space(chromaticities, encode))
    options: dict[str, object] = {"icc_profile": rgb_profile(chromaticities, curve, name)}
    if suffix == ".heic":
        pytest.importorskip("pillow_heif").register_heif_opener()
    options |= {".webp": {"lossless": True}, ".tif": {}, ".png": {}}.get(suffix, {"quality": 95})
    if suffix in LOSSY:
        options["subsampling"] = "4:4:4" if suffix != ".heic" else None
    options = {key: value for key, value in options.items() if value is not None}
    path = tmp_path / f"a{suffix}"
    Image.fromarray(stored).save(path, **options)
    read = read_photo(path)
    assert far(read.pixels, photo()) < (3 if suffix in LOSSY else 1)
    assert far(stored, photo()) > 5  # as it was read before
    assert read.notes == (f"{name} converted to sRGB",)
    with Image.open(path) as picture:
        np.testing.assert_array_equal(photo_of_pillow(picture).pixels, read.pixels)


@pytest.mark.parametrize("name", SPACES)
def test_profiles_are_read_as_littlecms_reads_them(name: str) -> None:
    chromaticities, curve, _ = SPACES[name]
    profile = rgb_profile(chromaticities, curve, name)
    level = np.arange(0, 256, 15).astype(np.uint8)
    colours = np.stack(np.meshgrid(level, level, level), axis=-1).reshape(18, -1, 3)
    wanted = ImageCms.profileToProfile(
        Image.fromarray(colours),
        ImageCms.ImageCmsProfile(io.BytesIO(profile)),
        ImageCms.createProfile("sRGB"),
    )
    got = from_icc(profile).pixels(colours)
    assert np.abs(got.astype(int) - np.asarray(wanted)).max() <= 2


@pytest.mark.parametrize("curve", [SRGB_CURVE, srgb_decode(np.linspace(0, 1, 1024))])
def test_srgb_needs_nothing(tmp_path: Path, curve: object) -> None:
    assert from_icc(rgb_profile(BT709, curve, "IEC 61966")) is None
    path = tmp_path / "a.png"
    Image.fromarray(photo()).save(path, icc_profile=rgb_profile(BT709, curve, "any name"))
    read = read_photo(path)
    np.testing.assert_array_equal(read.pixels, photo())
    assert read.notes == ()


def linear_16(path: Path, profile: bytes | None = None, suffix: str = "") -> None:
    signal = np.round(in_space(BT709, lambda x: x, radiance=True) * 65535).astype(np.uint16)
    spec = oiio.ImageSpec(signal.shape[1], signal.shape[0], 3, "uint16")
    if profile:
        content = np.frombuffer(profile, np.uint8)
        spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(content)}]"), content)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(signal)
    assert file.close()


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_linear_profile_keeps_all_16_bits(tmp_path: Path, suffix: str) -> None:
    """Its name holds "sRGB"; in 8 bits its shadows would be 13 levels apart."""
    path = tmp_path / f"a{suffix}"
    linear_16(path, rgb_profile(BT709, 1.0, "sRGB linear"))
    read = read_photo(path)
    assert np.abs(read.pixels.astype(int) - photo()).max() <= 1
    assert read.notes == ("linear picture: 1.0 taken as white",)


def test_8_bit_linear_is_near(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    stored = eight(in_space(BT709, lambda x: x, radiance=True))
    Image.fromarray(stored).save(path, icc_profile=rgb_profile(BT709, 1.0, "sRGB linear"))
    assert far(read_photo(path).pixels, photo()) < 1
    assert far(stored, photo()) > 40


def with_chunks(path: Path, chunks: dict[bytes, bytes]) -> Path:
    """Put chunks behind a PNG's header."""
    content = path.read_bytes()
    added = b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks.items()
    )
    path.write_bytes(content[:33] + added + content[33:])
    return path


def gama(exponent: float) -> bytes:
    return struct.pack(">I", round(exponent * 100_000))


def chrm(chromaticities: tuple[float, ...]) -> bytes:
    order = (*chromaticities[6:], *chromaticities[:6])
    return struct.pack(">8I", *(round(value * 100_000) for value in order))


PQ_SIGNAL = 16
PNGS = {  # signal, the chunks that say what it is
    "linear": (in_space(BT709, lambda x: x, True), {b"gAMA": gama(1.0)}),
    "gamma 1.8": (in_space(BT709, lambda x: x ** (1 / 1.8)), {b"gAMA": gama(1 / 1.8)}),
    "P3 primaries": (
        in_space(DISPLAY_P3, srgb_encode),
        {b"gAMA": gama(1 / 2.2), b"cHRM": chrm(DISPLAY_P3)},
    ),
    "P3": (in_space(DISPLAY_P3, srgb_encode), {b"cICP": bytes([12, 13, 0, 1])}),
    "BT.2020": (in_space(BT2020, srgb_encode), {b"cICP": bytes([9, 1, 0, 1])}),
    "HLG": (in_space(BT2020, hlg_from_radiance, True), {b"cICP": bytes([9, 18, 0, 1])}),
    "narrow": ((16 + 219 * (photo() / 255)) / 255, {b"cICP": bytes([1, 13, 0, 0])}),
    "narrow P3": (
        (16 + 219 * in_space(DISPLAY_P3, srgb_encode)) / 255,
        {b"cICP": bytes([12, 13, 0, 0])},
    ),
    "linear code": (in_space(BT709, lambda x: x, True), {b"cICP": bytes([1, 8, 0, 1])}),
    "cHRM alone": (in_space(DISPLAY_P3, srgb_encode), {b"cHRM": chrm(DISPLAY_P3)}),
    "sRGB": (photo() / 255, {b"sRGB": b"\0", b"gAMA": gama(1 / 2.2), b"cHRM": chrm(BT709)}),
    "sRGB wins over gAMA": (photo() / 255, {b"sRGB": b"\0", b"gAMA": gama(1.0)}),
    "gAMA of sRGB": (photo() / 255, {b"gAMA": gama(1 / 2.2)}),
    "cICP wins over gAMA": (photo() / 255, {b"cICP": bytes([1, 13, 0, 1]), b"gAMA": gama(1.0)}),
    "nonsense": (photo() / 255, {b"gAMA": gama(0), b"cHRM": bytes(32)}),
}


@pytest.mark.parametrize("name", PNGS)
def test_what_a_png_says_of_its_colours_is_obeyed(tmp_path: Path, name: str) -> None:
    signal, chunks = PNGS[name]
    path = tmp_path / "a.png"
    Image.fromarray(eight(signal)).save(path)
    with_chunks(path, chunks)
    assert far(read_photo(path).pixels, photo()) < 1
    if far(eight(signal), photo()):
        assert far(eight(signal), photo()) > 4
    else:
        assert read_photo(path).notes == ()


def pq(radiance: np.ndarray) -> np.ndarray:
    """ST 2084's inverse, written anew: 203 cd/m2 is white."""
    y = (radiance * 203 / 10_000) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y)) ** 78.84375


@pytest.mark.parametrize("suffix", [".png", ".avif", ".heic"])
def test_pq_is_brought_to_sdr(tmp_path: Path, suffix: str) -> None:
    signal = in_space(BT2020, pq, radiance=True)
    path = tmp_path / f"a{suffix}"
    if suffix == ".heic":
        heif = pytest.importorskip("pillow_heif")
        deep = np.round(signal * 65535).astype(np.uint16)
        heif.encode(
            "RGB;16",
            (96, 64),
            deep.tobytes(),
            path,
            quality=-1,
            chroma=444,
            color_primaries=9,
            transfer_characteristics=16,
            transfer_characteristic=16,
            matrix_coefficients=9,
            full_range_flag=1,
        )
    elif suffix == ".avif":
        Image.fromarray(eight(signal)).save(path, quality=98, subsampling="4:4:4")
        content = path.read_bytes()
        at = content.index(b"nclx") + 4
        path.write_bytes(content[:at] + struct.pack(">HH", 9, 16) + content[at + 4 :])
    else:
        Image.fromarray(eight(signal)).save(path)
        with_chunks(path, {b"cICP": bytes([9, 16, 0, 1])})
    read = read_photo(path)
    assert far(read.pixels, photo()) < (1.5 if suffix == ".png" else 4)
    assert far(eight(signal), photo()) > 15
    assert read.notes == ("BT.2020 PQ picture, brought to SDR: reference white is 1.0",)


def test_a_profile_that_names_code_points_is_taken_by_them(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    cicp = b"cicp\0\0\0\0" + bytes([9, 16, 0, 1])
    profile = rgb_profile(BT2020, 2.2, "Rec2100 PQ", cicp=cicp)
    Image.fromarray(eight(in_space(BT2020, pq, True))).save(path, quality=98, icc_profile=profile)
    assert far(read_photo(path).pixels, photo()) < 4


def test_a_profile_goes_before_code_points_but_for_hdr(tmp_path: Path) -> None:
    """AVIF encoders that are given a profile write default code points next to it."""
    path = tmp_path / "a.avif"
    stored = eight(in_space(ADOBE_RGB, lambda x: x ** (256 / 563)))
    profile = rgb_profile(ADOBE_RGB, 563 / 256, "Adobe RGB")
    Image.fromarray(stored).save(path, quality=98, subsampling="4:4:4", icc_profile=profile)
    assert far(read_photo(path).pixels, photo()) < 3


def test_adobe_rgb_of_cameras_without_a_profile(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA001] = 0xFFFF
    exif.get_ifd(0x8769)[0xA005] = {1: "R03"}
    path = tmp_path / "a.jpg"
    stored = eight(in_space(ADOBE_RGB, lambda x: x ** (256 / 563)))
    Image.fromarray(stored).save(path, quality=98, subsampling="4:4:4", exif=exif)
    assert far(read_photo(path).pixels, photo()) < 2
    assert read_photo(path).notes == ("Adobe RGB converted to sRGB",)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_a_grey_profile_is_applied(tmp_path: Path, suffix: str) -> None:
    grey = photo()[..., 0]
    stored = eight(srgb_decode(grey / 255) ** (1 / 1.4))
    path = tmp_path / f"a{suffix}"
    Image.fromarray(stored).save(path, icc_profile=grey_profile(1.4))
    assert far(read_photo(path).pixels, np.repeat(grey[..., None], 3, axis=2)) < 1.5


def test_a_grey_profile_may_give_lightness(tmp_path: Path) -> None:
    grey = photo()[..., 0]
    luminance = srgb_decode(grey / 255)
    lightness = 1.16 * np.cbrt(luminance) - 0.16  # CIE L*, all above its straight part
    path = tmp_path / "a.png"
    profile = grey_profile(np.linspace(0, 1, 2), b"Lab ")
    Image.fromarray(eight(lightness)).save(path, icc_profile=profile)
    assert far(read_photo(path).pixels, np.repeat(grey[..., None], 3, axis=2)) < 1.5
    assert luminance.min() > 0.00886


def test_transparency_is_laid_over_the_converted_colours(tmp_path: Path) -> None:
    stored = np.dstack([eight(in_space(DISPLAY_P3, srgb_encode)), np.full((64, 96), 255, np.uint8)])
    stored[:, :30, 3] = 0
    path = tmp_path / "a.png"
    Image.fromarray(stored).save(path, icc_profile=rgb_profile(DISPLAY_P3, name="Display P3"))
    read = read_photo(path)
    assert (read.pixels[:, :30] == 118).all()
    assert far(read.pixels[:, 30:], photo()[:, 30:]) < 1
    assert len(read.notes) == 2


def test_inks_go_through_their_look_up_table(tmp_path: Path) -> None:
    inks = np.zeros((64, 96, 4), np.uint8)
    inks[:32, :, 3] = 255
    inks[32:, :, 1] = 255
    for path in (tmp_path / "a.tif", tmp_path / "a.jpg"):
        Image.fromarray(inks, "CMYK").save(path, icc_profile=cmyk_profile(), quality=98)
        read = read_photo(path)
        assert read.pixels[:28].max() < 8
        lightness = 100 * 0.7  # Lab's, of full magenta in this profile
        grey = 255 * float(srgb_encode(np.array(((lightness + 16) / 116) ** 3)))
        np.testing.assert_allclose(read.pixels[40:], grey, atol=4)
        assert read.notes == ("inks converted to sRGB",)


@pytest.mark.parametrize("content", [b"", b"x" * 20, rgb_profile()[:150], rgb_profile()[:-40]])
def test_a_damaged_profile_does_not_stop_a_photo(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(photo()).save(path, icc_profile=content)
    np.testing.assert_array_equal(read_photo(path).pixels, photo())


def test_a_profile_for_other_pictures_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    Image.fromarray(photo()).save(path, icc_profile=cmyk_profile(), quality=98)
    read = read_photo(path)
    assert far(read.pixels, photo()) < 2
    assert read.notes == ("colour profile 'inks' does not fit the picture: read as sRGB",)


def test_white_stays_white_and_colours_come_back() -> None:
    for chromaticities in (DISPLAY_P3, BT2020, ADOBE_RGB, ACES_AP1, PROPHOTO):
        matrix = bt709_from_primaries(chromaticities)
        np.testing.assert_allclose(matrix @ np.ones(3), 1, atol=1e-6)
    np.testing.assert_allclose(bt709_from_primaries(BT709), np.eye(3), atol=1e-9)
    # BT.2087's own numbers, to the four digits it has.
    printed = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
    np.testing.assert_allclose(bt709_from_primaries(BT2020), printed, atol=1e-4)


def test_code_points_of_srgb_and_nonsense_convert_nothing() -> None:
    for primaries, transfer in ((1, 13), (2, 2), (1, 1), (6, 6), (5, 1), (250, 200), (1, 14)):
        assert from_cicp(primaries, transfer) is None
    for exponent in (0.0, -1.0, float("nan"), 1e9, 0.45455):
        assert from_gamma(exponent) is None


SAME = {  # of ../shared/cases: largest mean difference of pixels to upright.png
    "p3.png": 0.5,
    "p3.avif": 1.5,
    "linear_gama.png": 1,
    "pq_cicp.png": 1,
    "mif1.avif": 1,
    "phone_raw.dng": 0.5,
    "exif_focal_two_values.avif": 1,
    "exif_focal_two_values.heic": 1,
    "orientation6_no_irot.heic": 1,
}


@pytest.mark.parametrize("name", SAME)
def test_photos_of_other_programs(cases: Path, name: str) -> None:
    if name.endswith(".heic"):
        pytest.importorskip("pillow_heif")
    if name.endswith(".dng"):
        pytest.importorskip("rawpy")
    upright = read_photo(cases / "sound/upright.png").pixels
    assert far(read_photo(cases / "sound" / name).pixels, upright) < SAME[name]
    assert far(upright[:, ::-1], upright) > 10  # the test can fail
