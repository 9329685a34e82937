"""What a split looks like in numbers: colour, clipping, and how bright its lights are."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, UInt8

from deeplight.brdf import REFLECTIVITY
from deeplight.camera_response import decode
from deeplight.dataset.reading import DataSet
from deeplight.sphere import SPHERES, Rig

BRIGHTNESS_EDGES_STOPS = tuple(float(stop) for stop in np.arange(-6, 2.5, 0.5))


@dataclass(frozen=True)
class SplitStatistics:
    """One split in numbers.

    Attributes:
        split: its name.
        examples: how many were looked at, evenly spread over the split.
        mean_pixel: of the backgrounds, red, green, blue, 0 to 1, gamma-encoded.
        clipped: part of the values that are 255, by picture ("background" and each sphere; a
            sphere inside its mask).
        brightness_histogram: examples by the brightest light on the diffuse sphere: the log2 of
            its brightest linear value over its reflectivity, between `BRIGHTNESS_EDGES_STOPS`;
            values beyond the edges are in the first and last bin. 0 stops is a white card in
            the camera's white. A clipped sphere gives the lower bound, 1.54 stops.
    """

    split: str
    examples: int
    mean_pixel: tuple[float, float, float]
    clipped: dict[str, float]
    brightness_histogram: tuple[int, ...]

    def to_dict(self) -> dict[str, Any]:
        return {**asdict(self), "brightness_edges_stops": list(BRIGHTNESS_EDGES_STOPS)}


def split_statistics(data: DataSet, split: str, at_most: int = 2000) -> SplitStatistics:
    """Measure `split` (or a group of splits) on at most `at_most` examples.

    Raises:
        DataSetError: there is no such split, or an example cannot be read.
    """
    index = data.index(split)
    numbers = np.unique(np.linspace(0, len(index) - 1, min(at_most, len(index))).astype(int))
    means, stops = [], []
    clipped = {name: np.zeros(2) for name in ("background", *SPHERES)}  # clipped values, values
    masks = {name: _masks(rig) for name, rig in data.rigs.items()}
    for number in numbers:
        background, spheres = index.pixels(int(number))
        means.append(background.mean((0, 1)) / 255)
        clipped["background"] += _count_clipped(background)
        mask = masks[str(index.rigs[number])]
        for name, sphere in zip(SPHERES, spheres, strict=True):
            clipped[name] += _count_clipped(sphere[mask[name]])
        stops.append(_brightest_stops(spheres[SPHERES.index("diffuse")], mask["diffuse"]))
    edges = np.array(BRIGHTNESS_EDGES_STOPS)
    histogram, _ = np.histogram(np.clip(stops, edges[0], edges[-1]), edges)
    red, green, blue = np.mean(means, axis=0)
    return SplitStatistics(
        split,
        len(numbers),
        (float(red), float(green), float(blue)),
        {name: float(count / total) for name, (count, total) in clipped.items()},
        tuple(int(count) for count in histogram),
    )


def _masks(rig: Rig) -> dict[str, Bool[np.ndarray, "size size"]]:
    return {name: rig.views[name].mask() for name in SPHERES}


def _count_clipped(pixels: UInt8[np.ndarray, "*shape 3"]) -> tuple[int, int]:
    return int((pixels == 255).sum()), pixels.size


def _brightest_stops(
    diffuse: UInt8[np.ndarray, "size size 3"], mask: Bool[np.ndarray, "size size"]
) -> float:
    linear = decode(diffuse[mask].astype(np.float32) / np.float32(255))
    brightest = max(float(linear.max()), 1e-6)
    return float(np.log2(brightest / REFLECTIVITY["diffuse"]))
