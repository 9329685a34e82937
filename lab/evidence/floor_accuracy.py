"""How often `compose` stands objects on a floor, and warns where a photo shows none.

    python -m lab.evidence.floor_accuracy HDRI_FOLDER [--split val]

Films photos in places whose "down" is known: of the floor, level, up at walls and at the sky, held
straight and rolled by 8 and 15 degrees. What lies 15 degrees or more below the horizon is floor
here, and what lies less than 3 below it is none; a photo shows floor where an object's patch fits
20 degrees below the horizon; what is 3 to 15 degrees below it is doubtful. Prints, as Markdown,
where the place that is found lies and whether a warning comes, what is said of `--at` places of
either kind, and the error of the roll.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.compose.compose import DEFAULT_ROW
from deeplight.compose.floor import free_spots
from deeplight.compose.gravity import CameraPlacement, viewpoint_of
from deeplight.compose.ground import Viewpoint
from deeplight.errors import ConfigError
from deeplight.estimators.network import Estimate
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.tilt import tilt_of_estimate
from deeplight.frames import turned
from deeplight.io.photos import Photo
from deeplight.mappings.resample import sample_latlong
from deeplight.simulate.panorama import load, places_in
from deeplight.simulate.phone import PHONES, develop, draw_automatics, metered

FORMATS = ((384, 512, 53.0), (512, 384, 67.0))  # height, width, vertical field of view in degrees
PITCHES_DEG = (-35, -15, 0, 15, 35, 60)
ROLLS_DEG = (0, 8, 15)
FLOOR_RAD, NO_FLOOR_RAD, SHOWN_RAD = np.radians((15, 3, 20))
FREE, WARNED, REFUSED = "placed", "warned", "refused"


@dataclass(frozen=True, eq=False)
class Filmed:
    """A photo, where it was taken, and how the camera stood."""

    pixels: UInt8[np.ndarray, "height width 3"]
    truth: Viewpoint

    @property
    def fov_deg(self) -> float:
        return float(np.degrees(self.truth.camera.vertical_fov_rad))

    @property
    def shows_floor(self) -> bool:
        """Whether there is floor where the lowest patch of an object would be."""
        camera = self.truth.camera
        columns = np.linspace(0.25, 0.75, 5) * camera.width
        return max(self.truth.depression(x, 0.88 * camera.height) for x in columns) >= SHOWN_RAD

    @property
    def shows_none(self) -> bool:
        """Whether all of it is above what may be floor."""
        camera = self.truth.camera
        below = [self.truth.depression(x, camera.height) for x in np.linspace(0, camera.width, 3)]
        return max(below) < NO_FLOOR_RAD


def filmed(folder: Path, split: str) -> Iterator[Filmed]:
    """Photos of every place of a split."""
    for number, place in enumerate(p for p in places_in(folder) if p.split == split):
        radiance, rng = load(place), np.random.default_rng(number)
        for count, pitch in enumerate(PITCHES_DEG):
            for roll in ROLLS_DEG:
                height, width, fov_deg = FORMATS[(count + roll) % 2]
                camera = PinholeCamera(width, height, float(np.radians(fov_deg)))
                pitch_rad = float(np.radians(pitch + rng.uniform(-5, 5)))
                roll_rad = float(np.radians(roll * rng.choice((-1, 1))))
                view = Viewpoint(camera, 1.4, pitch_rad, roll_rad, rng.uniform(0, 2 * np.pi))
                rays = turned(camera.rays().astype(np.float32), view.world_from_camera)
                seen = sample_latlong(radiance, rays)
                automatics = draw_automatics(PHONES["paper"], rng)
                grey = seen[::8, ::8].reshape(-1, 3)
                gain = metered(grey, radiance.mean((0, 1)), automatics).gain
                yield Filmed(develop(seen, gain, automatics, 4, rng), view)


@dataclass(frozen=True)
class Found:
    """What is said of a photo, and what is true of it.

    Attributes:
        shown: whether it shows floor, None where it shows hardly any.
        said: of the place that is found: FREE, WARNED or REFUSED.
        below_rad: angle of that place below the true horizon.
        at: the same of a place, by whether that is floor.
        rolled, off_rad: the roll, to a degree, and the error of what is taken for it.
    """

    shown: bool | None
    said: str
    below_rad: float
    at: dict[bool, str]
    rolled: int
    off_rad: float


def found(filmed: Filmed, estimate: Estimate, rng: np.random.Generator) -> Found:
    """What `compose` says of a photo."""
    tilt, _ = tilt_of_estimate(estimate)
    view, _ = viewpoint_of(estimate.framing.camera, CameraPlacement(), tilt)
    low = min(estimate.framing.bottom, view.camera.height) * DEFAULT_ROW
    said, below = REFUSED, np.nan
    try:
        (spot,) = free_spots(filmed.pixels, view, 1, low)
        said, below = FREE if spot.free else WARNED, filmed.truth.depression(spot.x, spot.y)
    except ConfigError:
        pass
    at = {}
    places = rng.uniform(0.05, 0.95, (200, 2)) * (view.camera.width, view.camera.height)
    depths = np.array([filmed.truth.depression(x, y) for x, y in places])
    for is_floor, those in ((True, depths >= FLOOR_RAD), (False, depths < -NO_FLOOR_RAD)):
        if those.any():
            at[is_floor] = said_at(view, *places[np.argmax(those)])
    rolled = round(abs(np.degrees(filmed.truth.roll_rad)))
    shown = True if filmed.shows_floor else False if filmed.shows_none else None
    return Found(shown, said, below, at, rolled, abs(view.roll_rad - filmed.truth.roll_rad))


def said_at(view: Viewpoint, x: float, y: float) -> str:
    """What is said of a place that somebody gives."""
    try:
        view.point(x, y)
    except ConfigError:
        return REFUSED
    return WARNED if view.may_be_above(x, y) else FREE


def table(rows: Sequence[Found]) -> Iterator[str]:
    """The findings, as Markdown."""
    yield "| photos | placed: on floor / doubtful / on none | warned | refused |"
    yield "|---|---|---|---|"
    names = {True: "that show floor", None: "that show hardly any", False: "that show none"}
    for shown, name in names.items():
        of_kind = [row for row in rows if row.shown is shown]
        below = np.array([row.below_rad for row in of_kind if row.said == FREE])
        floor, none = (below >= FLOOR_RAD).sum(), (below < NO_FLOOR_RAD).sum()
        counts = [sum(row.said == said for row in of_kind) for said in (WARNED, REFUSED)]
        placed = f"{floor} / {len(below) - floor - none} / {none}"
        yield f"| {name} ({len(of_kind)}) | {placed} | {counts[0]} | {counts[1]} |"
    for is_floor, name in ((True, "floor"), (False, "none")):
        given = [row.at[is_floor] for row in rows if is_floor in row.at]
        shares = " | ".join(str(given.count(said)) for said in (FREE, WARNED, REFUSED))
        yield f"| `--at` a place that is {name} ({len(given)}) | {shares} |"
    yield ""
    for roll in ROLLS_DEG:
        off = np.degrees([row.off_rad for row in rows if row.rolled == roll and row.shown])
        near = (off < 5).mean()
        yield f"roll {roll}: off by {off.mean():.1f} degrees, by less than 5: {near:.0%}"


def main(args: argparse.Namespace) -> None:
    """Film, ask and print."""
    network, rng = OnnxEstimator(threads=1), np.random.default_rng(0)
    photos = filmed(args.panoramas, args.split)
    rows = [found(one, network.explain(Photo(one.pixels), one.fov_deg), rng) for one in photos]
    print(f"{args.split}: {len(rows)} photos\n")
    print("\n".join(table(rows)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("panoramas", type=Path)
    parser.add_argument("--split", choices=("val", "test"), default="val")
    main(parser.parse_args())
