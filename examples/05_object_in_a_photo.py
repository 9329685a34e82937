"""Put an object into a photo, lit by the photo's own light: `out/examples/<photo>.bunny.png`.

python examples/05_object_in_a_photo.py [PHOTO] [OUT]

Needs the extra `render`.
"""

import sys
from pathlib import Path

from PIL import Image

import deeplight

PHOTO = Path(__file__).parent / "photos" / "meadow.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Render, write the picture and print what had to be assumed."""
    composed = deeplight.compose_photo(photo, ["bunny"])
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{photo.stem}.bunny.png"
    Image.fromarray(composed.composite.pixels).save(path)
    print("wrote", path)
    for note in composed.notes:
        print("  ", note)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
