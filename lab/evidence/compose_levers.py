"""What other lamps, or a brighter light, would do to composites, and how much of their error is
brightness alone.

    python -m lab.evidence.compose_levers data/sim [--split val] [--cases 24] [--out runs/levers]

The bunny under the estimate as composites have it and with one thing changed, against the same
under the true light, as `compose_evidence` measures it (16 rays a pixel, two materials). Renders
for 4 minutes of processor time and keeps its pictures.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from deeplight.dataset import Example, open_dataset
from deeplight.estimators.environment import SceneLight
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.sureness import SOFTENED, glow_rad
from deeplight.lamp import in_their_middle
from deeplight.lighting import Lighting
from lab.evidence.compose_evidence import (
    DARK,
    TRUTH,
    chosen,
    object_error,
    scene_of,
    shadow_errors,
)
from lab.evidence.compose_evidence_pictures import LATLONG_HEIGHT, picture
from lab.evidence.compose_evidence_tables import MATERIALS

AS_IT_IS = "as it is"
Found = dict[str, list[tuple[float, float, float]]]  # object, its mean signed error, shadow


def levers(scene: SceneLight, glow: float) -> dict[str, np.ndarray]:
    """Panoramas by what is changed."""
    plain = scene.softened(glow).environment.radiance
    found = {AS_IT_IS: plain, "1.12 times brighter": plain * np.float32(1.12)}
    for part in (0.3, 0.9):
        soft = scene.softened(glow * part / SOFTENED).environment.radiance
        found[f"glows of {part} times the doubt"] = soft
    lamps = tuple(lamp.scaled(1.35) for lamp in scene.lamps)
    brighter = replace(scene, lamps=lamps).softened(glow)
    found["lamps 1.35 times brighter"] = brighter.environment.radiance
    if scene.lamps:
        together = replace(scene, lamps=(in_their_middle(scene.lamps),)).softened(glow)
        found["one lamp in their middle"] = together.environment.radiance
    return found


def measured(example: Example, lights: dict[str, np.ndarray], material: str, kept: Path) -> Found:
    """Errors under each light but the true one."""
    made = {name: picture(kept, example, light, material, 1) for name, light in lights.items()}
    true = made[TRUTH]
    region = np.min([one.shadow for one in made.values()], axis=0) < DARK
    found: Found = {}
    for name in list(lights)[1:]:
        signed = ((made[name].object - true.object).mean(-1) * true.cover).sum() / true.cover.sum()
        shadow = shadow_errors(true.shadow, made[name].shadow, region)[0]
        found[name] = [(object_error(made, name), float(signed), shadow)]
    return found


def said(material: str, found: Found) -> str:
    """Means over the cases, with the change from the light as it is and its standard error."""
    base = np.array(found[AS_IT_IS])
    even = abs(base[:, 1]).mean() / base[:, 0].mean()
    lines = [f"{material}, {len(base)} cases; {even:.0%} of the object's error is even: brightness"]
    for name, rows in found.items():
        values = np.array(rows)
        if len(values) < len(base):
            continue  # a case without lamps has no such light
        change = values - base
        for number, what in ((0, "object"), (2, "shadow")):
            mean, by = values[:, number].mean(), change[:, number]
            error = by.std() / len(by) ** 0.5
            lines.append(f"  {what}, {name:32}{mean:.4f} ({by.mean():+.4f} +- {error:.4f})")
    return "\n".join(lines)


def main(args: argparse.Namespace) -> None:
    """Render, and print the errors by material."""
    data, model = open_dataset(args.data), OnnxEstimator(threads=1)
    found: dict[str, Found] = {material: {} for material in MATERIALS}
    for example in chosen(data.index(args.split), args.cases):
        scene, heads = scene_of(model, example.background)
        truth = Lighting(example.known_lighting).latlong(LATLONG_HEIGHT)
        lights = {TRUTH: truth, **levers(scene, glow_rad(heads) or 0.0)}
        for material, by_lever in found.items():
            for name, rows in measured(example, lights, material, args.out / "pictures").items():
                by_lever.setdefault(name, []).extend(rows)
    for material, by_lever in found.items():
        print(said(material, by_lever))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--out", type=Path, default=Path("runs/levers"))
    main(parser.parse_args())
