"""Box plots of the relative radiance error, per channel (the paper's figure of radiance)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64
from PIL import Image, ImageDraw, ImageFont

from deeplight.dataset.contact_sheet import Picture
from deeplight.evaluate.figures.spheres import title_lines
from deeplight.evaluate.scores import CHANNELS, Report, Scores

LOW, HIGH = -1.0, 3.0  # of the axis; what lies beyond is put in words
COLOURS = ((214, 68, 60), (68, 160, 80), (66, 110, 214))
INK, SOFT, LINE, PAPER = (40, 44, 52), (110, 116, 126), (224, 224, 220), (253, 253, 252)
_SHARPER = 2  # drawn so much larger than the caption's own pixels, for dense screens
_GROUP, _HEIGHT, _LEFT, _TOP, _BOTTOM = 92, 260, 46, 26, 40


@dataclass(frozen=True)
class Box:
    """Five numbers of a column, and how many values there are.

    The whiskers end at the last values within 1.5 box lengths of the box (Tukey); `beyond` counts
    the others, which are not drawn one by one.
    """

    low: float
    first: float
    median: float
    third: float
    high: float
    beyond: int


def box_of(values: Float64[np.ndarray, " examples"]) -> Box | None:
    """Summarise the finite values; None if there are none."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    first, median, third = np.percentile(values, (25, 50, 75))
    reach = 1.5 * (third - first)
    near = values[(values >= first - reach) & (values <= third + reach)]
    beyond = len(values) - len(near)
    return Box(
        float(near.min()), float(first), float(median), float(third), float(near.max()), beyond
    )


def radiance_figure(
    report: Report, names: Sequence[str], scene: str, against: Literal["filmed", "true"] = "filmed"
) -> Picture:
    """(predicted - filmed) / filmed of the sum over the linear diffuse sphere.

    For each estimator three boxes, red, green and blue.

    Args:
        against: the filmed sphere, or that rendered in the true light, where it is known.
    """
    s = _SHARPER
    width = _LEFT + _GROUP * len(names) + 10
    canvas = Image.new("RGB", (width * s, _HEIGHT * s), PAPER)
    draw = ImageDraw.Draw(canvas)
    _axis(draw, width, f"{scene}: (predicted - {against}) / {against}")
    inside = report.inside(scene)
    for number, name in enumerate(names):
        left = _LEFT + number * _GROUP
        values = _relative_radiance(report.scores[name], against)[inside]
        for channel, colour in enumerate(COLOURS):
            box = box_of(values[:, channel])
            if box is not None:
                _draw_box(draw, left + 20 + channel * 22, box, colour)
        _name(draw, left + _GROUP // 2, name)
    return np.asarray(canvas)


def _up(value: float) -> float:
    share = (np.clip(value, LOW, HIGH) - LOW) / (HIGH - LOW)
    return float(_HEIGHT - _BOTTOM - share * (_HEIGHT - _BOTTOM - _TOP))


def _relative_radiance(scores: Scores, against: str) -> Float64[np.ndarray, "examples 3"]:
    if against == "filmed":
        return scores.relative_radiance
    return np.stack([scores.more[f"true_radiance_{channel}"] for channel in CHANNELS], axis=1)


def _axis(draw: ImageDraw.ImageDraw, width: int, title: str) -> None:
    s = _SHARPER
    for value in range(int(LOW), int(HIGH) + 1):
        y = _up(value) * s
        draw.line((_LEFT * s, y, (width - 10) * s, y), SOFT if value == 0 else LINE, s)
        draw.text(((_LEFT - 8) * s, y), f"{value:+d}" if value else "0", SOFT, _font(11), "rm")
    draw.text((8 * s, 6 * s), title, INK, _font(12))


def _draw_box(draw: ImageDraw.ImageDraw, x: int, box: Box, colour: tuple[int, int, int]) -> None:
    s, half = _SHARPER, 8
    for end, near in ((box.low, box.first), (box.high, box.third)):
        draw.line((x * s, _up(end) * s, x * s, _up(near) * s), colour, s)
        draw.line(((x - 4) * s, _up(end) * s, (x + 4) * s, _up(end) * s), colour, s)
    pale = tuple(round(0.25 * c + 0.75 * p) for c, p in zip(colour, PAPER, strict=True))
    top, bottom = _up(box.third) * s, _up(box.first) * s
    draw.rectangle(((x - half) * s, top, (x + half) * s, bottom), pale, colour, s)
    y = _up(box.median) * s
    draw.line(((x - half) * s, y, (x + half) * s, y), colour, 2 * s)


def _name(draw: ImageDraw.ImageDraw, x: int, name: str) -> None:
    for line, text in enumerate(title_lines(name)):
        y = (_HEIGHT - _BOTTOM + 6 + 14 * line) * _SHARPER
        draw.text((x * _SHARPER, y), text[:15], INK, _font(11), "ma")


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * _SHARPER)
