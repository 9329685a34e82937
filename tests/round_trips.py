"""What the round trips share: one panorama, our own balls under it, and how theirs are compared.

A round trip exports light for a tool, lets the tool itself load it and render a grey and a mirror
ball, seen from far away by the tool's own camera, and compares those with `relight`.
"""

import os
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from deeplight.camera_response import CameraResponse
from deeplight.environment import Environment
from deeplight.formats.labelled import LABELS, labelled_environment
from deeplight.frames import normalised, rotation
from deeplight.io.radiance import write_exr
from deeplight.lighting import Lighting
from deeplight.mappings.mirror_ball import pixel_of_directions
from deeplight.mappings.resample import turned_latlong as turned
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.sphere import SphereView

SIZE = 64
VIEW = SphereView(size=SIZE)
MATERIALS = {"diffuse": 0.345, "mirror": 0.827}
MOST_L1 = 0.02
HEIGHT = 512
RESPONSE = CameraResponse()

# Inside each label's field; straight ahead is the ball's rim, so well off it.
TOWARDS = {
    "RIGHT": (1, 0.25, 0.1),
    "LEFT": (-1, 0.25, 0.1),
    "UP": (0.35, 1, 0.2),
    "DOWN": (0.35, -1, 0.2),
    "BACK": (0.25, 0.25, 1),
    "FRONT": (0.3, 0.45, -1),
}


@dataclass(frozen=True, eq=False)
class Balls:
    """Linear radiance of a grey and of a mirror ball, `SIZE` pixels across, row 0 at the top."""

    diffuse: np.ndarray
    mirror: np.ndarray


@cache
def labelled() -> Environment:
    """The test panorama that every tool gets."""
    return labelled_environment(HEIGHT)


def mirrored() -> Environment:
    """The twin: left and right exchanged."""
    return Environment(labelled().radiance[:, ::-1])


def quarter_turned() -> Environment:
    """The other twin: turned by a quarter about the vertical."""
    return Environment(turned(labelled().radiance, rotation("y", np.pi / 2)))


@cache
def our_balls() -> Balls:
    """What `relight` makes of the panorama."""
    lighting = Lighting.from_latlong(labelled().radiance, size=64)
    pictures = {
        name: relight(analytic_basis(name, VIEW, lighting.size), lighting) for name in MATERIALS
    }
    return Balls(**pictures)


def masked_l1(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Mean difference of pixel values over the ball, as the paper measures."""
    a, b = (RESPONSE.pixel_from_radiance(r.astype(np.float32)) for r in (ours, theirs))
    return float(np.abs(a - b)[VIEW.mask()].mean())


def labels_seen(mirror: np.ndarray) -> dict[str, str]:
    """For each label's direction the label whose colour the mirror ball shows there."""
    colours = {text: np.array(colour) for text, colour in LABELS.values()}
    seen = {}
    for text, towards in TOWARDS.items():
        direction = normalised(np.array(towards, float))
        row, column = divmod(int(pixel_of_directions(direction[None], SIZE)[0]), SIZE)
        colour = mirror[row, column] / MATERIALS["mirror"]
        seen[text] = min(colours, key=lambda name: float(np.abs(colours[name] - colour).sum()))
    return seen


def report(line: str) -> None:
    """Show a measured number where pytest is run with -s."""
    sys.stdout.write(f"\n{line}\n")


def assert_right(theirs: Balls, tool: str) -> None:
    """The grey ball is ours within `MOST_L1`, and each label is where it belongs."""
    grey, mirror = measured(theirs)
    keep(theirs, tool)
    report(f"{tool}: masked L1 grey {grey:.4f}, mirror {mirror:.4f}")
    assert labels_seen(theirs.mirror) == {name: name for name in TOWARDS}
    assert grey <= MOST_L1
    assert mirror <= 0.1
    ours = our_balls().diffuse[VIEW.mask()].mean()
    assert theirs.diffuse[VIEW.mask()].mean() == pytest.approx(ours, rel=0.05)


def keep(balls: Balls, name: str) -> None:
    """Save both balls for the documents' picture, where a folder is named for them."""
    folder = os.environ.get("DEEPLIGHT_ROUND_TRIP_PICTURES")
    for who, shown in ((name, balls), ("ours", our_balls())) if folder else ():
        linear = np.concatenate([shown.diffuse, shown.mirror], axis=1)
        alpha = np.tile(VIEW.alpha(), (1, 2))[..., None]
        write_exr(Path(str(folder)) / f"{who}.exr", (linear * alpha).astype(np.float32))


def assert_wrong(theirs: Balls) -> None:
    """The same comparison finds a panorama that is not oriented as it should be."""
    grey, _ = measured(theirs)
    assert labels_seen(theirs.mirror) != {name: name for name in TOWARDS}
    assert grey > 2 * MOST_L1


def measured(theirs: Balls) -> tuple[float, float]:
    """Masked L1 of the grey and of the mirror ball."""
    ours = our_balls()
    return masked_l1(ours.diffuse, theirs.diffuse), masked_l1(ours.mirror, theirs.mirror)
