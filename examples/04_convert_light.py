"""Edit an estimate and hand it to several tools.

python examples/04_convert_light.py [PHOTO] [OUT]

`deeplight convert --test-panorama --out labelled.exr` writes a labelled panorama to check axes.
"""

import sys
from pathlib import Path

import deeplight

PHOTO = Path(__file__).parent / "photos" / "pagoda.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Write the light as glTF, for Blender, three.js and WebXR, and as a cube."""
    environment = deeplight.estimate(photo, fov_deg=50)  # leave fov_deg out if there is EXIF data
    light = environment.main_light
    print(f"main light: direction {light.direction.round(2)}, colour {light.colour.round(2)}")

    softer = environment.edited(deeplight.Edit(main_light=0.5, turn=(30, 0, 0), neutral=0.2))
    for ending in (".glb", ".py", ".js", ".webxr.json", ".jpg"):
        print("wrote", *deeplight.convert(softer, out / f"softer{ending}"))
    cube = deeplight.convert(
        softer, out / "softer_cube.exr", mapping="cube", made_for="three", size=64
    )
    print("wrote", *cube)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
