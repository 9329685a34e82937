"""Measure estimators on a split, example by example, all on the same examples."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from deeplight.camera_response import decode, encode, soft_clip
from deeplight.dataset import DataSet, Example, SplitIndex
from deeplight.errors import ConfigError
from deeplight.evaluate.metrics import angular_error_rgb, masked_l1, relative_radiance_error
from deeplight.preprocess import normalise
from deeplight.reflectance import ReflectanceBasis, rig_bases
from deeplight.sphere import SPHERES

BATCH = 64
TRUE_LIGHTING = "true_lighting"  # what the metrics give for the very light that was filmed

LogRadiance = Float32[np.ndarray, "examples light light 3"]


@runtime_checkable
class BatchEstimator(Protocol):
    """The part of an `estimate.Estimator` that an evaluation needs; every `Estimator` is one."""

    @property
    def name(self) -> str:
        """What tables call it."""

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for pictures in [-0.5, 0.5]."""


@dataclass(frozen=True, eq=False)
class Scores:
    """One estimator on every example; NaN where a metric is not defined.

    Attributes:
        l1: masked L1 of pixel values, by sphere.
        theta_rgb_deg: mean angle of the linear diffuse colours.
        relative_radiance: (predicted - filmed) / filmed of the linear diffuse sphere, per channel.
        black_pixels: pixels without a colour, left out of `theta_rgb_deg`.
    """

    l1: Mapping[str, Float64[np.ndarray, " examples"]]
    theta_rgb_deg: Float64[np.ndarray, " examples"]
    relative_radiance: Float64[np.ndarray, "examples 3"]
    black_pixels: Int64[np.ndarray, " examples"]

    def metrics(self) -> dict[str, Float64[np.ndarray, " examples"]]:
        """Give every metric as a column, by name."""
        columns = {f"l1_{name}": self.l1[name] for name in SPHERES}
        columns["theta_rgb_deg"] = self.theta_rgb_deg
        for channel, name in enumerate(("red", "green", "blue")):
            columns[f"radiance_{name}"] = self.relative_radiance[:, channel]
        columns["radiance_absolute"] = np.abs(self.relative_radiance).mean(1)
        return columns


@dataclass(frozen=True, eq=False)
class Report:
    """Estimators measured on one split.

    Attributes:
        split: the split or group of splits.
        numbers: of each example in `data.index(split)`.
        keys, places, scenes: of each example.
        diffuse_clipped: part of the filmed diffuse sphere's values that are 255, per example:
            there `relative_radiance` is too large.
        scores: by estimator, in the order they were given.
    """

    split: str
    numbers: Int64[np.ndarray, " examples"]
    keys: tuple[str, ...]
    places: np.ndarray
    scenes: np.ndarray
    diffuse_clipped: Float64[np.ndarray, " examples"]
    scores: Mapping[str, Scores]


def evaluate(
    estimators: Sequence[BatchEstimator],
    data: DataSet,
    split: str,
    at_most: int | None = None,
    progress: Callable[[int], None] = lambda examples: None,
) -> Report:
    """Measure `estimators` on the examples of `split`.

    Where every example carries its true lighting, that is measured too, as `TRUE_LIGHTING`: what
    is left is the camera's noise and compression, the floor for any estimator.

    Args:
        at_most: measure only so many, evenly spread over the split.
        progress: called with the number of examples finished since the last call.

    Raises:
        DataSetError: no such split, or an example cannot be read.
        ModelError: an estimator gives NaN or infinite light.
        ConfigError: `at_most` is under 1.
    """
    if at_most is not None and at_most < 1:
        raise ConfigError("at least 1 example to measure", f"{at_most}", "ask for more")
    index = data.index(split)
    count = len(index) if at_most is None else min(at_most, len(index))
    numbers = np.unique(np.linspace(0, len(index) - 1, count).astype(int))
    names = [estimator.name for estimator in estimators]
    if index.has_lighting[numbers].all():
        names.append(TRUE_LIGHTING)
    parts: dict[str, list[Scores]] = {name: [] for name in names}
    clipped, order = [], []
    for chosen, examples in _batches(index, numbers):
        bases = rig_bases(data.rigs[examples[0].meta.rig])
        filmed = filmed_pixels(examples)
        for name, log_radiance in _estimates(estimators, examples, TRUE_LIGHTING in names):
            parts[name].append(score(rendered_radiance(bases, log_radiance), filmed, bases))
        diffuse = filmed["diffuse"][:, bases["diffuse"].view.mask()]
        clipped.append((diffuse == 1).mean((1, 2)))
        order.append(chosen)
        progress(len(examples))
    every = np.concatenate(order)
    back = np.argsort(every)  # batches are of one rig each, so they may be out of order
    return Report(
        split,
        every[back],
        tuple(index.keys[number] for number in every[back]),
        index.places[every[back]],
        index.scenes[every[back]],
        np.concatenate(clipped)[back],
        {name: _joined(scores, back) for name, scores in parts.items()},
    )


def filmed_pixels(examples: Sequence[Example]) -> dict[str, Float32[np.ndarray, "n size size 3"]]:
    """Give the filmed spheres as pixel values, 0 to 1, by sphere."""
    return {
        name: np.stack([e.spheres[name] for e in examples]).astype(np.float32) / np.float32(255)
        for name in SPHERES
    }


def rendered_radiance(
    bases: Mapping[str, ReflectanceBasis], log_radiance: LogRadiance
) -> dict[str, Float32[np.ndarray, "n size size 3"]]:
    """Render each sphere in each lighting (equation 2): linear radiance, not clipped."""
    count, lights = len(log_radiance), log_radiance.shape[1] ** 2
    with np.errstate(over="ignore"):  # infinite light shows as NaN scores
        radiance = np.exp(log_radiance.astype(np.float32)).reshape(count, lights, 3)
    columns = radiance.transpose(1, 0, 2).reshape(lights, count * 3)
    spheres = {}
    for name, basis in bases.items():
        size = basis.view.size
        rendered = (basis.weights @ columns).reshape(size, size, count, 3)
        spheres[name] = np.ascontiguousarray(rendered.transpose(2, 0, 1, 3))
    return spheres


def score(
    radiance: Mapping[str, Float[np.ndarray, "n size size 3"]],
    filmed: Mapping[str, Float[np.ndarray, "n size size 3"]],
    bases: Mapping[str, ReflectanceBasis],
) -> Scores:
    """Compare rendered linear spheres with filmed pixel values (0 to 1).

    L1 and theta_rgb see the rendered sphere as the camera would show it, clipped; the relative
    radiance error sees its whole radiance.
    """
    masks = {name: bases[name].view.mask() for name in SPHERES}
    with np.errstate(invalid="ignore"):  # NaN stays NaN, and is counted by who averages
        clipped = {name: soft_clip(radiance[name]) for name in SPHERES}
    l1 = {name: masked_l1(encode(clipped[name]), filmed[name], masks[name]) for name in SPHERES}
    diffuse, mask = decode(filmed["diffuse"]), masks["diffuse"]
    angle = angular_error_rgb(np.maximum(clipped["diffuse"], 0), diffuse, mask)
    relative = relative_radiance_error(radiance["diffuse"], diffuse, mask)
    return Scores(l1, angle.degrees, relative, angle.black_pixels)


def _batches(
    index: SplitIndex, numbers: Int64[np.ndarray, " chosen"]
) -> Iterator[tuple[Int64[np.ndarray, " batch"], list[Example]]]:
    """Read examples in batches that share a rig."""
    for rig in np.unique(index.rigs[numbers]):
        of_rig = numbers[index.rigs[numbers] == rig]
        for start in range(0, len(of_rig), BATCH):
            chosen = of_rig[start : start + BATCH]
            yield chosen, [index[int(number)] for number in chosen]


def _estimates(
    estimators: Sequence[BatchEstimator], examples: Sequence[Example], with_truth: bool
) -> Iterator[tuple[str, LogRadiance]]:
    inputs = normalise(np.stack([example.background for example in examples]))
    for estimator in estimators:
        yield estimator.name, estimator.estimate_inputs(inputs)
    if with_truth:
        truth = np.stack([example.true_lighting for example in examples])  # type: ignore[misc]
        with np.errstate(divide="ignore"):  # no light is ln 0, and exp gives it back
            yield TRUE_LIGHTING, np.log(truth)


def _joined(parts: Sequence[Scores], order: np.ndarray) -> Scores:
    return Scores(
        {name: np.concatenate([part.l1[name] for part in parts])[order] for name in SPHERES},
        np.concatenate([part.theta_rgb_deg for part in parts])[order],
        np.concatenate([part.relative_radiance for part in parts])[order],
        np.concatenate([part.black_pixels for part in parts])[order],
    )
