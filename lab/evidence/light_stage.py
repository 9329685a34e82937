"""How well bases measured in the virtual light stage stand in for the analytic ones.

python -m lab.evidence.light_stage HDRI [WORK]

Photographs the spheres with the defaults of `python -m lab.light_stage` (344 lights,
perspective, noise, spread of intensity and colour, dark room and hot pixels), measures their
bases in several ways and prints, as a Markdown table, the furnace and the masked L1 against the
analytic basis of the same view: mean absolute difference of gamma-encoded, soft-clipped crops
over mask and channels, under every panorama of the val places in three headings, each exposed
so that the logarithmic mean of its radiance is 0.18 of white. WORK keeps the photographs.
"""

import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from deeplight.camera_response import LUMINANCE, CameraResponse
from deeplight.frames import world_from_camera
from deeplight.light_stage.measure import Measured, MeasureSettings, measure
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball
from deeplight.reflectance import ReflectanceBasis, analytic_basis
from deeplight.relight import relight
from deeplight.simulate.panorama import load, places_in
from deeplight.sphere import PAPER_RIG, SphereView
from lab.light_stage.run import LightStage, lights_of, write_light_stage

HEADINGS_RAD = (0.3, 2.4, 4.5)
DOWN_RAD = -0.2
SPHERES = ("diffuse", "matte_silver")
RESPONSE = CameraResponse()


def lightings(folder: Path) -> list[Lighting]:
    """The val panoramas as a phone exposes them, roughly."""
    found = []
    for place in places_in(folder):
        if place.split != "val" or place.synthetic_ground:
            continue
        panorama = load(place)
        for yaw in HEADINGS_RAD:
            turn = world_from_camera(yaw, DOWN_RAD).T
            radiance = Lighting.from_latlong(panorama, turn).radiance
            luminance = (radiance @ LUMINANCE)[mirror_ball.coverage(32) > 0.999]
            gain = 0.18 / np.exp(np.log(np.maximum(luminance, 1e-9)).mean())
            found.append(Lighting(radiance * np.float32(gain)))
    return found


def masked_l1(a: ReflectanceBasis, b: ReflectanceBasis, light: Lighting) -> float:
    """Mean absolute difference of the two crops' pixel values."""
    first, second = (RESPONSE.pixel_from_radiance(relight(basis, light)) for basis in (a, b))
    return float(np.abs(first - second)[a.view.mask()].mean())


def row(name: str, measured: Measured, view: SphereView | None, lights: list[Lighting]) -> None:
    """One row of the table; with `view` after turning the bases there."""
    cells = [name]
    for sphere in SPHERES:
        basis = measured.bases[sphere]
        if view is not None:
            basis = basis.turned(view)
        furnace = basis.furnace()[basis.view.mask()]
        analytic = analytic_basis(sphere, basis.view)
        errors = [masked_l1(basis, analytic, light) for light in lights]
        cells.append(f"{furnace.mean():.4f} ({furnace.min():.4f} to {furnace.max():.4f})")
        cells.append(f"{np.mean(errors):.4f} (worst {np.max(errors):.4f})")
    print("| " + " | ".join(cells) + " |", flush=True)


def direction_errors(folder: Path) -> str:
    """How far from the truth the lights are that the mirror ball shows."""
    found = measure(folder, MeasureSettings(directions_from_mirror=True)).directions
    true = lights_of(LightStage()).directions
    assert true is not None
    off = np.degrees(np.arccos(np.clip((found * true).sum(axis=1), -1, 1)))
    front = true[:, 2] > np.cos(np.radians(140))
    return (
        f"directions: {front.sum()} lights up to 140 degrees from the camera's side: median "
        f"{np.median(off[front]):.3f}, worst {off[front].max():.3f} degrees; {(~front).sum()} "
        f"behind: median {np.median(off[~front]):.2f}, worst {off[~front].max():.2f}"
    )


def changed(folder: Path, into: Path, drop_dark: bool = False, **lights: object) -> Path:
    """The same photographs with another list of lights, or without dark frames."""
    for path in folder.rglob("*"):
        if path.is_file() and not (drop_dark and path.stem == "dark"):
            link = into / path.relative_to(folder)
            link.parent.mkdir(parents=True, exist_ok=True)
            os.link(path, link)
    described = json.loads((folder / "lights.json").read_text()) | lights
    (into / "lights.json").unlink()
    (into / "lights.json").write_text(json.dumps(described))
    return into


def main(hdri: str, work: str | None = None) -> None:
    lights = lightings(Path(hdri))
    print(f"{len(lights)} lightings\n\n| | diffuse: furnace | L1 | matte silver: furnace | L1 |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(dir=work) as temporary:
        scratch = Path(temporary)
        folder = (Path(work) if work else scratch) / "stage"
        write_light_stage(folder, LightStage())
        paper, twice = MeasureSettings(passes=1), MeasureSettings()
        default = measure(folder, twice)
        row("as it is (two passes)", default, None, lights)
        row("the paper's lobe alone (one pass)", measure(folder, paper), None, lights)
        row("three passes", measure(folder, MeasureSettings(passes=3)), None, lights)
        far = changed(folder, scratch / "far", distance_m=None)
        row("lights taken as far away", measure(far, twice), None, lights)
        uncalibrated = changed(folder, scratch / "uncalibrated", calibrated=False)
        row("scale from the mirror ball", measure(uncalibrated, twice), None, lights)
        found = MeasureSettings(directions_from_mirror=True)
        row("directions and scale from the mirror ball", measure(uncalibrated, found), None, lights)
        dark = changed(folder, scratch / "dark", drop_dark=True)
        row("no dark frame", measure(dark, twice), None, lights)
        same = SphereView(
            PAPER_RIG.views["mirror"].ball_from_camera,
            default.bases["diffuse"].view.angular_radius_rad,
        )
        row("turned 28 degrees, same distance", default, same, lights)
        row("turned into the rig, 60 cm away", default, PAPER_RIG.views["mirror"], lights)
        sparse = scratch / "sparse"
        write_light_stage(sparse, LightStage(("matte_silver", "diffuse"), spacing_deg=24))
        row("lights 24 degrees apart", measure(sparse, twice), None, lights)
        half = scratch / "half"
        write_light_stage(half, LightStage(("matte_silver", "diffuse"), lowest_deg=-30))
        row("no lights 30 degrees below the level", measure(half, twice), None, lights)
        print("\n" + direction_errors(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
