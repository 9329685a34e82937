"""Make the pictures of docs/compose.md: python docs/pictures/make_compose.py.

Takes a few minutes. Needs the extra "render".
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from deeplight.compose.compose import Composed, ComposeSettings, Item
from deeplight.compose.gravity import CameraPlacement
from deeplight.compose.photo import compose_photo
from deeplight.compose.trace import Quality
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg, read_photo

HERE = Path(__file__).parent
PHOTOS = HERE.parents[1] / "examples" / "photos"
PITCH_DEG = -12.0  # of the frames filmed in panoramas, see LICENSES.md
QUALITY = Quality(samples=48, shadow_samples=48, shadow_pixels=4_000, most_rays=500_000)
OBJECTS = (Item("bunny", "diffuse"), Item("bunny", "silver"), Item("sphere", "mirror"))
WIDTH = 300


def main() -> None:
    rows = [strip(name) for name in ("meadow.jpg", "canteen.jpg")]
    write("compose.jpg", np.concatenate(rows))
    write("compose_below.jpg", below("canteen.jpg"))


def strip(name: str) -> np.ndarray:
    """The photo, and with each object."""
    photo = read_photo(PHOTOS / name).pixels
    pictures = [photo, *(made(name, [item]).composite.pixels for item in OBJECTS)]
    return np.concatenate([small(picture) for picture in pictures], axis=1)


def below(name: str) -> np.ndarray:
    """What lights from below: the photo's own surface, one colour, the estimate; enlarged."""
    tiles = []
    for text, changes in (
        ("the surface, as the photo shows it", {}),
        ("the surface, one colour", {"texture": False}),
        ("the estimate", {"light_from_below": True}),
    ):
        composed = made(name, [Item("sphere", "mirror")], **changes)
        height, width, _ = composed.composite.pixels.shape
        part = composed.composite.pixels[int(0.44 * height) : int(0.70 * height), width // 4 :]
        size = (WIDTH, WIDTH * len(part) * 2 // width)
        tile = Image.fromarray(part[:, : width // 2]).resize(size, Image.Resampling.LANCZOS)
        ImageDraw.Draw(tile).text((8, 6), text, "white")
        tiles.append(np.asarray(tile))
    return np.concatenate(tiles, axis=1)


def made(name: str, items: list[Item], **changes: bool) -> Composed:
    placement = CameraPlacement(pitch_deg=PITCH_DEG, roll_deg=0.0)
    settings = ComposeSettings(QUALITY, "scalar", **changes)
    return compose_photo(PHOTOS / name, items, placement=placement, settings=settings)


def small(picture: np.ndarray) -> np.ndarray:
    """The middle of a picture, where the object stands."""
    height, width, _ = picture.shape
    part = Image.fromarray(picture[int(0.22 * height) : int(0.78 * height)])
    return np.asarray(part.resize((WIDTH, WIDTH * part.height // width)))


def write(name: str, picture: np.ndarray) -> None:
    with replacing(HERE / name) as temporary:
        temporary.write_bytes(encode_jpeg(picture, 88))


if __name__ == "__main__":
    main()
