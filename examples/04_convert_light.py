"""Edit an estimate and hand it to several tools; draw the labelled test panorama beside it.

python examples/04_convert_light.py [PHOTO] [OUT]
"""

import sys
from pathlib import Path

import deeplight
from deeplight.edit import Edit
from deeplight.environment import Environment
from deeplight.formats.files import Wish, write_environment
from deeplight.formats.labelled import labelled_environment

PHOTO = Path(__file__).parent / "photos" / "pagoda.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Write the light as glTF, for Blender, three.js and WebXR, and as a cube."""
    lighting = deeplight.estimate(photo, fov_deg=50)  # leave fov_deg out if the photo has EXIF data
    whole = Environment(lighting.latlong(256))
    light = whole.main_light
    print(f"main light: direction {light.direction.round(2)}, colour {light.colour.round(2)}")

    softer = whole.edited(Edit(main_light=0.5, turn=(30, 0, 0), neutral=0.2))
    wishes = [Wish(out / f"softer{end}") for end in (".glb", ".py", ".js", ".webxr.json", ".jpg")]
    wishes.append(Wish(out / "softer_cube.exr", mapping="cube", made_for="three", size=64))
    for wish in wishes:
        print("wrote", *write_environment(softer, wish))
    print("wrote", *write_environment(labelled_environment(), Wish(out / "labelled.exr")))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
