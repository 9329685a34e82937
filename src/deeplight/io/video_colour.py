"""HDR video to SDR pixels and back: HLG and PQ transfer curves, BT.2020 and BT.709 colours.

Scale, our choice: radiance 1.0, the camera's white of an SDR picture, is HDR reference white
(ITU-R BT.2408): 75 % of the HLG signal, 203 cd/m2 in PQ. What is brighter clips, as it would
have in an SDR recording; HLG holds 3.77 times white, PQ 49 times.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from deeplight.camera_response import encode

HLG_WHITE = 0.75  # signal of reference white, BT.2408
PQ_WHITE_NITS = 203.0
SIGNAL_MAX = 65535  # signals are 16-bit

_A = 0.17883277  # BT.2100, table 5
_B, _C = 1 - 4 * _A, 0.5 - _A * float(np.log(4 * _A))
_M1, _M2 = 2610 / 16384, 2523 / 4096 * 128  # SMPTE ST 2084
_C1, _C2, _C3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32

_BT709_FROM_2020 = np.array(  # linear RGB, BT.2087
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
)
_BT2020_FROM_709 = np.linalg.inv(_BT709_FROM_2020)

Signal = Float[np.ndarray, "*signal"]


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


TO_RADIANCE = {"HLG": radiance_from_hlg, "PQ": radiance_from_pq}


def sdr_pixels(
    signal: UInt16[np.ndarray, "height width 3"], transfer: str
) -> UInt8[np.ndarray, "height width 3"]:
    """8-bit gamma 2.2 BT.709 pixels of a BT.2020 "HLG" or "PQ" signal; over white clips."""
    to_radiance, to_pixel = _tables(transfer)
    linear = to_radiance[signal >> 4] @ _BT709_FROM_2020.T.astype(np.float32)
    np.clip(linear, 0, 1, out=linear)
    linear *= SIGNAL_MAX
    return to_pixel[linear.astype(np.uint16)]


def sdr_luma(
    signal: UInt16[np.ndarray, "height width"], transfer: str
) -> UInt8[np.ndarray, "height width"]:
    """The same for the luma plane alone, taken as grey."""
    to_radiance, to_pixel = _tables(transfer)
    grey = (np.minimum(to_radiance, 1) * SIGNAL_MAX).astype(np.uint16)
    return to_pixel[grey][signal >> 4]


def hlg_pixels(
    radiance: Float[np.ndarray, "height width 3"],
) -> UInt16[np.ndarray, "height width 3"]:
    """The 16-bit BT.2020 HLG signal of BT.709 radiance relative to reference white."""
    wide = radiance @ _BT2020_FROM_709.T.astype(radiance.dtype)
    # By table: a logarithm for each of six million values would take a second a frame.
    table = _hlg_table()
    index = np.sqrt(np.clip(wide / _HLG_PEAK, 0, 1)) * (len(table) - 1) + 0.5
    return table[index.astype(np.int32)]


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


@lru_cache(maxsize=2)
def _tables(transfer: str) -> tuple[Float[np.ndarray, "n"], UInt8[np.ndarray, "m"]]:
    """Radiance of each 12-bit signal, and the 8-bit pixel of each 16-bit radiance."""
    to_radiance = TO_RADIANCE[transfer]((np.arange(4096) + 0.5) / 4096).astype(np.float32)
    to_pixel = np.round(encode(np.arange(SIGNAL_MAX + 1) / SIGNAL_MAX) * 255).astype(np.uint8)
    return to_radiance, to_pixel
