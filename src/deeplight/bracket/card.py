"""What a grey card or a colour chart in the picture says of colour, scale and response."""

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, Float32

from deeplight.bracket.exposures import Exposure
from deeplight.bracket.response import ChartSamples
from deeplight.errors import ConfigError

# Neutral patches of the 24-patch colour chart, white to black: the manufacturer's reflection
# densities .05 .23 .44 .70 1.05 1.50 as reflectances, 10^-density.
GREY_ROW = tuple(float(10**-density) for density in (0.05, 0.23, 0.44, 0.70, 1.05, 1.50))
ROWS, COLUMNS = 4, 6

Rectangle = tuple[int, int, int, int]
Corners = Sequence[float]


def mean_colour(
    radiance: Float32[np.ndarray, "height width 3"], card: Rectangle
) -> Float[np.ndarray, "3"]:
    """Mean over the card's middle; `card` is x, y of its upper left corner, width, height.

    Raises:
        ConfigError: it does not lie within the picture.
    """
    x, y, width, height = card
    rows, columns, _ = radiance.shape
    if min(x, y) < 0 or min(width, height) < 3 or x + width > columns or y + height > rows:
        got = f"{x} {y} {width} {height} in {columns} x {rows}"
        raise ConfigError("a card within the picture, 3 pixels or more", got, "correct --card")
    inner = radiance[
        y + height // 6 : y + height - height // 6, x + width // 6 : x + width - width // 6
    ]
    colour: np.ndarray = inner.mean((0, 1), dtype=np.float64)
    if not (colour > 0).all():
        raise ConfigError("light on the card", "a black channel", "correct --card")
    return colour


def grey_patches(frames: Sequence[Exposure], corners: Corners) -> ChartSamples:
    """Mean stored values of the chart's grey row in every frame.

    Args:
        corners: x and y of the chart's four corners in pixels: that at the dark skin patch
            first, then bluish green, black, white.

    Raises:
        ConfigError: not four corners within the picture, or the row does not darken from white to
            black.
    """
    height, width, _ = frames[0].pixels.shape
    places = np.array(corners, np.float32)
    usable = len(places) == 8 and (places >= 0).all()
    if not usable or (places.reshape(4, 2) > [width, height]).any():
        expected = "the chart's four corners within the picture, X Y each"
        raise ConfigError(expected, f"{len(corners)} numbers", "correct --chart")
    places = places.reshape(4, 2)
    samples = np.stack([_grey_row(frame.pixels, places) for frame in frames])
    middle = samples[len(frames) // 2].mean(-1)
    if not (np.diff(middle) < 0.02).all() or middle[0] < middle[-1] + 0.1:
        got = "another order"
        do = "give the corners from the dark skin patch: it, bluish green, black, white"
        raise ConfigError("a grey row that darkens from white to black", got, do)
    return ChartSamples(samples, np.array(GREY_ROW))


def _grey_row(
    pixels: Float32[np.ndarray, "height width 3"], corners: Float32[np.ndarray, "4 2"]
) -> Float[np.ndarray, "patches 3"]:
    step = 24
    square = np.array([[0, 0], [COLUMNS, 0], [COLUMNS, ROWS], [0, ROWS]], np.float32) * step
    straight = cv2.warpPerspective(
        pixels, cv2.getPerspectiveTransform(corners, square), (COLUMNS * step, ROWS * step)
    )
    row = straight[(ROWS - 1) * step :].reshape(step, COLUMNS, step, 3)
    inner = row[step // 3 : -step // 3, :, step // 3 : -step // 3]
    means: np.ndarray = inner.mean((0, 2), dtype=np.float64)
    return means
