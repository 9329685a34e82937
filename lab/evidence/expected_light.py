"""Whether lights are better with the radiance that is to be expected than with the likeliest one.

    python -m lab.evidence.expected_light DATA --split val_indoor val_outdoor [--examples 96]

A network's ln radiance is near the middle of what may be; if ln radiance is off by s, the mean is
exp(s^2 / 2) times it. Here the whole estimate, or its lamps alone, times exp(C s^2 / 2) with s the
photo's own stated scale of ln radiance or of brightness, or times a fixed number. Printed: L1 of
grey surfaces by where they face (as `facing_light`) and of the rig's three spheres, as composites
have the light (soft lamps) and as `deeplight estimate` writes it, and the differences from the
light as it is with their standard errors over places.
"""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from deeplight.brdf import REFLECTIVITY
from deeplight.camera_response import CameraResponse
from deeplight.dataset import Example, open_dataset
from deeplight.estimators.environment import assemble
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.sureness import glow_rad
from deeplight.lighting import Lighting
from deeplight.lobe import lobe_on_ball
from deeplight.preprocess import normalise
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.sphere import SphereView
from lab.evidence.facing_light import GREY, ROWS, irradiance, upright_normals

MOST = 2.5  # a gain is never larger
Heads = Mapping[str, float]
_ENCODE = CameraResponse().pixel_from_radiance
_BASES = [analytic_basis(name, SphereView()) for name in REFLECTIVITY]


def by_scale(name: str, share: float) -> Callable[[Heads], float]:
    """The gain of one photo by what it says of itself."""
    return lambda heads: min(float(np.exp(share * heads[name] ** 2 / 2)), MOST)


GAINS: dict[str, tuple[Callable[[Heads], float], bool]] = {
    "as it is": (lambda _: 1.0, False),
    "all x 1.1": (lambda _: 1.1, False),
    "all, ln radiance, 0.25": (by_scale("log_radiance_scale", 0.25), False),
    "all, brightness, 0.25": (by_scale("brightness_scale", 0.25), False),
    "lamps x 1.3": (lambda _: 1.3, True),
    "lamps, brightness, 0.5": (by_scale("brightness_scale", 0.5), True),
}
"""Of the whole estimate, or (True) of its lamps alone."""


def errors(example: Example, model: OnnxEstimator) -> list[list[float]]:
    """For each gain the error of grey surfaces, and of the spheres in soft light and as written."""
    truth = Lighting(example.known_lighting)
    normals = upright_normals(np.array(example.meta.details["world_from_camera"]))
    grey = _ENCODE(GREY / np.pi * irradiance(truth.latlong(ROWS), normals))
    spheres = [_ENCODE(relight(basis, truth)) for basis in _BASES]
    (log_radiance,), (lamps,), (heads,) = model.estimate_fully(normalise(example.background[None]))
    whole, glow = model.contract, glow_rad(heads)
    plane = ImagePlane(-whole.right, whole.right, whole.bottom, whole.top)
    rows = []
    for gain_of, lamps_alone in GAINS.values():
        gain, radiance = gain_of(heads), np.exp(log_radiance)
        own = [lobe_on_ball(lamp) for lamp in lamps] if lamps_alone else [radiance]
        light = Lighting(radiance + np.float32(gain - 1) * np.sum(own, axis=0))
        stronger = [lamp.scaled(gain) for lamp in lamps]
        scene = assemble(light, example.background, plane, ROWS, stronger)
        soft = scene.environment if glow is None else scene.softened(glow).environment
        found = _ENCODE(GREY / np.pi * irradiance(soft.radiance, normals))
        row = [float(np.abs(found - grey).mean())]
        for ball in (soft.lighting, scene.environment.lighting):
            for basis, true in zip(_BASES, spheres, strict=True):
                apart = np.abs(_ENCODE(relight(basis, ball)) - true)[true.sum(-1) > 0]
                row.append(float(apart.mean()))
        rows.append(row)
    return rows


def main(args: argparse.Namespace) -> None:
    """Print the table."""
    model, found, places = OnnxEstimator(threads=1), [], []
    for split in args.split:
        index = open_dataset(args.data).index(split)
        for number in np.unique(np.linspace(0, len(index) - 1, args.examples).astype(int)):
            example = index[int(number)]
            places.append(example.meta.place)
            found.append(errors(example, model))
    values, names = np.array(found), np.unique(places)
    means = np.stack([values[np.array(places) == name].mean(0) for name in names])
    print(f"{len(values)} photos of {len(names)} places; grey, then {', '.join(REFLECTIVITY)}")
    for number, gain in enumerate(GAINS):
        less = means[:, number] - means[:, 0]
        error = less.std(0, ddof=1) / np.sqrt(len(names))
        print(f"{gain:24}" + "".join(f"{value:9.4f}" for value in values[:, number].mean(0)))
        if number:
            print(f"{'  less as it is':24}" + "".join(f"{value:+9.4f}" for value in less.mean(0)))
            print(f"{'  its standard error':24}" + "".join(f"{value:9.4f}" for value in error))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", nargs="+", default=["val"])
    parser.add_argument("--examples", type=int, default=96, help="of each split")
    main(parser.parse_args())
