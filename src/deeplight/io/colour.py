"""Colour spaces of photos, HDR images and films: the light that a stored value stands for.

One definition each of primaries, transfer curves and white, for every reader. Scale of HDR
signals, our choice: radiance 1.0, the camera's white of an SDR picture, is HDR reference white
(ITU-R BT.2408): 75 % of the HLG signal, 203 cd/m2 in PQ. What is brighter clips, as it would have
in an SDR recording; HLG holds 3.77 times white, PQ 49 times.

What a picture becomes: encoded pictures (Display P3, Adobe RGB, BT.2020 SDR) become sRGB; linear
and HDR ones are radiance and are encoded as floating-point files are, with `camera_response`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from jaxtyping import Float, Float32, Shaped, UInt8, UInt16

from deeplight.camera_response import encode

HLG_WHITE = 0.75  # signal of reference white, BT.2408
PQ_WHITE_NITS = 203.0
SIGNAL_MAX = 65535  # signals are 16-bit
MID_GREY = 118
"""sRGB of an 18 % reflector: what a metered camera makes of an unknown scene."""

_A = 0.17883277  # BT.2100, table 5
_B, _C = 1 - 4 * _A, 0.5 - _A * float(np.log(4 * _A))
_M1, _M2 = 2610 / 16384, 2523 / 4096 * 128  # SMPTE ST 2084
_C1, _C2, _C3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32

D65, _D60, _ILLUMINANT_C = (0.3127, 0.3290), (0.32168, 0.33767), (0.310, 0.316)
BT709 = (0.640, 0.330, 0.300, 0.600, 0.150, 0.060, *D65)
"""Chromaticities x, y of red, green, blue and white, as all of these."""
BT2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *D65)
DISPLAY_P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *D65)
DCI_P3 = (*DISPLAY_P3[:6], 0.314, 0.351)
ADOBE_RGB = (0.640, 0.330, 0.210, 0.710, 0.150, 0.060, *D65)
ACES_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, *_D60)
ACES_AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, *_D60)
CIE_XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
CIE_XYZ_D65 = (*CIE_XYZ[:6], *D65)

PRIMARIES = {  # ITU-T H.273, table 2
    4: ("BT.470 M", (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, *_ILLUMINANT_C)),
    8: ("film", (0.681, 0.319, 0.243, 0.692, 0.145, 0.049, *_ILLUMINANT_C)),
    9: ("BT.2020", BT2020),
    10: ("CIE XYZ", CIE_XYZ),
    11: ("DCI P3", DCI_P3),
    12: ("Display P3", DISPLAY_P3),
}
"""Those that differ visibly from sRGB's. Missing: BT.709, unspecified, and the primaries of
standard-definition television (5, 6, 7, 22), which many phones name for want of thought."""

Signal = Float[np.ndarray, "*signal"]
Matrix = Float[np.ndarray, "3 3"]
_ROWS = 64  # converted at once: as much as stays in a core's cache


def srgb_decode(pixel: Signal) -> Signal:
    """Linear values of sRGB pixels, 0 to 1 (IEC 61966-2-1)."""
    return np.where(pixel <= 0.04045, pixel / 12.92, ((pixel + 0.055) / 1.055) ** 2.4)


def srgb_encode(linear: Signal) -> Signal:
    """sRGB pixels of linear values, 0 to 1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def radiance_from_hlg(signal: Signal) -> Signal:
    """Radiance relative to reference white of an HLG signal, 0 to 1: the inverse OETF."""
    return np.asarray(_scene_from_hlg(signal) / _white_in_hlg())


def hlg_from_radiance(radiance: Signal) -> Signal:
    """The HLG signal, 0 to 1, of radiance relative to reference white (BT.2100's OETF)."""
    scene = np.clip(radiance * _white_in_hlg(), 0, 1)
    bright = _A * np.log(np.maximum(12 * scene - _B, 1e-9)) + _C
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), bright)


def radiance_from_pq(signal: Signal) -> Signal:
    """Radiance relative to 203 cd/m2 of a PQ signal, 0 to 1 (ST 2084's EOTF)."""
    root = np.maximum(signal, 0) ** (1 / _M2)
    return 10000 / PQ_WHITE_NITS * (np.maximum(root - _C1, 0) / (_C2 - _C3 * root)) ** (1 / _M1)


def power_curve(gamma: float) -> Callable[[Signal], Signal]:
    """The curve x^gamma, for signals 0 to 1."""
    return lambda signal: np.maximum(signal, 0) ** gamma


def _linear(signal: Signal) -> Signal:
    return signal


def _logarithmic(decades: float) -> Callable[[Signal], Signal]:
    return lambda signal: np.where(signal > 0, 10.0 ** (decades * (signal - 1)), 0)


TRANSFERS: dict[int, tuple[str, Callable[[Signal], Signal], bool]] = {  # ITU-T H.273, table 3
    4: ("gamma 2.2", power_curve(2.2), False),
    5: ("gamma 2.8", power_curve(2.8), False),
    8: ("linear", _linear, True),
    9: ("logarithmic", _logarithmic(2.0), True),
    10: ("logarithmic", _logarithmic(2.5), True),
    16: ("PQ", radiance_from_pq, True),
    17: ("DCI gamma", lambda signal: 52.37 / 48 * np.maximum(signal, 0) ** 2.6, False),
    18: ("HLG", radiance_from_hlg, True),
}
"""Name, curve and whether it gives radiance. Missing: sRGB, unspecified and all curves of BT.709's
shape, which players show as if they were sRGB."""

HDR_TRANSFERS = {number: TRANSFERS[number][0] for number in (16, 18)}


@dataclass(frozen=True, eq=False)
class ColourSpace:
    """What stored RGB means, and how it becomes the product's 8-bit pixels.

    Attributes:
        name: as people know it.
        bt709_from_linear: of linear colours, to sRGB's primaries.
        curve: linear values, 1 = white, of a signal 0 to 1.
        is_radiance: a linear or HDR picture, encoded with `camera_response` instead of sRGB.
        is_narrow: black is 16 and white 235 of 255, as in films.
    """

    name: str
    bt709_from_linear: Matrix
    curve: Callable[[Signal], Signal] = srgb_decode
    is_radiance: bool = False
    is_narrow: bool = False

    def pixels(
        self, stored: Shaped[np.ndarray, "height width 3"]
    ) -> UInt8[np.ndarray, "height width 3"]:
        """8-bit pixels of 8- or 16-bit stored ones; over white and outside sRGB clips."""
        table = self._linear8 if stored.dtype == np.uint8 else self._linear16
        to_pixel = pixel_table(self.is_radiance)
        turn = self.bt709_from_linear.T.astype(np.float32)
        result = np.empty(stored.shape, np.uint8)
        for start in range(0, stored.shape[0], _ROWS):
            rows = slice(start, start + _ROWS)
            linear = table[stored[rows]] @ turn
            np.clip(linear, 0, 1, out=linear)
            linear *= SIGNAL_MAX
            result[rows] = to_pixel[linear.astype(np.uint16)]
        return result

    @cached_property
    def _linear8(self) -> Float32[np.ndarray, "n"]:
        return self._table(8)

    @cached_property
    def _linear16(self) -> Float32[np.ndarray, "n"]:
        return self._table(16)

    def _table(self, bits: int) -> Float32[np.ndarray, "n"]:
        stored, unit = np.arange(1 << bits), 1 << (bits - 8)
        low, span = (16 * unit, 219 * unit) if self.is_narrow else (0, (1 << bits) - 1)
        return np.asarray(self.curve(np.clip((stored - low) / span, 0, 1)), np.float32)


def is_srgb(convert: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Whether a conversion of 8-bit RGB changes no colour by more than two levels of 255."""
    level = np.arange(0, 256, 17).astype(np.uint8)
    probe = np.stack(np.meshgrid(level, level, level), axis=-1).reshape(16, -1, 3)
    return bool(np.abs(convert(probe).astype(int) - probe).max() <= 2)


def eight_bit(stored: Shaped[np.ndarray, "*picture"]) -> UInt8[np.ndarray, "*picture"]:
    """Rounded 8-bit values of 8- or 16-bit ones."""
    if stored.dtype == np.uint8:
        return stored
    return ((stored.astype(np.uint32) + 128) // 257).astype(np.uint8)


@lru_cache(maxsize=32)
def bt709_from_primaries(chromaticities: tuple[float, ...]) -> Matrix:
    """Linear sRGB colours of linear RGB with these x, y of red, green, blue and white.

    White becomes white: adapted to D65 as Bradford does.

    Raises:
        ValueError: no eight finite numbers of which a colour space can be made.
    """
    return np.linalg.inv(_d65_xyz_from_rgb(BT709)) @ _d65_xyz_from_rgb(chromaticities)


@lru_cache(maxsize=32)
def from_cicp(primaries: int, transfer: int, full_range: bool = True) -> ColourSpace | None:
    """The colour space of H.273's code points; None where pixels are to be taken as sRGB."""
    if not full_range:
        space = from_cicp(primaries, transfer) or ColourSpace("sRGB", np.eye(3))
        return replace(space, name=f"narrow-range {space.name}", is_narrow=True)
    gamut = PRIMARIES.get(primaries)
    curve = TRANSFERS.get(transfer)
    if gamut is None and curve is None:
        return None
    name = " ".join(part[0] for part in (gamut, curve) if part)
    matrix = bt709_from_primaries(gamut[1] if gamut else BT709)
    if curve is None:
        return ColourSpace(name, matrix)
    return ColourSpace(name, matrix, curve[1], curve[2])


def from_gamma(gamma: float, chromaticities: Sequence[float] = BT709) -> ColourSpace | None:
    """The colour space of PNG's gAMA and cHRM; None where pixels are to be taken as sRGB.

    gAMA is the encoding exponent. 1/2.2, which every PNG writer means as "sRGB", is taken so.
    """
    if not 0.05 < gamma < 20:
        return None
    curve = srgb_decode if abs(gamma * 2.2 - 1) < 0.02 else power_curve(1 / gamma)
    try:
        matrix = bt709_from_primaries(tuple(chromaticities))
    except ValueError:
        matrix = np.eye(3)
    name = "linear" if gamma == 1 else f"gamma {1 / gamma:.1f}"
    space = ColourSpace(name, matrix, curve, is_radiance=abs(gamma - 1) < 0.01)
    return None if is_srgb(space.pixels) else space


def sdr_luma(
    signal: UInt16[np.ndarray, "height width"], transfer: int
) -> UInt8[np.ndarray, "height width"]:
    """8-bit grey of the luma plane of an HDR signal, taken as grey."""
    radiance = np.minimum(TRANSFERS[transfer][1](signal / SIGNAL_MAX), 1)
    return pixel_table(True)[(radiance * SIGNAL_MAX).astype(np.uint16)]


def hlg_pixels(
    radiance: Float[np.ndarray, "height width 3"],
) -> UInt16[np.ndarray, "height width 3"]:
    """The 16-bit BT.2020 HLG signal of BT.709 radiance relative to reference white."""
    wide = radiance @ np.linalg.inv(bt709_from_primaries(BT2020)).T.astype(radiance.dtype)
    # By table: a logarithm for each of six million values would take a second a frame.
    table = _hlg_table()
    index = np.sqrt(np.clip(wide / _HLG_PEAK, 0, 1)) * (len(table) - 1) + 0.5
    return table[index.astype(np.int32)]


@lru_cache(maxsize=2)
def pixel_table(is_radiance: bool) -> UInt8[np.ndarray, "n"]:
    """The 8-bit pixel of each 16-bit linear value, radiance's or sRGB's."""
    linear = np.arange(SIGNAL_MAX + 1) / SIGNAL_MAX
    encoded = encode(linear) if is_radiance else srgb_encode(linear)
    return np.round(encoded * 255).astype(np.uint8)


_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def _adapted(from_white: Float[np.ndarray, "3"], to_white: Float[np.ndarray, "3"]) -> Matrix:
    """Bradford's adaptation of XYZ from one white to another."""
    gain = (_BRADFORD @ to_white) / (_BRADFORD @ from_white)
    return np.linalg.inv(_BRADFORD) @ np.diag(gain) @ _BRADFORD


def _d65_xyz_from_rgb(chromaticities: tuple[float, ...]) -> Matrix:
    xy = np.array(chromaticities, float)
    if xy.shape != (8,) or not np.isfinite(xy).all() or xy[7] <= 0:
        raise ValueError(f"chromaticities of four colours, not {chromaticities}")
    points = np.column_stack([xy[0::2], xy[1::2], 1 - xy[0::2] - xy[1::2]])
    white = points[3] / points[3, 1]
    try:
        scale = np.linalg.solve(points[:3].T, white)
    except np.linalg.LinAlgError as error:
        raise ValueError("three primaries on one line") from error
    d65 = np.array([D65[0], D65[1], 1 - sum(D65)]) / D65[1]
    return _adapted(white, d65) @ (points[:3].T * scale)


def _scene_from_hlg(signal: Signal) -> Signal:
    bright = (np.exp((np.maximum(signal, 0.5) - _C) / _A) + _B) / 12
    return np.where(signal <= 0.5, signal**2 / 3, bright)


def _white_in_hlg() -> float:
    return float(_scene_from_hlg(np.array(HLG_WHITE)))


_HLG_PEAK = float(radiance_from_hlg(np.array(1.0)))


@lru_cache(maxsize=1)
def _hlg_table() -> UInt16[np.ndarray, "n"]:
    root = np.linspace(0, 1, 1 << 14)
    signal = hlg_from_radiance(root**2 * _HLG_PEAK)
    return np.round(signal * SIGNAL_MAX).astype(np.uint16)


def over_grey(
    encoded: UInt8[np.ndarray, "*pixels"], cover: UInt8[np.ndarray, "..."], straight: bool = True
) -> UInt8[np.ndarray, "*pixels"]:
    """Lay encoded colours over mid-grey: what is seen through is as unknown as can be.

    Args:
        encoded: gamma-encoded.
        cover: alpha, 255 where nothing shines through.
        straight: colours are not multiplied by alpha yet.
    """
    share = cover.astype(np.uint32)
    colour = encoded * (share if straight else np.uint32(255))
    mixed = (colour + MID_GREY * (255 - share) + 127) // 255
    return np.minimum(mixed, 255).astype(np.uint8)
