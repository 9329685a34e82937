"""A line chart as numbers for an inline SVG: curves, marks, and round numbers on the axes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

WIDTH, HEIGHT = 720, 220  # of the drawing, in the SVG's own units
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 10, 34  # margins for numbers and names
MOST_POINTS = 600  # of a curve; more cannot be seen and make the file large


@dataclass(frozen=True)
class Curve:
    """One line; values that are not finite break it. `tone` 0 to 4 chooses its colour."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    tone: int = 0


@dataclass(frozen=True)
class Mark:
    """Places on the x axis to point out, such as the frames that were dropped."""

    name: str
    x: Sequence[float]
    tone: int = 3


@dataclass(frozen=True)
class Chart:
    """Curves over one x axis.

    Attributes:
        title: says what is to be seen; the alternative text too.
        curves: at least one.
        marks: ticks along the bottom.
        x_name, y_name: with their units.
        level: a horizontal line, such as a limit.
    """

    title: str
    curves: Sequence[Curve]
    marks: Sequence[Mark] = ()
    x_name: str = ""
    y_name: str = ""
    level: float | None = None
    kind: Literal["chart"] = "chart"

    width, height = WIDTH, HEIGHT
    left, right, top, bottom = LEFT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM

    @cached_property
    def x_limits(self) -> tuple[float, float]:
        return _limits([x for curve in self.curves for x in curve.x])

    @cached_property
    def y_limits(self) -> tuple[float, float]:
        values = [y for curve in self.curves for y in curve.y]
        ticks = round_numbers(*_limits(values if self.level is None else [*values, self.level]))
        return ticks[0], ticks[-1]

    def lines(self, curve: Curve) -> list[str]:
        """Give `curve` as the point lists of polylines, one for each unbroken stretch."""
        step = max(1, math.ceil(len(curve.x) / MOST_POINTS))
        stretches: list[list[str]] = [[]]
        for x, y in list(zip(curve.x, curve.y, strict=True))[::step]:
            if math.isfinite(y):
                stretches[-1].append(f"{self.across(x):.1f},{self.up(y):.1f}")
            elif stretches[-1]:
                stretches.append([])
        return [" ".join(points) for points in stretches if points]

    def across(self, x: float) -> float:
        """Where `x` lies in the drawing."""
        low, high = self.x_limits
        return self.left + (x - low) / (high - low) * (self.right - self.left)

    def up(self, y: float) -> float:
        """Where `y` lies in the drawing."""
        low, high = self.y_limits
        return self.bottom - (y - low) / (high - low) * (self.bottom - self.top)

    def x_ticks(self) -> list[tuple[float, str]]:
        """Give the places and texts of round numbers below the drawing."""
        low, high = self.x_limits
        ticks = [x for x in round_numbers(low, high, 8) if low <= x <= high]
        return [(self.across(x), f"{x:g}") for x in ticks]

    def y_ticks(self) -> list[tuple[float, str]]:
        """Give the places and texts of round numbers left of the drawing."""
        return [(self.up(y), f"{y:g}") for y in round_numbers(*self.y_limits)]


def round_numbers(low: float, high: float, about: int = 4) -> list[float]:
    """Give evenly spaced round numbers (1, 2 or 5 times a power of ten) that enclose low to high.

    Their count is about `about`.
    """
    wanted = (high - low) / about
    decade = 10.0 ** math.floor(math.log10(wanted))
    sizes = [size * decade for size in (1, 2, 5, 10)]
    step = next((a for a, b in pairwise(sizes) if wanted < math.sqrt(a * b)), sizes[-1])
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(n * step, 12) for n in range(first, last + 1)]


def _limits(values: Sequence[float]) -> tuple[float, float]:
    finite = [value for value in values if math.isfinite(value)]
    low, high = min(finite, default=0.0), max(finite, default=1.0)
    if high - low > 1e-9 * max(abs(low), abs(high)):
        return low, high
    room = abs(low) / 2 or 0.5  # a curve of one value runs through the middle
    return low - room, high + room
