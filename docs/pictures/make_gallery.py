"""Run the numbered examples and draw docs/pictures/gallery.jpg from what they write.

python docs/pictures/make_gallery.py

Needs the extra `render`, for the object in a photo.
"""

import runpy
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import deeplight

ROOT = Path(__file__).resolve().parents[2]
OUT = Path(__file__).parent / "gallery.jpg"
HEIGHT, GAP, TITLE, LEAST = 240, 10, 22, 240
TITLES = (
    "01 estimate: the light of a photo",
    "02 relight: three spheres, and two stops darker",
    "03 film: a frame in a panorama",
    "04 convert: the light, edited",
    "05 compose: an object in the photo",
)


def main() -> None:
    """Two rows of pictures, each under its example's name."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        for script in sorted((ROOT / "examples").glob("*.py")):
            main_of = runpy.run_path(str(script))["main"]
            main_of(out=out / "filmed.jpg" if script.name[:2] == "03" else out)
        pictures = [
            _light(out / "pagoda.json"),
            _side_by_side(sorted(out.glob("coffee.*.png"))),
            Image.open(out / "filmed.jpg"),
            Image.open(out / "softer.jpg"),
            Image.open(out / "meadow.bunny.png"),
        ]
        small = [_as_high(picture) for picture in pictures]
    rows = (small[:2], small[2:])
    width = max(sum(max(picture.width, LEAST) + GAP for picture in row) for row in rows) + GAP
    sheet = Image.new("RGB", (width, 2 * (HEIGHT + TITLE + GAP) + GAP), "white")
    draw, font, titles = ImageDraw.Draw(sheet), ImageFont.load_default(13), iter(TITLES)
    for number, row in enumerate(rows):
        left, top = GAP, GAP + number * (HEIGHT + TITLE + GAP)
        for picture in row:
            draw.text((left, top), next(titles), "black", font)
            sheet.paste(picture, (left, top + TITLE))
            left += max(picture.width, LEAST) + GAP
    sheet.save(OUT, quality=85, optimize=True)


def _light(path: Path) -> Image.Image:
    """The panorama as a camera at the photo's exposure would show it."""
    radiance = deeplight.read_environment(path).radiance
    pixels = deeplight.CameraResponse().pixel_from_radiance(radiance)
    return Image.fromarray(np.rint(pixels * 255).astype(np.uint8))


def _side_by_side(paths: list[Path]) -> Image.Image:
    return Image.fromarray(np.hstack([np.asarray(Image.open(path)) for path in paths]))


def _as_high(picture: Image.Image) -> Image.Image:
    """Its own shape, at most as high as a row and twice as wide as that."""
    scale = min(HEIGHT / picture.height, 2 * HEIGHT / picture.width)
    size = round(picture.width * scale), round(picture.height * scale)
    return picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
