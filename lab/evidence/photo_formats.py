"""What it is worth to slide the network's view into a photo, and to look at it twice.

    python -m lab.evidence.photo_formats ../shared/hdri --split val

Films photos of several formats in places with known light (a phone's automatic exposure and white
balance, tone curve, vignetting, noise; six headings, level and looking down) and prints L1 of the
three spheres for the view around the photo's centre, for that slid into the photo
(`preprocess.slid_into_photo`), and for what `estimate` does with that (`preprocess.looks`): of the
network's light, and of the environment with the photo in it.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from deeplight.estimators.environment import assemble
from deeplight.estimators.look import Answer, seen_from_photo
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.projection import ImagePlane
from deeplight.lighting import Lighting
from deeplight.preprocess import Framing, frame_photo, looks, network_input, slid_into_photo
from deeplight.simulate.panorama import load, places_in
from deeplight.simulate.phone import PHONES
from lab.pans import Pan, Sweep, Troubles, film_pan
from lab.pans_table import Scores

FORMATS = {
    "4:3 on its side, 54°": (384, 512, 54.0),
    "4:3 on its side, 52°": (384, 512, 52.0),
    "9:16 upright, 58°": (512, 288, 58.0),
    "9:16 upright, 66°": (512, 288, 66.0),
    "3:4 upright, 69°": (512, 384, 69.0),
    "16:9 on its side, 42°": (360, 640, 42.4),
}
"""Height and width in pixels, vertical field of view in degrees."""
PITCHES_DEG = (-5.0, -25.0)
ROWS = 128  # of the environments


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.evidence.photo_formats`."""

    panoramas: Annotated[Path, tyro.conf.Positional]
    """Folder of HDR panoramas."""
    split: Literal["val", "test"] = "val"
    """Which places."""
    formats: tuple[str, ...] = tuple(FORMATS)
    """Which formats."""


def photos(args: Args, name: str) -> Iterator[tuple[Pan, int]]:
    """Pans of photos of one format, and the number of each photo in its pan."""
    height, width, fov_deg = FORMATS[name]
    phone = replace(PHONES["paper"], name=name, vertical_fov_rad=float(np.radians(fov_deg)))
    places = [place for place in places_in(args.panoramas) if place.split == args.split]
    for number, place in enumerate(places):
        for k, pitch in enumerate(PITCHES_DEG):
            rng = np.random.default_rng([number, k])
            pan = film_pan(load(place), Sweep(6, (pitch,)), Troubles(), rng, (height, width), phone)
            yield from ((pan, frame) for frame in range(len(pan.frames)))


def lights(
    network: OnnxEstimator, pixels: np.ndarray, views: Sequence[Framing]
) -> tuple[Lighting, ...]:
    """The network's light of a photo seen through some views, and that with the photo in it."""
    shown = np.stack([network_input(pixels, view) for view in views])
    found = seen_from_photo([*map(Answer, *network.estimate_fully(shown))], views)
    alone = Lighting.from_log_radiance(found.log_radiance)
    height, width, _ = pixels.shape
    plane = ImagePlane.centred(height, width, views[0].vertical_fov_rad)
    scene = assemble(alone, pixels, plane, ROWS, found.lamps, None)
    return alone, scene.environment.lighting


def main(args: Args) -> None:
    """Print a table for each format."""
    network = OnnxEstimator(threads=1)
    for name in args.formats:
        scores = Scores()
        for pan, k in photos(args, name):
            pixels, truth = pan.frames[k].pixels, pan.true_lighting(k)
            centred = frame_photo(len(pixels), pixels.shape[1], pan.camera.vertical_fov_rad)
            slid = slid_into_photo(centred)
            ways = {"around the centre": [centred], "slid": [slid], "looked at twice": looks(slid)}
            for way, views in ways.items():
                found = lights(network, pixels, views)
                for what, light in zip(("network", "with the photo"), found, strict=True):
                    scores.add(f"{what}, {way}", light, truth)
        print(f"{name}, {args.split}, slid by {-np.degrees(slid.pitch_rad):.1f}°:\n")
        scores.table("network, around the centre")
        sys.stdout.flush()


if __name__ == "__main__":
    main(tyro.cli(Args))
