"""A test panorama: each direction has its name and colour, and a lamp stands on one side."""

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw, ImageFont

from deeplight.edit import direction_of
from deeplight.environment import Environment
from deeplight.mappings import cube, latlong
from deeplight.mappings.layouts import latlong_from_cube

# Name and radiance of each face, in the order of `cube.FACES`.
LABELS: dict[str, tuple[str, tuple[float, float, float]]] = {
    "+x": ("RIGHT", (0.80, 0.05, 0.05)),
    "-x": ("LEFT", (0.05, 0.60, 0.60)),
    "+y": ("UP", (0.05, 0.70, 0.05)),
    "-y": ("DOWN", (0.60, 0.05, 0.60)),
    "+z": ("BACK", (0.08, 0.08, 0.90)),
    "-z": ("FRONT", (0.75, 0.65, 0.05)),
}
LAMP_DIRECTION = direction_of(60, 35)  # on the right in front, high up
LAMP_RADIUS_DEG = 4.0
LAMP_RADIANCE = (60.0, 54.0, 45.0)
_INK = 0.02


def labelled_environment(height: int = 512) -> Environment:
    """Draw the six faces with their names upright, white at the edges, and a warm lamp.

    Seen from inside, the names read left to right. UP reads for somebody who looks ahead and then
    raises the head, DOWN for somebody who lowers it.
    """
    faces = np.stack([_face(name, height // 2) for name in cube.FACES])
    radiance = latlong_from_cube(faces)
    cosine = latlong.directions(*radiance.shape[:2]) @ LAMP_DIRECTION.astype(np.float32)
    lamp = cosine > np.cos(np.radians(LAMP_RADIUS_DEG))
    return Environment(np.where(lamp[..., None], np.array(LAMP_RADIANCE, np.float32), radiance))


def _face(name: str, size: int) -> Float[np.ndarray, "size size 3"]:
    text, colour = LABELS[name]
    ink = Image.new("L", (size, size), 0)
    draw = ImageDraw.Draw(ink)
    font = ImageFont.load_default(size / max(5.0, 0.9 * len(text) + 0.5))
    draw.text((size / 2, size * 0.72), f"{text}\n{name.upper()}", 255, font, "mm", align="center")
    draw.polygon([(size * x, size * y) for x, y in ((0.5, 0.08), (0.58, 0.2), (0.42, 0.2))], 255)
    amount = np.asarray(ink, np.float32)[..., None] / 255
    face = np.array(colour, np.float32) * (1 - amount) + _INK * amount
    edge = max(1, size // 64)
    face[:edge], face[-edge:], face[:, :edge], face[:, -edge:] = 1, 1, 1, 1
    return np.asarray(face, np.float32)
