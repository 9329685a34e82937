"""What recipe v2 changes: colours, clipping, how true its spheres are; and how true its light is.

    python lab/evidence/many_phones.py --hdri FOLDER --data data/sim-v1 data/sim-v2

Prints the figures of docs/simulate.md: for each data set over its validation examples, and for the
quick way of gathering light over every ninth panorama, next to the exact one.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from deeplight.camera_response import encode
from deeplight.dataset import Example, open_dataset
from deeplight.lighting import Lighting
from deeplight.mappings import resample
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight, relight_rig
from deeplight.simulate import panorama
from deeplight.simulate.many_takes import held_anywhere, sphere_radiance
from deeplight.simulate.place_light import PlaceLight
from deeplight.simulate.take import shrink_ball
from deeplight.sphere import PAPER_RIG

SPLITS = ("val_indoor", "val_outdoor")
BRIGHTNESS = 0.4  # of the diffuse sphere, for comparing light at a like exposure
MASKS = {name: view.mask() for name, view in PAPER_RIG.views.items()}


@dataclass(frozen=True)
class Args:
    """Settings of the measurement."""

    hdri: Path
    """Folder of HDR panoramas."""
    data: tuple[Path, ...] = ()
    """Data sets that `deeplight simulate` made, with validation splits."""


def truth_error(example: Example) -> list[float]:
    """Masked L1 between the crops and the true lighting relit, sphere by sphere."""
    assert example.true_lighting is not None
    lit = relight_rig(PAPER_RIG, Lighting(example.true_lighting))
    return [
        float(abs(encode(np.clip(lit[name], 0, 1)) - example.spheres[name] / 255)[mask].mean())
        for name, mask in MASKS.items()
    ]


def light_error(radiance: np.ndarray, seed: int) -> list[float]:
    """Masked L1 between spheres in light gathered quickly and as recipe v1 does."""
    pose = next(held_anywhere(1, np.random.default_rng(seed)))
    quick = PlaceLight.of(radiance).ball(128, pose)
    exact = resample.ball_from_latlong(radiance, 128, pose.T)
    made = {name: crops[:, :, 0] for name, crops in sphere_radiance(PAPER_RIG, [quick]).items()}
    light = {"mirror": Lighting(exact), "rough": Lighting(shrink_ball(exact, 64))}
    gain = BRIGHTNESS / float(made["diffuse"][MASKS["diffuse"]].mean())
    errors = []
    for name, mask in MASKS.items():
        lit = light["mirror" if name == "mirror" else "rough"]
        wanted = relight(analytic_basis(name, PAPER_RIG.views[name], lit.size), lit)
        pixels = [encode(np.minimum(crop[mask] * gain, 1)) for crop in (made[name], wanted)]
        errors.append(float(abs(pixels[0] - pixels[1]).mean()))
    return errors


def main(args: Args) -> None:
    print("data set | examples | L1 to the truth, " + " / ".join(MASKS), end=" | ")
    print("ln chroma of the mean light, sd | diffuse clipped | photo clipped")
    for folder in args.data:
        data = open_dataset(folder)
        examples = [example for split in SPLITS for example in data.examples(split)]
        errors = np.mean([truth_error(example) for example in examples], axis=0)
        light = [e.true_lighting for e in examples if e.true_lighting is not None]
        mean = np.log(np.maximum([radiance.mean(axis=(0, 1)) for radiance in light], 1e-9))
        chroma = (mean - mean.mean(axis=1, keepdims=True)).std(axis=0)
        clipped = np.mean([e.spheres["diffuse"][MASKS["diffuse"]] == 255 for e in examples])
        photo = np.mean([(e.background == 255).mean() for e in examples])
        print(f"{folder.name} | {len(examples)} | {row(errors)} | {row(chroma)}", end=" | ")
        print(f"{clipped:.3f} | {photo:.3f}")
    places = [p for p in panorama.places_in(args.hdri) if not p.synthetic_ground][::9]
    errors = np.mean([light_error(panorama.load(p), n) for n, p in enumerate(places)], axis=0)
    print(f"light gathered quickly, {len(places)} panoramas: L1 {row(errors)}")


def row(values: np.ndarray) -> str:
    return " / ".join(f"{value:.4f}" for value in values)


if __name__ == "__main__":
    main(tyro.cli(Args))
