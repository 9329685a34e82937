"""Draw docs/pictures/convert.png: our two balls and each tool's, in the labelled panorama.

DEEPLIGHT_ROUND_TRIP_PICTURES=FOLDER make round-trip
python docs/pictures/make_convert.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from deeplight.camera_response import CameraResponse
from deeplight.formats.labelled import labelled_environment
from deeplight.io.radiance import read_hdr

OUT = Path(__file__).parent / "convert.png"
SCALE, GAP = 3, 12


def main(folder: Path) -> None:
    """Panorama above, one column of balls for each tool below."""
    names = sorted((path.stem for path in folder.glob("*.exr")), key=lambda name: name != "ours")
    font = ImageFont.load_default(15)
    side = 64 * SCALE
    width = len(names) * (side + GAP) + GAP
    tall = (width - 2 * GAP) // 4
    picture = Image.new("RGB", (width, GAP + 2 * tall // 2 + 2 * side + 3 * GAP + 20), "white")
    panorama = _shown(labelled_environment(512).radiance).resize((2 * tall, tall))
    picture.paste(panorama, ((width - 2 * tall) // 2, GAP))
    draw = ImageDraw.Draw(picture)
    top = tall + 2 * GAP
    for index, name in enumerate(names):
        left = GAP + index * (side + GAP)
        draw.text((left + side / 2, top + 8), name, "black", font, "mm")
        balls = read_hdr(folder / f"{name}.exr")
        for row, ball in enumerate((balls[:, :64], balls[:, 64:])):
            small = _shown(ball).resize((side, side), Image.Resampling.LANCZOS)
            picture.paste(small, (left, top + 20 + row * (side + GAP)))
    picture.quantize(256).save(OUT, optimize=True)


def _shown(radiance: np.ndarray) -> Image.Image:
    pixels = CameraResponse().pixel_from_radiance(radiance)
    return Image.fromarray(np.round(pixels * 255).astype(np.uint8))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
