"""Measure estimators on a split, example by example: one estimate of each for every example."""

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Float64, Int64

from deeplight.dataset import DataSet, Example, SplitIndex
from deeplight.errors import ConfigError
from deeplight.evaluate.light_metrics import light_errors, linear_errors, mean_radiance
from deeplight.evaluate.metrics import relative_radiance_error
from deeplight.evaluate.scores import (
    CHANNELS,
    TRUE_LIGHTING,
    Column,
    LogRadiance,
    Report,
    Scores,
    joined,
    rendered_radiance,
    score,
)
from deeplight.preprocess import normalise
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import SPHERES

BATCH = 64


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


@runtime_checkable
class KeyedEstimator(Protocol):
    """What has its answers by the example's key rather than from its picture."""

    @property
    def name(self) -> str:
        """What tables call it."""

    def estimate_keys(self, keys: Sequence[str]) -> LogRadiance:
        """Give ln radiance for these examples."""


AnyEstimator = BatchEstimator | KeyedEstimator


def evaluate(
    estimators: Sequence[AnyEstimator],
    data: DataSet,
    split: str,
    at_most: int | None = None,
    progress: Callable[[int], None] = lambda examples: None,
    truth: KeyedEstimator | None = None,
) -> Report:
    """Measure `estimators` on the examples of `split`.

    Where every example carries its true lighting, that is measured too, as `TRUE_LIGHTING`: what
    is left is the camera's noise and compression, the floor for any estimator. Then errors against
    the true light itself are among the scores.

    Args:
        at_most: measure only this number, evenly spread over the split.
        progress: called with the number of examples finished since the last call.
        truth: the measured true light of examples, instead of what they carry; those that it
            does not cover are left out.

    Raises:
        DataSetError: no such split, or an example cannot be read.
        ModelError: an estimator gives NaN or infinite light.
        ConfigError: `at_most` is under 1, or two estimators have one name.
    """
    names = [estimator.name for estimator in estimators]
    if len(set(names)) < len(names):
        twice = ", ".join(sorted({name for name in names if names.count(name) > 1}))
        raise ConfigError("estimators of different names", f"{twice} twice", "rename one")
    index = data.index(split)
    numbers = examples_to_measure(index, [*estimators, *([truth] if truth else [])], at_most)
    with_truth = truth is not None or bool(index.has_lighting[numbers].all())
    gathered = _Gathered([*names, TRUE_LIGHTING] if with_truth else names, len(numbers))
    for chosen, examples in _batches(index, numbers):
        estimates = _estimates(estimators, examples)
        true = _true_radiance(examples, truth) if with_truth else None
        gathered.add(_Batch(chosen, examples, data, true), estimates)
        progress(len(examples))
    return gathered.report(split, index)


def examples_to_measure(
    index: SplitIndex, estimators: Sequence[AnyEstimator], at_most: int | None = None
) -> Int64[np.ndarray, " chosen"]:
    """The examples that every estimator can answer, or `at_most` of them, evenly spread."""
    if at_most is not None and at_most < 1:
        raise ConfigError("at least 1 example to measure", f"{at_most}", "ask for more")
    answered = np.full(len(index), True)
    for estimator in estimators:
        covers = getattr(estimator, "covers", None)
        if covers is not None:
            answered &= np.array([covers(key) for key in index.keys])
    every = np.flatnonzero(answered)
    if not len(every):
        got = "none that every given method answered"
        raise ConfigError("examples to measure", got, "name the panoramas by the examples' keys")
    count = len(every) if at_most is None else min(at_most, len(every))
    return every[np.unique(np.linspace(0, len(every) - 1, count).astype(int))]


def filmed_pixels(
    examples: Sequence[Example],
) -> dict[str, Float32[np.ndarray, "examples size size 3"]]:
    """Give the filmed spheres as pixel values, 0 to 1, by sphere."""
    return {
        name: np.stack([e.spheres[name] for e in examples]).astype(np.float32) / np.float32(255)
        for name in SPHERES
    }


@dataclass(frozen=True, eq=False)
class _Batch:
    """Examples of one rig, whose spheres are rendered with the data set's own bases."""

    numbers: Int64[np.ndarray, " examples"]
    examples: Sequence[Example]
    data: DataSet
    true_radiance: Float32[np.ndarray, "examples light light 3"] | None

    def bases(self, log_radiance: LogRadiance) -> dict[str, ReflectanceBasis]:
        return self.data.bases(self.rig, log_radiance.shape[1])

    @property
    def rig(self) -> str:
        return self.examples[0].meta.rig


@dataclass(eq=False)
class _Gathered:
    """What the batches gave, until all are through."""

    names: list[str]
    count: int
    numbers: list[np.ndarray] = field(default_factory=list)
    clipped: list[np.ndarray] = field(default_factory=list)
    brightness: list[np.ndarray] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    parts: dict[str, list[Scores]] = field(default_factory=dict)
    answers: dict[str, np.ndarray] = field(default_factory=dict)

    def add(self, batch: _Batch, estimates: Iterator[tuple[str, LogRadiance]]) -> None:
        filmed, true = filmed_pixels(batch.examples), batch.true_radiance
        true_spheres = None
        if true is not None:
            with np.errstate(divide="ignore"):  # no light is ln 0, and exp gives it back
                log_true = np.log(true)
            true_spheres = rendered_radiance(batch.bases(log_true), log_true)
            estimates = iter([*estimates, (TRUE_LIGHTING, log_true)])
        first = sum(len(numbers) for numbers in self.numbers)
        for name, log_radiance in estimates:
            bases = batch.bases(log_radiance)
            rendered = rendered_radiance(bases, log_radiance)
            more = _against_truth(log_radiance, rendered, true, true_spheres, bases)
            self.parts.setdefault(name, []).append(score(rendered, filmed, bases, more))
            self._kept(name, log_radiance)[first : first + len(log_radiance)] = log_radiance
        masked = filmed["diffuse"][:, batch.data.rigs[batch.rig].views["diffuse"].mask()]
        self.clipped.append((masked == 1).mean((1, 2)))
        unknown = np.full(len(batch.examples), np.nan)
        self.brightness.append(unknown if true is None else mean_radiance(true))
        self.numbers.append(batch.numbers)
        self.frames += [example.meta.frame for example in batch.examples]
        self.poses += [_pose(example) for example in batch.examples]

    def _kept(self, name: str, log_radiance: LogRadiance) -> np.ndarray:
        """Room for an estimator's answers, on disk: a large split would not fit in memory."""
        if name not in self.answers:
            shape = (self.count, *log_radiance.shape[1:])
            with tempfile.TemporaryFile() as file:
                self.answers[name] = np.memmap(file, np.float32, "w+", shape=shape)
        return self.answers[name]

    def report(self, split: str, index: SplitIndex) -> Report:
        every = np.concatenate(self.numbers)
        back = np.argsort(every)  # batches are of one rig each, so they may be out of order
        numbers = every[back]
        in_order = bool((np.diff(back) == 1).all())
        return Report(
            split,
            numbers,
            tuple(index.keys[number] for number in numbers),
            index.places[numbers],
            index.scenes[numbers],
            np.concatenate(self.clipped)[back],
            {name: joined(self.parts[name], back) for name in self.names},
            np.concatenate(self.brightness)[back],
            index.takes[numbers],
            np.array(self.frames, np.int64)[back],
            np.stack(self.poses)[back],
            {name: kept if in_order else kept[back] for name, kept in self.answers.items()},
        )


def _against_truth(
    log_radiance: LogRadiance,
    rendered: Mapping[str, Float32[np.ndarray, "examples size size 3"]],
    true: Float32[np.ndarray, "examples own own 3"] | None,
    true_spheres: Mapping[str, Float32[np.ndarray, "examples size size 3"]] | None,
    bases: Mapping[str, ReflectanceBasis],
) -> dict[str, Column]:
    """The columns that need the true light; none where it is not known."""
    if true is None or true_spheres is None:
        return {}
    with np.errstate(over="ignore"):
        errors = light_errors(np.exp(log_radiance), true)
    masks = {name: bases[name].view.mask() for name in SPHERES}
    linear = linear_errors(rendered, true_spheres, masks)
    relative = relative_radiance_error(
        rendered["diffuse"], true_spheres["diffuse"], masks["diffuse"]
    )
    return {
        **errors,
        **{f"linear_{name}": linear[name] for name in SPHERES},
        **{f"true_radiance_{name}": relative[:, n] for n, name in enumerate(CHANNELS)},
        "true_radiance_absolute": np.abs(relative).mean(1),
    }


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
    estimators: Sequence[AnyEstimator], examples: Sequence[Example]
) -> Iterator[tuple[str, LogRadiance]]:
    inputs = normalise(np.stack([example.background for example in examples]))
    for estimator in estimators:
        if isinstance(estimator, KeyedEstimator):
            yield estimator.name, estimator.estimate_keys([example.key for example in examples])
        else:
            yield estimator.name, estimator.estimate_inputs(inputs)


def _pose(example: Example) -> Float64[np.ndarray, "3 3"]:
    """world_from_camera as the example gives it, else NaN."""
    given = np.array(example.meta.details.get("world_from_camera", np.nan), np.float64)
    return given if given.shape == (3, 3) else np.full((3, 3), np.nan)


def _true_radiance(
    examples: Sequence[Example], truth: KeyedEstimator | None
) -> Float32[np.ndarray, "examples light light 3"]:
    if truth is not None:
        return np.exp(truth.estimate_keys([example.key for example in examples]))
    return np.stack([example.true_lighting for example in examples])  # type: ignore[misc]
