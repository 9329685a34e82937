"""Put rendered layers into the photo: differential rendering, after Debevec 1998.

Debevec adds to the clean photo what the objects change: photo + (with - without). Here the
change on the plane is a factor, photo x (with / without), which is the same with the plane's albedo
taken from each pixel's own colour, so a texture stays itself in the shadow.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from jaxtyping import Float, UInt8

from deeplight.camera_response import CameraResponse
from deeplight.compose.look import NO_LOOK, Look, blurred, grain
from deeplight.compose.trace import Layers
from deeplight.errors import ImageFileError
from deeplight.io.image_file import write_image

UNSEEN = 2e-3  # a change of light smaller than this leaves an 8-bit pixel as it is
RESPONSE = CameraResponse()


@dataclass(frozen=True, eq=False)
class Composite:
    """The picture and what it was put together from.

    Attributes:
        pixels: the photo with the objects in it; gamma-encoded.
        layers: as rendered, with the photo's blur.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    layers: Layers


def composite(
    photo: UInt8[np.ndarray, "height width 3"],
    layers: Layers,
    look: Look = NO_LOOK,
    response: CameraResponse = RESPONSE,
    seed: int = 0,
) -> Composite:
    """Put the layers into the photo; pixels that nothing changes keep their bytes.

    Args:
        photo: upright, the clean plate.
        layers: of a part of it.
        look: blur and grain to give to the objects.
        response: how the camera turned radiance into pixels.
        seed: of the grain.
    """
    if not layers.cover.size:  # out of the picture
        return Composite(np.array(photo), layers)
    layers = _softened(layers, look.blur_px)
    left, top, right, bottom = layers.crop
    plate = photo[top:bottom, left:right]
    cover = layers.cover[..., None]
    radiance = radiance_of(plate, response) * layers.shadow * (1 - cover) + layers.radiance
    pixel = response.pixel_from_radiance(radiance)
    pixel = pixel + grain(look, bottom - top, right - left, seed) * cover
    changed = (cover > 0) | (np.abs(layers.shadow - 1) > UNSEEN).any(-1, keepdims=True)
    result = np.array(photo)
    encoded = np.floor(np.clip(pixel, 0, 1) * 255 + 0.5).astype(np.uint8)
    result[top:bottom, left:right] = np.where(changed, encoded, plate)
    return Composite(result, layers)


def radiance_of(
    photo: UInt8[np.ndarray, "height width 3"], response: CameraResponse = RESPONSE
) -> Float[np.ndarray, "height width 3"]:
    """Radiance relative to the camera's white; a clipped pixel gives a lower bound."""
    return response.radiance_from_pixel(photo.astype(np.float32) / 255)


def write_layers(path: Path | str, layers: Layers, height: int, width: int) -> None:
    """Write an EXR of the photo's size for who composites elsewhere, float32, linear.

    Channels R, G, B, A are the objects, premultiplied; shadow.R, .G, .B is the factor on the
    photo; mask.Y is A alone. The picture is photo x shadow x (1 - A) + RGB.

    Raises:
        ImageFileError: a name that does not end in .exr.
        OSError: the file cannot be written.
    """
    if Path(path).suffix.lower() != ".exr":
        raise ImageFileError("a name ending in .exr for the layers", f"{path}", "rename it")
    values = np.zeros((height, width, 8), np.float32)
    values[..., 4:7] = 1
    left, top, right, bottom = layers.crop
    parts = (layers.radiance, layers.cover[..., None], layers.shadow, layers.cover[..., None])
    values[top:bottom, left:right] = np.concatenate(parts, axis=-1)
    spec = oiio.ImageSpec(width, height, 8, oiio.FLOAT)
    spec.channelnames = ("R", "G", "B", "A", "shadow.R", "shadow.G", "shadow.B", "mask.Y")
    spec.attribute("compression", "zip")
    spec.attribute("deeplight:unit", "linear radiance; 1.0 is the camera's white")
    write_image(Path(path), spec, values)


def _softened(layers: Layers, sigma_px: float) -> Layers:
    if sigma_px <= 0:
        return layers
    both = np.concatenate([layers.radiance, layers.cover[..., None]], axis=-1)
    both = blurred(both, sigma_px)
    return replace(layers, radiance=both[..., :3], cover=both[..., 3])
