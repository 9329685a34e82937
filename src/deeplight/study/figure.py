"""The strengths of all methods as dots with their intervals."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

INK, SOFT, LINE, PAPER, DOT = (40, 44, 52), (110, 116, 126), (224, 224, 220), (253, 253, 252), (
    66, 110, 214,
)  # fmt: skip
_SHARPER = 2  # drawn so much larger than shown, for dense screens
_ROW, _LEFT, _WIDTH, _RIGHT, _TOP, _BOTTOM = 30, 150, 420, 24, 14, 40

Dot = tuple[str, float, float, float]


def strengths_figure(dots: Sequence[Dot]) -> UInt8[np.ndarray, "height width 3"]:
    """Draw (name, strength, low, high), the first on top; an interval that is NaN is left out."""
    s = _SHARPER
    height = _TOP + _ROW * len(dots) + _BOTTOM
    canvas = Image.new("RGB", ((_LEFT + _WIDTH + _RIGHT) * s, height * s), PAPER)
    draw = ImageDraw.Draw(canvas)
    low, high = _limits(dots)
    floor = height - _BOTTOM

    def across(value: float) -> float:
        return (_LEFT + (value - low) / (high - low) * _WIDTH) * s

    step = 0.5 if high - low <= 5 else 1.0
    for tick in np.arange(low, high + step / 2, step):
        x = across(tick)
        draw.line((x, _TOP * s, x, floor * s), SOFT if abs(tick) < 1e-9 else LINE, s)
        draw.text((x, (floor + 4) * s), f"{tick:+.1f}", SOFT, _font(11), "ma")
    draw.text(
        (across((low + high) / 2), (floor + 20) * s),
        "strength, log odds of being chosen",
        INK,
        _font(11),
        "ma",
    )
    for number, (name, value, least, most) in enumerate(dots):
        y = (_TOP + _ROW * (number + 0.5)) * s
        draw.text(((_LEFT - 12) * s, y), name[:22], INK, _font(12), "rm")
        if np.isfinite(least):
            draw.line((across(least), y, across(most), y), DOT, 2 * s)
        draw.ellipse((across(value) - 5 * s, y - 5 * s, across(value) + 5 * s, y + 5 * s), DOT)
    return np.asarray(canvas)


def _limits(dots: Sequence[Dot]) -> tuple[float, float]:
    values = [value for _, *numbers in dots for value in numbers if np.isfinite(value)]
    return float(np.floor(min(values) * 2) / 2), float(np.ceil(max(values) * 2 + 1e-9) / 2)


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * _SHARPER)
