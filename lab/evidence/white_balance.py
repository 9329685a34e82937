"""What a photo's white-balance gains say of its light's colour, and whether another camera agrees.

    python -m lab.evidence.white_balance data/v1 data/v2

The colour of the light, as filmed diffuse spheres have it, is fitted by least squares on training
places: from the gains alone, from gains and the photo's mean colour, and by the one relation that
no camera's habits enter (what the light was before white balance, from the photo's colour before
it). Each fit learns from one data set or from both, and is measured on the validation and test
places of each: mean angle to the colour of the filmed diffuse sphere, in degrees. All colours are
ln red and ln blue over green.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import tyro
from jaxtyping import Float

from deeplight.camera_response import decode
from deeplight.dataset import DataSet, open_dataset

SPLITS = ("val", "test")
DARKEST = 1e-3
Colours = Float[np.ndarray, "n 2"]


class Views(NamedTuple):
    """Colours of some examples: of the gains, the light and the photo; and their cameras."""

    gains: Colours
    light: Colours
    photo: Colours
    cameras: np.ndarray

    def of(self, camera: str) -> "Views":
        """Those of one camera."""
        own = self.cameras == camera
        return Views(self.gains[own], self.light[own], self.photo[own], self.cameras[own])


@dataclass(frozen=True)
class Args:
    """Options of the experiment."""

    data: Annotated[tuple[Path, Path], tyro.conf.Positional]
    """Data sets of recipes v1 and v2."""
    every: int = 3
    """Of the training examples one in this number is used."""


FITS: Mapping[str, Callable[[Views], np.ndarray]] = {
    "gains": lambda views: views.gains,
    "gains and photo": lambda views: np.concatenate((views.gains, views.photo), 1),
}


def main(args: Args) -> None:
    """Print a table of angles and the slopes of red and blue on their own gains."""
    sets = [open_dataset(folder) for folder in args.data]
    names = [folder.name for folder in args.data]
    train = [views_of(data, "train", args.every) for data in sets]
    judged = {
        f"{name} {split}": views_of(data, split)
        for name, data in zip(names, sets, strict=True)
        for split in SPLITS
    }
    *_, last = judged.values()
    for camera in np.unique(last.cameras) if len(np.unique(last.cameras)) > 1 else ():
        judged[f"of it, camera {camera}"] = last.of(str(camera))
    print(f"| light's colour | {' | '.join(judged)} | slopes |\n|---{'|---' * (len(judged) + 1)}|")
    grey = [angle(views.light, 0 * views.light) for views in judged.values()]
    print_row("grey", grey)
    learnt = {name: (views,) for name, views in zip(names, train, strict=True)}
    for words, some in {**learnt, "both": tuple(train)}.items():
        for name, columns in FITS.items():
            slopes = fitted([(columns(v), v.light) for v in some])
            found = [angle(v.light, with_one(columns(v)) @ slopes) for v in judged.values()]
            print_row(f"{name}, of {words}", found, slopes)
        before = fitted([(v.photo - v.gains, v.light - v.gains) for v in some])
        found = [
            angle(v.light, v.gains + with_one(v.photo - v.gains) @ before) for v in judged.values()
        ]
        print_row(f"before white balance, of {words}", found, before)


def views_of(data: DataSet, split: str, every: int = 1) -> Views:
    """Colours of a split's examples."""
    index, (rig,) = data.index(split), data.rigs
    inside = data.bases(rig)["diffuse"].view.mask()
    gains, light, photo, cameras = [], [], [], []
    for number in range(0, len(index), every):
        example = index[number]
        gains.append(example.meta.details["log_gain"])
        diffuse = decode(example.spheres["diffuse"].astype(np.float32) / 255)[inside]
        background = decode(example.background.astype(np.float32) / 255).reshape(-1, 3)
        light.append(log_of(diffuse))
        photo.append(log_of(background))
        cameras.append(example.meta.camera)
    colours = [over_green(np.array(values)) for values in (gains, light, photo)]
    return Views(colours[0], colours[1], colours[2], np.array(cameras))


def log_of(pixels: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """ln of the mean of linear pixels."""
    return np.log(np.maximum(pixels.mean(0), DARKEST))


def over_green(log_rgb: Float[np.ndarray, "n 3"]) -> Colours:
    """ln of red and of blue over green."""
    return log_rgb[:, ::2] - log_rgb[:, 1:2]


def with_one(columns: np.ndarray) -> np.ndarray:
    """A column of ones after the others."""
    return np.concatenate((columns, np.ones((len(columns), 1))), 1)


def fitted(sets: Sequence[tuple[np.ndarray, Colours]]) -> np.ndarray:
    """Least squares; every data set counts alike."""
    shares = np.concatenate([np.full(len(light), len(light) ** -0.5) for _, light in sets])[:, None]
    columns = with_one(np.concatenate([read for read, _ in sets]))
    light = np.concatenate([light for _, light in sets])
    found: np.ndarray = np.linalg.lstsq(columns * shares, light * shares, rcond=None)[0]
    return found


def angle(true: Colours, found: Colours) -> float:
    """Mean angle between colours, degrees."""
    unit = []
    for colours in (true, found):
        rgb = np.exp(np.insert(colours, 1, 0, axis=1))
        unit.append(rgb / np.linalg.norm(rgb, axis=1, keepdims=True))
    return float(np.degrees(np.arccos(np.clip((unit[0] * unit[1]).sum(1), -1, 1))).mean())


def print_row(words: str, angles: Sequence[float], slopes: np.ndarray | None = None) -> None:
    """One line of the table."""
    own = "" if slopes is None else f"{slopes[0, 0]:+.2f}, {slopes[1, 1]:+.2f}"
    print(f"| {words} | {' | '.join(f'{value:.2f}' for value in angles)} | {own} |", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
