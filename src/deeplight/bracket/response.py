"""The camera's response: linear light from stored pixel values.

Recovered from the bracket itself as Debevec and Malik, "Recovering high dynamic range radiance maps
from photographs", SIGGRAPH 1997, do it: one smooth curve per channel with which all exposures give
the same radiance. A chart of known reflectances in the picture adds what it says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from deeplight.bracket.exposures import Exposure
from deeplight.camera_response import GAMMA, decode

LEVELS = 256
SAMPLES = 250
SMOOTHNESS = 40.0
MIDDLE = 128
"""The level whose linear value is fixed: that of gamma 2.2, in every channel alike."""
_CHART_WEIGHT = 4.0


@dataclass(frozen=True, eq=False)
class Response:
    """Linear value of each of 256 levels, by channel; between them interpolated."""

    name: str
    curve: Float64[np.ndarray, "levels 3"]

    @classmethod
    def gamma(cls, gamma: float = GAMMA) -> "Response":
        """x^gamma; 1 is linear."""
        levels = np.arange(LEVELS) / (LEVELS - 1)
        return cls(f"gamma {gamma:g}", np.repeat(decode(levels, gamma)[:, None], 3, axis=1))

    def linear(self, pixels: Float32[np.ndarray, "*shape 3"]) -> Float32[np.ndarray, "*shape 3"]:
        """Linear light of stored values 0 to 1."""
        grid = np.arange(LEVELS) / (LEVELS - 1)
        channels = [np.interp(pixels[..., c], grid, self.curve[:, c]) for c in range(3)]
        return np.stack(channels, axis=-1).astype(np.float32)


@dataclass(frozen=True, eq=False)
class ChartSamples:
    """Grey patches of a chart.

    Attributes:
        pixels: mean stored value of each patch in each frame.
        reflectances: of each patch.
    """

    pixels: Float[np.ndarray, "frames patches 3"]
    reflectances: Float[np.ndarray, " patches"]


def recovered(frames: Sequence[Exposure], chart: ChartSamples | None = None) -> Response:
    """The response that explains a bracket, from some hundred of its quiet pixels."""
    rows, columns = quiet_pixels(frames)
    values = np.stack([frame.pixels[rows, columns] for frame in frames])  # (frames, samples, 3)
    logs = np.log([frame.amount for frame in frames])
    curves = [
        _solved(
            _levels(values[..., c]),
            logs,
            None if chart is None else (_levels(chart.pixels[..., c]), chart.reflectances),
        )
        for c in range(3)
    ]
    return Response("recovered from the bracket", np.stack(curves, axis=1))


def quiet_pixels(frames: Sequence[Exposure]) -> tuple[Int64[np.ndarray, " n"], ...]:
    """Rows and columns of pixels without edges, spread over all brightnesses."""
    middle = frames[len(frames) // 2].pixels.mean(-1)
    down, across = np.gradient(middle)
    edge = np.hypot(down, across) / (0.02 + middle)
    usable = sum(((f.pixels > 0.03) & (f.pixels < 0.97)).all(-1).astype(int) for f in frames) >= 2
    quiet = np.flatnonzero((edge <= np.quantile(edge, 0.5)) & usable)
    if not len(quiet):
        quiet = np.flatnonzero(usable) if np.any(usable) else np.arange(middle.size)
    light = sum(f.pixels.mean(-1) for f in frames).ravel()[quiet]
    ranked = quiet[np.argsort(light, kind="stable")]
    chosen = ranked[np.linspace(0, len(ranked) - 1, min(SAMPLES, len(ranked))).astype(int)]
    return np.unravel_index(chosen, middle.shape)


def _levels(values: Float[np.ndarray, "*shape"]) -> Float64[np.ndarray, "*shape"]:
    return np.clip(values.astype(np.float64), 0, 1) * (LEVELS - 1)


def _solved(
    levels: Float64[np.ndarray, "frames samples"],
    log_amounts: Float64[np.ndarray, " frames"],
    chart: tuple[Float64[np.ndarray, "frames patches"], Float[np.ndarray, " patches"]] | None,
) -> Float64[np.ndarray, " levels"]:
    """ln f at every level by least squares; unknown besides: ln radiance of every sample.

    Rows are weighted by a hat that falls to 0 at black and white. All patches of the chart share
    one unknown, the light that falls on it.
    """
    count = levels.shape[1]
    blocks = [_equations(levels, log_amounts, np.zeros(count), np.arange(count), 1.0, count + 1)]
    if chart is not None:
        patch_levels, reflectances = chart
        same = np.full(len(reflectances), count)
        known = np.log(reflectances)
        blocks.append(_equations(patch_levels, log_amounts, known, same, _CHART_WEIGHT, count + 1))
    blocks.append(_smoothness(count + 1))
    left = np.concatenate([block[0] for block in blocks])
    right = np.concatenate([block[1] for block in blocks])
    solution, *_ = np.linalg.lstsq(left, right, rcond=None)
    curve: Float64[np.ndarray, " levels"] = np.exp(solution[:LEVELS])
    return np.maximum.accumulate(curve)


def _equations(
    levels: Float64[np.ndarray, "frames samples"],
    log_amounts: Float64[np.ndarray, " frames"],
    known: Float64[np.ndarray, " samples"],
    unknown: Int64[np.ndarray, " samples"],
    weight: float,
    unknowns: int,
) -> tuple[np.ndarray, np.ndarray]:
    """g(level) - ln(unknown radiance) = ln(known factor) + ln(amount), a row for each value."""
    frame, sample = (index.ravel() for index in np.indices(levels.shape))
    level = levels.ravel()
    hat = weight * (np.minimum(level, LEVELS - 1 - level) / MIDDLE)
    hat[(level < 5) | (level > 250)] = 0
    left = np.zeros((len(level), LEVELS + unknowns))
    lower = np.minimum(level.astype(int), LEVELS - 2)
    part, row = level - lower, np.arange(len(level))
    left[row, lower] = hat * (1 - part)
    left[row, lower + 1] += hat * part
    left[row, LEVELS + unknown[sample]] -= hat
    return left, hat * (known[sample] + log_amounts[frame])


def _smoothness(unknowns: int) -> tuple[np.ndarray, np.ndarray]:
    """Second differences of g over ln level, which are 0 for any gamma; and the fixed middle."""
    left = np.zeros((LEVELS - 3 + 2, LEVELS + unknowns))
    at = np.log(np.arange(1, LEVELS))
    for row, level in enumerate(range(2, LEVELS - 1)):
        before, after = at[level - 1] - at[level - 2], at[level] - at[level - 1]
        scale = SMOOTHNESS * min(level, LEVELS - 1 - level) / MIDDLE
        left[row, level - 1] = scale * after / (before + after)
        left[row, level] = -scale
        left[row, level + 1] = scale * before / (before + after)
    right = np.zeros(len(left))
    left[-2, MIDDLE], right[-2] = 1e3, 1e3 * GAMMA * np.log(MIDDLE / (LEVELS - 1))
    left[-1, 0], left[-1, 1], right[-1] = 1.0, -1.0, -GAMMA * np.log(2)  # level 0 is never weighed
    return left, right
