"""Estimate the light of one photo and look at what can be had from it.

python examples/01_estimate.py [PHOTO] [OUT]
"""

import sys
from pathlib import Path

import numpy as np

import deeplight
from deeplight.harmonics import dominant_light, project
from deeplight.io.environment_file import load_lighting
from deeplight.io.lighting_file import save_lighting

PHOTO = Path(__file__).parent / "photos" / "pagoda.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Write `<photo>.exr` and `.json`, and print the light in numbers."""
    lighting = deeplight.estimate(photo, fov_deg=50)  # leave fov_deg out if the photo has EXIF data

    light = dominant_light(lighting)
    right, up, back = light.direction
    print(f"main light: {light.share:.0%} of all power, direction {right:.2f} {up:.2f} {back:.2f}")
    print(f"  that is {np.degrees(np.arcsin(up)):.0f} degrees above the camera's horizon,")
    print(f"  {'behind' if back > 0 else 'in front of'} the camera")
    print(f"panorama {lighting.latlong().shape}, six cube faces {lighting.cube().shape}")
    print(f"mean radiance {project(lighting)[0] * 0.282095} (1 is the camera's white)")

    files = save_lighting(lighting, out / photo.stem)
    assert np.array_equal(load_lighting(files[-1]).radiance, lighting.radiance)
    print("wrote", *files)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
