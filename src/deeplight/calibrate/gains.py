"""One gain per channel that brings a model's light to a phone, and proof that it helps elsewhere.

A phone's exposure and white balance multiply all light alike, and rendered spheres are linear in
the light. So the spheres are rendered once, and a gain is found by looking it up in a table of
losses. How much of it to believe is decided by places it was not found in.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float64

from deeplight.camera_response import encode, soft_clip
from deeplight.dataset import DataSet, Example
from deeplight.errors import InputError
from deeplight.evaluate.run import BatchEstimator, filmed_pixels
from deeplight.evaluate.scores import Scores, rendered_radiance, score
from deeplight.preprocess import normalise
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import LOSS_WEIGHTS, SPHERES

REACH, STEP = 1.5, 0.05
GRID = np.linspace(-REACH, REACH, round(2 * REACH / STEP) + 1, dtype=np.float32)
"""ln gains that are tried."""
STRENGTHS = (0.0, 0.5, 1.0)
"""Shares of what was found that may be believed, of the brightness and of the colour."""
LEAST_PLACES = 3
MOST_VIEWS = 48
"""Of each place, evenly spread: neighbouring frames say nothing new."""
METRICS = (*(f"l1_{name}" for name in SPHERES), "theta_rgb_deg")

Gains = Float64[np.ndarray, "3"]


@dataclass(frozen=True, eq=False)
class ClipViews:
    """Examples of one rig: their spheres, filmed, and rendered in the model's light.

    Attributes:
        places: of each example.
        rendered: linear radiance by sphere, (examples, size, size, 3).
        filmed: pixel values, 0 to 1, likewise.
        bases: of the rig's spheres.
        cameras: that the clips say they were filmed with, each once.
    """

    places: np.ndarray
    rendered: dict[str, np.ndarray]
    filmed: dict[str, np.ndarray]
    bases: dict[str, ReflectanceBasis]
    cameras: frozenset[str] = frozenset()

    def losses(self) -> Float64[np.ndarray, "examples 3 gains"]:
        """Equation 4 with the weights of the spheres, by channel, at every gain of `GRID`."""
        table = np.zeros((len(self.places), 3, len(GRID)))
        for name in SPHERES:
            mask = self.bases[name].view.mask()
            rendered, filmed = self.rendered[name][:, mask], self.filmed[name][:, mask]
            for number, log_gain in enumerate(GRID):
                shown = encode(soft_clip(rendered * np.exp(log_gain)))
                table[..., number] += LOSS_WEIGHTS[name] * np.abs(shown - filmed).mean(1)
        return table

    def scores(self, log_gains: Float64[np.ndarray, "examples 3"]) -> Scores:
        """The metrics of evaluation with the light of each example times its own gains."""
        gain = np.exp(log_gains).astype(np.float32)[:, None, None]
        lit = {name: values * gain for name, values in self.rendered.items()}
        return score(lit, self.filmed, self.bases)


def views_of(
    model: BatchEstimator, data: DataSet, progress: Callable[[int], None] = lambda examples: None
) -> list[ClipViews]:
    """Look at every place of a data set, whatever its splits are called."""
    found = []
    for split in data.splits:
        if not data.manifest.examples(split):
            continue
        index = data.index(split)
        for rig in np.unique(index.rigs):
            numbers = _some(np.flatnonzero(index.rigs == rig), index.places)
            examples = [index[int(number)] for number in numbers]
            light = np.concatenate([_light(model, chunk) for chunk in _chunks(examples)])
            bases = data.bases(str(rig), light.shape[1])
            rendered = rendered_radiance(bases, light)
            pixels, cameras = filmed_pixels(examples), cameras_in(examples)
            found.append(ClipViews(index.places[numbers], rendered, pixels, bases, cameras))
            progress(len(numbers))
    return found


def cameras_in(examples: Sequence[Example]) -> frozenset[str]:
    """Make and model of every camera that `deeplight capture` found in the clips."""
    named = (example.meta.details.get("camera", "") for example in examples)
    return frozenset(str(name) for name in named if name)


def _some(numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    chosen = []
    for place in np.unique(places[numbers]):
        own = numbers[places[numbers] == place]
        spread = np.linspace(0, len(own) - 1, min(len(own), MOST_VIEWS)).round().astype(int)
        chosen.append(own[spread])
    return np.concatenate(chosen)


def _chunks(examples: Sequence[Example], size: int = 32) -> Iterator[Sequence[Example]]:
    return (examples[at : at + size] for at in range(0, len(examples), size))


def _light(model: BatchEstimator, examples: Sequence[Example]) -> np.ndarray:
    return model.estimate_inputs(normalise(np.stack([e.background for e in examples])))


@dataclass(frozen=True)
class GainCalibration:
    """What was found, and what it does in places it was not found in.

    Attributes:
        log_gains: ln of the factor on red, green and blue of all light.
        places: how many it was found in.
        before, after: means over the places, by name of metric: without it, and with what the
            other places alone gave.
        camera: whose photos they are for; empty for those of all cameras.
    """

    log_gains: tuple[float, float, float]
    places: int
    before: dict[str, float]
    after: dict[str, float]
    camera: str = ""


def find_gains(views: Sequence[ClipViews]) -> GainCalibration:
    """Find the gains; keep what helps places that were left out in turn.

    Raises:
        InputError: fewer than `LEAST_PLACES` places, or nothing that helps.
    """
    places = np.concatenate([part.places for part in views])
    names = np.unique(places)
    if len(names) < LEAST_PLACES:
        got = f"{len(names)}"
        do = "film in more places: each one shows whether the others' gains help"
        raise InputError(f"clips from at least {LEAST_PLACES} places", got, do)
    losses = np.concatenate([part.losses() for part in views])
    table = np.stack([losses[places == name].mean(0) for name in names])  # places count alike
    others = [np.delete(table, number, 0).mean(0) for number in range(len(names))]
    left_out = np.stack([_best(rest) for rest in others])[np.searchsorted(names, places)]
    before = _by_place(views, np.zeros_like(left_out), places)
    tried = {
        strength: _by_place(views, shrunk(left_out, *strength), places)
        for strength in product(STRENGTHS, STRENGTHS)
        if any(strength)
    }
    strength = _gentlest({s: _change(before, m) for s, m in tried.items()})
    after = tried[strength]
    was, now = ({n: float(values.mean()) for n, values in m.items()} for m in (before, after))
    if not _helps(before, after):
        raise InputError(
            "clips that make the model better in places they were not filmed in",
            f"in {len(names)} places left out in turn at best {words(was, now)}",
            "nothing was written: the model suits this phone already, or film in more places",
        )
    found = shrunk(_best(table.mean(0))[None], *strength)[0]
    red, green, blue = (float(value) for value in found)
    return GainCalibration((red, green, blue), len(names), was, now)


def _gentlest(changes: dict[tuple[float, float], np.ndarray]) -> tuple[float, float]:
    """The least of all strengths that are as good as the best, but for chance (one error).

    The model knew many phones before: what this one does not need is left as it was.
    """
    best = min(changes.values(), key=lambda change: float(change.mean()))
    as_good = [s for s, c in changes.items() if (c - best).mean() <= standard_error(c - best)]
    return min(as_good, key=lambda strength: float(np.hypot(*strength)))


def standard_error(values: Float64[np.ndarray, " places"]) -> float:
    """Of their mean."""
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def _best(losses: Float64[np.ndarray, "3 gains"]) -> Gains:
    """The ln gain of least loss of each channel, between the grid's values by a parabola."""
    gains = np.empty(3)
    for channel, own in enumerate(losses):
        at = int(np.clip(own.argmin(), 1, len(GRID) - 2))
        low, middle, high = own[at - 1 : at + 2]
        bend = low - 2 * middle + high
        shift = 0.5 * (low - high) / bend if bend > 0 else 0.0
        gains[channel] = GRID[at] + STEP * np.clip(shift, -1, 1)
    return gains


def shrunk(
    log_gains: Float64[np.ndarray, "n 3"], brightness: float, colour: float
) -> Float64[np.ndarray, "n 3"]:
    """A share of the gains: of their mean, and of what the channels differ from it by."""
    mean = log_gains.mean(1, keepdims=True)
    return brightness * mean + colour * (log_gains - mean)


def _by_place(
    views: Sequence[ClipViews], log_gains: np.ndarray, places: np.ndarray
) -> dict[str, np.ndarray]:
    """Mean of each metric in each place."""
    ends = np.cumsum([len(part.places) for part in views])[:-1]
    parts = [part.scores(own) for part, own in zip(views, np.split(log_gains, ends), strict=True)]
    columns = {name: np.concatenate([p.metrics()[name] for p in parts]) for name in METRICS}
    columns["loss"] = np.concatenate([part.reconstruction_loss() for part in parts])
    return {
        name: np.array([np.nanmean(values[places == place]) for place in np.unique(places)])
        for name, values in columns.items()
    }


def _change(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> np.ndarray:
    """How much worse each place is: of the loss and of the hue, as shares of what they were."""
    change: np.ndarray = sum(
        ((after[name] - before[name]) / before[name].mean() for name in ("loss", "theta_rgb_deg")),
        np.zeros(len(before["loss"])),
    )
    return change


def _helps(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> bool:
    """Neither loss nor hue is worse, and the gain is larger than chance moves it (one error)."""
    change = _change(before, after)
    worse = any(after[n].mean() > before[n].mean() for n in ("loss", "theta_rgb_deg"))
    return bool(not worse and change.mean() < -standard_error(change))


def words(before: dict[str, float], after: dict[str, float]) -> str:
    """Before -> after, for people."""
    parts = [f"{name} {before[f'l1_{name}']:.3f} -> {after[f'l1_{name}']:.3f}" for name in SPHERES]
    hue = f"hue {before['theta_rgb_deg']:.1f} -> {after['theta_rgb_deg']:.1f} degrees"
    return ", ".join([*parts, hue])
