"""What a network's light is like, next to the true light: peaks, direction, brightness, colour.

    python lab/evidence/light_parts.py data/sim --split val --model deeplight.onnx lamps.onnx

Prints a table for docs/results.md, one column for each network. Photos are changed as a camera
would change them: pixel values times a gain, clipped at white.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from jaxtyping import Float, Float32

from deeplight.camera_response import GAMMA, LUMINANCE
from deeplight.dataset import DataSet, open_dataset
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.open import open_model
from deeplight.evaluate.light_metrics import brightest, mean_radiance
from deeplight.evaluate.run import evaluate
from deeplight.evaluate.scores import TRUE_LIGHTING, Report
from deeplight.harmonics import dominant_light
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball
from deeplight.preprocess import normalise
from deeplight.sphere import SPHERES

CHUNK = 64
WARMER_STOPS = 0.64
"""Red over blue, the change that the light is asked to follow."""
DOWN_DEG = -25.0
"""Pitch from which on a camera looks down."""

Photos = Float32[np.ndarray, "examples 3 height width"]
Light = Float[np.ndarray, "examples size size 3"]


@dataclass(frozen=True)
class Args:
    """Options of the measurement."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set whose examples hold the true light."""
    split: str = "val"
    """Which of its splits, or a group of them."""
    model: tuple[Path | None, ...] = (None,)
    """Exported networks; left out, deeplight's own."""
    at_most: int | None = None
    """At most this number of examples, evenly spread."""


@dataclass(frozen=True)
class Grey:
    """A network's light with its colour taken away: what a hue error is to be compared with."""

    network: NetworkEstimator
    name: str = "grey"

    def estimate_inputs(self, inputs: Photos) -> Light:
        radiance = np.exp(self.network.estimate_inputs(inputs))
        luminance = np.maximum(radiance @ LUMINANCE, 1e-6).astype(np.float32)
        return np.repeat(np.log(luminance)[..., None], 3, axis=-1)


def main(args: Args) -> None:
    """Print the table."""
    data = open_dataset(args.data)
    columns = [measured(open_model(path), data, args) for path in args.model]
    names = ["deeplight" if path is None else path.stem for path in args.model]
    print(f"| {args.split} | {' | '.join(names)} | truth |")
    print("|---" * (len(names) + 2) + "|")
    for row, (_, true) in columns[0].items():
        print(f"| {row} | {' | '.join(column[row][0] for column in columns)} | {true} |")


def measured(network: NetworkEstimator, data: DataSet, args: Args) -> dict[str, tuple[str, str]]:
    """What the network has and what the truth has, by row."""
    report = evaluate([network, Grey(network)], data, args.split, args.at_most)
    photos = photos_of(report, data)
    light = np.exp(report.log_radiance[network.name])
    true = np.exp(report.log_radiance[TRUE_LIGHTING])
    rows = spheres(report, network.name)
    rows |= shapes(light, true) | brightness(report, light, true)
    rows |= changes(network, photos, light)
    return rows


def photos_of(report: Report, data: DataSet) -> Photos:
    """The photos of a report's examples, as a network gets them."""
    index = data.index(report.split)
    return np.concatenate([normalise(index.pixels(int(n))[0][None]) for n in report.numbers])


def spheres(report: Report, name: str) -> dict[str, tuple[str, str]]:
    """L1 of each sphere; the angle of colour, of the light and of the same light made grey."""
    own, grey, best = (report.scores[key] for key in (name, "grey", TRUE_LIGHTING))
    rows = {
        f"L1 {sphere}": (f"{own.l1[sphere].mean():.3f}", f"{best.l1[sphere].mean():.3f}")
        for sphere in reversed(SPHERES)
    }
    angles = [np.nanmean(scores.theta_rgb_deg) for scores in (own, grey, best)]
    rows["angle of colour, °"] = (f"{angles[0]:.2f}", f"{angles[2]:.2f}")
    rows["the same, light made grey, °"] = (f"{angles[1]:.2f}", "")
    return rows


def shapes(light: Light, true: Light) -> dict[str, tuple[str, str]]:
    """How far the light stands out of its mean, and where the main light is; medians."""
    peaks = [
        np.median((some @ LUMINANCE).max((1, 2)) / mean_radiance(some)) for some in (light, true)
    ]
    shares = [
        np.median([dominant_light(Lighting(ball)).share for ball in some]) for some in (light, true)
    ]
    off = brightest(light).degrees_from(brightest(true))
    return {
        "brightest / mean radiance": (f"{peaks[0]:.1f}", f"{peaks[1]:.1f}"),
        "share of the main light": (f"{shares[0]:.2f}", f"{shares[1]:.2f}"),
        "direction of the main light, °": (f"{np.nanmedian(off):.0f}", "0"),
    }


def brightness(report: Report, light: Light, true: Light) -> dict[str, tuple[str, str]]:
    """Median error of the mean radiance in stops, of all and where the camera looks down."""
    stops = np.log2(mean_radiance(light) / mean_radiance(true))
    pitch = np.degrees(np.arcsin(np.clip(-report.world_from_camera[:, 1, 2], -1, 1)))
    down = pitch < DOWN_DEG
    text = f"{np.median(stops[down]):+.2f} ({down.sum()})" if down.any() else "none"
    return {
        "brightness, stops": (f"{np.median(stops):+.2f}", "0"),
        f"the same, pitch under {DOWN_DEG:.0f}° (examples)": (text, "0"),
    }


def changes(network: NetworkEstimator, photos: Photos, light: Light) -> dict[str, tuple[str, str]]:
    """What the light does when the photo is brighter, darker, warmer or flipped."""
    before = mean_colour(light)

    def change(gain: np.ndarray) -> np.ndarray:
        return np.log2(mean_colour(answers(network, exposed(photos, gain))) / before)

    brighter, darker = change(np.full(3, 2.0)), change(np.full(3, 0.5))
    warm = np.exp2(np.array([WARMER_STOPS / 2, 0, -WARMER_STOPS / 2]))
    warmer = np.diff(change(warm)[:, [2, 0]], axis=1)
    flipped = answers(network, np.ascontiguousarray(photos[..., ::-1]))[:, :, ::-1]
    moved = brightest(light).degrees_from(brightest(flipped))
    return {
        "photo one stop brighter, darker": (
            f"{np.median(brighter):+.2f} / {np.median(darker):+.2f}",
            "+1 / -1",
        ),
        "photo warmer by 0.64 stops": (f"{np.median(warmer):+.3f}", f"+{WARMER_STOPS}"),
        "main light against the flipped photo's, °": (f"{np.nanmedian(moved):.0f}", "0"),
    }


def exposed(photos: Photos, gain: Float[np.ndarray, "3"]) -> Photos:
    """The photos with their linear radiance times a gain per channel, clipped at white."""
    pixel_gain = (gain ** (1 / GAMMA)).astype(np.float32)[:, None, None]
    return np.minimum((photos + np.float32(0.5)) * pixel_gain, 1) - np.float32(0.5)


def answers(network: NetworkEstimator, photos: Photos) -> Light:
    """Radiance for each photo."""
    ask: Callable[[Photos], Light] = network.estimate_inputs
    return np.exp(
        np.concatenate([ask(photos[at : at + CHUNK]) for at in range(0, len(photos), CHUNK)])
    )


def mean_colour(light: Light) -> Float[np.ndarray, "examples 3"]:
    """Radiance averaged over all directions, per channel."""
    share = mirror_ball.solid_angles(light.shape[1]) / (4 * np.pi)
    return np.einsum("nijc,ij->nc", light, share)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
