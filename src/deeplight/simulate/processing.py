"""What a phone's computer makes of a picture: colour matrix, local tone mapping, curve, detail.

All constants are our choice. Linear 1.0 is the camera's nominal white. A curve that rolls
highlights off and an S-curve leave a middle grey near where plain gamma puts it, and local tone
mapping leaves the picture's mean: the unit of the light to predict hardly depends on them.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.camera_response import GAMMA, LUMINANCE, encode
from deeplight.mappings import resample

_MOST_LIFTED, _MOST_DIMMED = np.log(4.0), np.log(4.0)
_CELLS_HIGH = 24  # of the coarse picture that local tone mapping looks at
_EDGE = 0.15  # variance of ln luminance above which an edge stays sharp

Matrix = tuple[tuple[float, float, float], ...]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Processing:
    """How a phone develops its pictures; the defaults do nothing.

    Attributes:
        matrix: sRGB from the sensor's colours; rows sum to 1, so white stays white.
        local: share of the contrast between large areas that local tone mapping removes, 0 to 1.
        headroom: linear value that becomes the brightest pixel: 1 clips at white, more rolls
            highlights off (towards HLG's logarithm).
        knee: linear value from which they roll off.
        gamma: exponent of the encoding.
        contrast: of the S-curve; negative flattens.
        detail: sharpening of the small picture; negative is noise reduction's softness.
        chroma_blur: 0 to 1, of noise reduction.
    """

    matrix: Matrix = IDENTITY
    local: float = 0.0
    headroom: float = 1.0
    knee: float = 0.6
    gamma: float = GAMMA
    contrast: float = 0.0
    detail: float = 0.0
    chroma_blur: float = 0.0


def in_srgb(
    linear: Float32[np.ndarray, "*batch 3"], processing: Processing
) -> Float32[np.ndarray, "*batch 3"]:
    """Linear values after the colour matrix, not negative."""
    matrix = np.array(processing.matrix, np.float32)
    return np.maximum(linear @ matrix.T, 0)


def process(
    linear: Float32[np.ndarray, "height width 3"], processing: Processing
) -> UInt8[np.ndarray, "height width 3"]:
    """The 8-bit picture of linear sRGB values: local tone mapping, curve, detail."""
    if processing.local:
        linear = linear * local_gain(linear, processing.local)[..., None]
    pixel = encode(np.minimum(rolled_off(linear, processing), 1), processing.gamma)
    pixel = pixel + np.float32(processing.contrast) * pixel * (1 - pixel) * (2 * pixel - 1)
    pixel = _detailed(pixel, processing)
    return np.round(np.clip(pixel, 0, 1) * 255).astype(np.uint8)


def rolled_off(
    linear: Float32[np.ndarray, "*batch"], processing: Processing
) -> Float32[np.ndarray, "*batch"]:
    """Values as they are below the knee, above it along a logarithm that ends at 1.

    Its slope at the knee is 1, as HLG's curve (ITU-R BT.2100) has no kink where its logarithm
    begins. Values above the headroom exceed 1.
    """
    knee, headroom = processing.knee, processing.headroom
    if headroom <= 1:
        return linear
    bend = _bend((headroom - knee) / (1 - knee))
    above = np.maximum(linear - knee, 0) / (headroom - knee)
    rolled = knee + (1 - knee) * np.log1p(bend * above) / np.log1p(bend)
    return np.where(linear > knee, rolled, linear).astype(np.float32)


def local_gain(
    linear: Float32[np.ndarray, "height width 3"], share: float
) -> Float32[np.ndarray, "height width"]:
    """Gain that takes `share` of the contrast between large areas away, sharp at their edges.

    The large areas are ln luminance after a guided filter (He et al. 2010), found on a coarse
    picture and brought back as the filter's line, which keeps edges where the fine picture has
    them.
    """
    height, width, _ = linear.shape
    log_luminance = np.log(linear @ LUMINANCE.astype(np.float32) + np.float32(1e-3))
    rows = min(_CELLS_HIGH, height)
    columns = max(2, min(round(rows * width / height), width))
    values = np.stack([log_luminance, log_luminance**2], axis=-1)
    coarse = _blurred(resample.shrink(values, rows, columns), 2)
    mean, variance = coarse[..., 0], np.maximum(coarse[..., 1] - coarse[..., 0] ** 2, 0)
    slope = variance / (variance + _EDGE)
    line = _blurred(np.stack([slope, mean * (1 - slope)], axis=-1), 2)
    slope, offset = (_enlarged(line[..., k], height, width) for k in (0, 1))
    area = slope * log_luminance + offset
    wanted = -share * (area - area.mean())  # so that the picture stays as bright as it is
    return np.exp(np.clip(wanted, -_MOST_DIMMED, _MOST_LIFTED)).astype(np.float32)


@lru_cache(maxsize=1024)
def _bend(ratio: float) -> float:
    """The c of log(1 + c t) / log(1 + c) whose slope at 0 is `ratio` (above 1)."""
    low, high = 1e-6, 1e6
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if middle / np.log1p(middle) < ratio else (low, middle)
    return float(np.sqrt(low * high))


def _detailed(pixel: np.ndarray, processing: Processing) -> np.ndarray:
    """Sharpened or softened, its colours blurred."""
    if not processing.detail and not processing.chroma_blur:
        return pixel
    soft = _blurred(pixel, 1)
    rough = pixel - soft
    grey = (rough @ LUMINANCE.astype(np.float32))[..., None]
    chroma = (rough - grey) * np.float32(1 - processing.chroma_blur)
    result: np.ndarray = soft + grey * np.float32(1 + processing.detail) + chroma
    return result


def _blurred(values: np.ndarray, times: int) -> np.ndarray:
    """Blurred by 1-2-1 along rows and columns, `times` over; edges go on."""
    for _ in range(2 * times):
        pairs = values[1:] + values[:-1]  # 1-2-1 is 1-1 twice
        blurred = np.empty_like(values)
        np.add(pairs[1:], pairs[:-1], out=blurred[1:-1])
        blurred[0], blurred[-1] = pairs[0] + 2 * values[0], pairs[-1] + 2 * values[-1]
        blurred *= 0.25
        values = blurred.swapaxes(0, 1)  # after rows come columns, then rows again
    return values


def _enlarged(
    values: Float[np.ndarray, "rows columns"], height: int, width: int
) -> Float32[np.ndarray, "height width"]:
    """Bilinear, edges held."""
    rows, columns = values.shape
    return _between(rows, height) @ values.astype(np.float32) @ _between(columns, width).T


@lru_cache(maxsize=256)
def _between(few: int, many: int) -> Float32[np.ndarray, "many few"]:
    """Weights that interpolate `few` samples at `many` places."""
    place = np.clip((np.arange(many) + 0.5) * (few / many) - 0.5, 0, few - 1)
    weights = np.maximum(1 - abs(place[:, None] - np.arange(few)), 0).astype(np.float32)
    weights.setflags(write=False)
    return weights
