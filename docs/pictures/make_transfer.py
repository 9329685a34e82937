"""Make the pictures of docs/transfer.md: python docs/pictures/make_transfer.py.

Takes some minutes. Needs the extra "render".
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from deeplight import harmonics
from deeplight.camera_response import CameraResponse
from deeplight.estimators.estimate import load_estimator
from deeplight.frames import rotation
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg, read_photo
from deeplight.lighting import Lighting
from deeplight.transfer import file as transfer_file
from deeplight.transfer.ground import open_plane
from deeplight.transfer.precompute import Transfer
from deeplight.transfer.reference import path_traced
from deeplight.transfer.view import Eye, view

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PHOTO = ROOT / "examples/photos/meadow.jpg"
OBJECTS = ROOT / "web/public/objects"
EYE = Eye((0.9, 0.85, 2.2), (0, 0.42, 0), float(np.radians(33)), 200, 250)
SAMPLES = 64
WHOLE = 16  # the order that holds all of a 32 x 32 light but its finest detail
STOPS = -0.9  # so that nothing is clipped


def main() -> None:
    lighting = load_estimator().estimate(read_photo(PHOTO))
    bunny, pot = (transfer_file.read(OBJECTS / f"{name}.transfer") for name in ("bunny", "pot"))
    rows = [compared(bunny, "diffuse", lighting), compared(pot, "glossy", lighting)]
    write("transfer.jpg", np.concatenate(rows))
    write("transfer_shadow.jpg", turned(bunny, lighting))


def compared(transfer: Transfer, finish: str, lighting: Lighting) -> np.ndarray:
    """By transfer; path traced in the same light; path traced in all of the light."""
    same, whole = (
        harmonics.spherical_harmonics(lighting, order).astype(float) for order in (4, WHOLE)
    )
    fast, slow = shaded(transfer, same, finish), traced(transfer, same, finish)
    difference = np.abs(pixels(fast) - pixels(slow)) * 4
    tiles = [
        labelled(pixels(fast), f"transfer, order 4, {finish}"),
        labelled(pixels(slow), "path traced, the same light"),
        labelled(difference, "4 x their difference"),
        labelled(pixels(traced(transfer, whole, finish)), f"path traced, light of order {WHOLE}"),
    ]
    return np.concatenate(tiles, axis=1)


def turned(transfer: Transfer, lighting: Lighting) -> np.ndarray:
    """The light turned about the vertical, by transfer alone."""
    light = harmonics.spherical_harmonics(lighting, 4).astype(float)
    tiles = []
    for degrees in (0, 90, 180, 270):
        turn = harmonics.turning(rotation("y", np.radians(degrees)), 4)
        picture = pixels(shaded(transfer, turn @ light, "diffuse"))
        tiles.append(labelled(picture, f"light turned by {degrees} degrees"))
    return np.concatenate(tiles, axis=1)


def shaded(transfer: Transfer, light: np.ndarray, finish: str) -> np.ndarray:
    """Radiance of object and ground, by transfer."""
    finer = replace(EYE, height=2 * EYE.height, width=2 * EYE.width)
    seen = view(transfer, light, finish, finer)
    assert transfer.shadowed is not None
    ground = transfer.shadowed.ground.reflectivity * (open_plane(transfer.order) @ light)
    radiance = np.where(seen.cover[..., None], seen.radiance, seen.shadow * ground)
    return radiance.reshape(EYE.height, 2, EYE.width, 2, 3).mean(axis=(1, 3))


def traced(transfer: Transfer, light: np.ndarray, finish: str) -> np.ndarray:
    return path_traced(transfer, light, finish, EYE, SAMPLES)


def pixels(radiance: np.ndarray) -> np.ndarray:
    """0 to 255, gamma-encoded."""
    response = CameraResponse(exposure_stops=STOPS)
    return response.pixel_from_radiance(np.maximum(radiance, 0)) * 255


def labelled(picture: np.ndarray, text: str) -> np.ndarray:
    tile = Image.fromarray(np.clip(np.round(picture), 0, 255).astype(np.uint8))
    ImageDraw.Draw(tile).text((6, 4), text, "white", stroke_width=1, stroke_fill="black")
    return np.asarray(tile)


def write(name: str, picture: np.ndarray) -> None:
    with replacing(HERE / name) as temporary:
        temporary.write_bytes(encode_jpeg(picture, 90))


if __name__ == "__main__":
    main()
