"""Estimate the light of one photo and look at what can be had from it.

python examples/01_estimate.py [PHOTO] [OUT]
"""

import sys
from pathlib import Path

import numpy as np

import deeplight

PHOTO = Path(__file__).parent / "photos" / "pagoda.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Write `<photo>.exr` and `.json`, and print the light in numbers."""
    environment = deeplight.estimate(photo, fov_deg=50)  # leave fov_deg out if there is EXIF data

    print(environment)
    light = environment.main_light
    right, up, back = light.direction
    print(f"main light: {light.share:.0%} of all power, direction {right:.2f} {up:.2f} {back:.2f}")
    print(f"  that is {np.degrees(np.arcsin(up)):.0f} degrees above the camera's horizon,")
    print(f"  {'behind' if back > 0 else 'in front of'} the camera")
    for lamp in environment.lamps:
        print(
            f"lamp of {np.degrees(lamp.angular_radius_rad):.1f} degrees, flux {lamp.flux.round(2)}"
        )
    print(f"six cube faces {environment.cube().shape}")
    mean = deeplight.spherical_harmonics(environment)[0] * 0.282095
    print(f"mean radiance {mean} (1 is the camera's white)")

    files = deeplight.convert(environment, out / f"{photo.stem}.json")
    back_again = deeplight.read_environment(files[0])
    assert np.allclose(back_again.lighting.power(), environment.lighting.power(), rtol=0.03)
    print("wrote", *files)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
