"""One picture to look at: the photo, the light found in it, and spheres in that light."""

from collections.abc import Sequence
from math import degrees

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image, ImageDraw, ImageFont

from deeplight.brdf import REFLECTIVITY
from deeplight.camera_response import CameraResponse
from deeplight.environment import Environment
from deeplight.estimators.network import Estimate
from deeplight.frames import Rotation, turned
from deeplight.io.photos import Photo
from deeplight.io.tilt import Tilt
from deeplight.lamp import Lamp
from deeplight.mappings import mirror_ball
from deeplight.mappings.latlong import directions, position
from deeplight.mappings.resample import sample_latlong, shrink_latlong
from deeplight.preprocess import Framing, hull, looks
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG

WIDTH, HEIGHT, MARGIN = 1280, 736, 32
PHOTO_BOX = (448, 500)  # width, height
LIGHT_SIZE = (736, 368)  # of the environment
DIM_SIZE = (296, 148)  # of the same, darker
SPHERE = 132  # pixels across
DARK_STOPS = -4.0
"""Exposure of the second environment: what is still bright there is a light source."""

LABEL_GAP = 14
"""Pixels between the words of a lamp's label and what is above or below them."""
LINE, COLUMNS = 24, (92, 200)
"""Of what is said of how sure the estimate is: pixels from line to line, and to the columns."""
KNOWN = ("roughly known",)
TITLE, CAPTION = "its light from all directions", 14
Box = tuple[float, float, float, float]  # left, upper, right, lower

PAPER, INK, FAINT, ACCENT = (20, 22, 26), (236, 238, 242), (146, 152, 162), (255, 196, 61)
NAMES = {"matte_silver": "matte silver", "diffuse": "diffuse"}


def preview(
    estimate: Estimate,
    environment: Environment,
    title: str,
    confidence: Sequence[str] = (),
    direction_known: bool = True,
    tilt: Tilt | None = None,
    elsewhere: str = "",
) -> UInt8[np.ndarray, "736 1280 3"]:
    """Draw the preview of one estimate.

    Args:
        estimate: what to show.
        environment: its light, whose lamps are marked.
        title: usually the photo's file name.
        confidence: how sure the estimate is, a line each.
        direction_known: whether the main light's place can be relied on.
        tilt: the camera's, to show the panorama level: in the camera's frame a horizon is a wave.
        elsewhere: what the environment is where the photo does not look.
    """
    canvas = Image.new("RGB", (WIDTH, HEIGHT), PAPER)
    draw = ImageDraw.Draw(canvas)
    left = 2 * MARGIN + PHOTO_BOX[0]
    draw.text((MARGIN, 24), _shortened(title, 40), INK, _font(22))
    below_photo = _draw_photo(canvas, estimate.photo, estimate.framing)
    _say_how_sure(draw, confidence[:4], below_photo)
    draw.text((left, 24), TITLE, INK, _font(22))
    draw.text((WIDTH - MARGIN, 30), _how_shown(tilt), FAINT, _font(CAPTION), anchor="ra")
    turn = tilt.level_from_camera if tilt else np.eye(3)
    shown = _turned(environment.radiance, turn) if tilt else environment.radiance
    canvas.paste(_tone_mapped(shown, 0.0, LIGHT_SIZE), (left, 64))
    if elsewhere:
        around = f"where the photo does not look: {elsewhere}"
        draw.text((left, 64 + LIGHT_SIZE[1] + 10), around, FAINT, _font(CAPTION))
    lamps = [lamp.turned(turn) for lamp in environment.lamps]
    mark_lamps(draw, lamps, (left, 64, *LIGHT_SIZE), direction_known)
    below = 64 + LIGHT_SIZE[1] + 40
    canvas.paste(_tone_mapped(shown, DARK_STOPS, DIM_SIZE), (left, below))
    draw.text((left, below + DIM_SIZE[1] + 8), f"{-DARK_STOPS:.0f} stops darker", FAINT, _font(16))
    draw_spheres(canvas, environment, left + DIM_SIZE[0], below)
    return np.asarray(canvas)


def _how_shown(tilt: Tilt | None) -> str:
    """The panorama's caption."""
    if tilt is None:
        return "centre = the view"
    where = "up" if tilt.pitch_rad > 0 else "down"
    pitch = f"{abs(degrees(tilt.pitch_rad)):.0f}"
    if tilt.scale_rad:
        pitch += f" ± {degrees(tilt.scale_rad):.0f}"
    return f"level; camera {pitch}° {where} ({tilt.source})"


def _turned(radiance: Float[np.ndarray, "h w 3"], turn: Rotation) -> Float[np.ndarray, "h2 w2 3"]:
    """A panorama turned, at about the size that is shown."""
    width, height = LIGHT_SIZE
    if len(radiance) > 2 * height:
        radiance = shrink_latlong(radiance, height)
    return sample_latlong(radiance, turned(directions(height, width), turn.T))


def _say_how_sure(draw: ImageDraw.ImageDraw, lines: Sequence[str], top: int) -> None:
    """What is known of the light, in columns: "direction: roughly known (two of three ...)"."""
    for number, line in enumerate(lines):
        y = top + LINE * number
        name, colon, rest = line.partition(": ")
        word, bracket, explained = rest.partition(" (")
        if not (colon and bracket):
            draw.text((MARGIN, y), _shortened(line, 68), INK, _font(15))
            continue
        draw.text((MARGIN, y), name, FAINT, _font(15))
        draw.text((MARGIN + COLUMNS[0], y), word, INK if word in KNOWN else ACCENT, _font(15))
        draw.text((MARGIN + COLUMNS[1], y), explained.rstrip(")"), FAINT, _font(15))


def _draw_photo(canvas: Image.Image, photo: Photo, framing: Framing) -> int:
    """Draw the photo with what the network saw outlined and the rest dimmed; where it ends."""
    height, width, _ = photo.pixels.shape
    scale = min(PHOTO_BOX[0] / width, PHOTO_BOX[1] / height)
    step = max(1, int(0.5 / scale))  # a dozen megapixels need not all be copied
    small = Image.fromarray(np.ascontiguousarray(photo.pixels[::step, ::step]))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = small.resize(size, Image.Resampling.LANCZOS)
    shown = hull(looks(framing))
    box = [edge * scale for edge in (shown.left, shown.top, shown.right, shown.bottom)]
    box = [min(max(value, 0), limit) for value, limit in zip(box, size * 2, strict=True)]
    dimmed = Image.blend(small, Image.new("RGB", size, PAPER), 0.55)
    x0, y0, x1, y1 = (round(value) for value in box)
    dimmed.paste(small.crop((x0, y0, x1, y1)), (x0, y0))
    left = MARGIN
    canvas.paste(dimmed, (left, 64))
    draw = ImageDraw.Draw(canvas)
    # Of a very narrow photo, or at a huge field of view, less than a pixel may be left.
    corner = (left + max(x1 - 1, x0), 64 + max(y1 - 1, y0))
    draw.rectangle((left + x0, 64 + y0, *corner), outline=ACCENT, width=2)
    caption = "outlined: what the network saw"
    if framing.visible_fraction < 1:
        caption += f" ({framing.visible_fraction:.0%} of its view)"
    draw.text((MARGIN, 64 + size[1] + 12), caption, FAINT, _font(16))
    return 64 + size[1] + 12 + 2 * LINE


def draw_spheres(canvas: Image.Image, environment: Environment, left: int, top: int) -> None:
    """A mirror ball as sharp as the environment, and the two that scatter, from `left` on.

    They stand in a row that ends at the margin of a canvas `WIDTH` pixels wide.
    """
    draw = ImageDraw.Draw(canvas)
    spheres = relight_rig(PAPER_RIG, environment.lighting)
    pictures = {"mirror": _mirror(environment)}
    pictures |= {name: _disc(spheres[key]) for key, name in NAMES.items()}
    room = (WIDTH - MARGIN - left - len(pictures) * SPHERE) / len(pictures)
    for index, (name, picture) in enumerate(pictures.items()):
        x = round(left + room + index * (SPHERE + room))
        canvas.paste(picture, (x, top), _disc_mask())
        draw.text((x + SPHERE // 2, top + SPHERE + 8), name, FAINT, _font(16), anchor="ma")


def _mirror(environment: Environment) -> Image.Image:
    """The environment in a mirror ball before the camera: behind the camera in its middle."""
    u, v = mirror_ball.grid(SPHERE, 3)
    seen = sample_latlong(environment.radiance, mirror_ball.directions_from_uv(u, v))
    radiance = seen.reshape(SPHERE, 3, SPHERE, 3, 3).mean((1, 3)) * REFLECTIVITY["mirror"]
    return _tone_mapped(radiance, 0.0, (SPHERE, SPHERE))


def _disc(sphere: Float[np.ndarray, "size size 3"]) -> Image.Image:
    """Enlarge a rendered sphere; its surface goes on past the rim, where the mask cuts it."""
    on_sphere = PAPER_RIG.views["mirror"].alpha()[..., None] > 0
    whole = sphere
    for _ in range(2):
        whole = np.where(on_sphere, whole, _neighbours_mean(whole))
    return _tone_mapped(whole, 0.0, (SPHERE, SPHERE))


def _neighbours_mean(values: Float[np.ndarray, "size size 3"]) -> Float[np.ndarray, "size size 3"]:
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    shifted = [padded[1 + i : -1 + i or None, 1 + j : -1 + j or None] for i, j in _AROUND]
    known = sum((part.sum(-1, keepdims=True) > 0).astype(np.float32) for part in shifted)
    return np.asarray(sum(shifted) / np.maximum(known, 1), np.float32)


_AROUND = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))


def _disc_mask() -> Image.Image:
    large = Image.new("L", (4 * SPHERE, 4 * SPHERE))
    ImageDraw.Draw(large).ellipse((2, 2, 4 * SPHERE - 3, 4 * SPHERE - 3), fill=255)
    return large.resize((SPHERE, SPHERE), Image.Resampling.BOX)


def _tone_mapped(
    radiance: Float[np.ndarray, "h w 3"], stops: float, size: tuple[int, int]
) -> Image.Image:
    """Expose by `stops`, soft-clip and gamma-encode as the paper's camera does, then resize."""
    pixel = CameraResponse(exposure_stops=stops).pixel_from_radiance(radiance)
    levels = np.floor(np.clip(pixel, 0, 1) * 255 + 0.5).astype(np.uint8)
    return Image.fromarray(levels).resize(size, Image.Resampling.BICUBIC)


def mark_lamps(
    draw: ImageDraw.ImageDraw,
    lamps: Sequence[Lamp],
    where: tuple[int, int, int, int],
    known: bool = True,
) -> None:
    """Ring each lamp, in a direction of the panorama, and say how bright it is.

    Args:
        draw: what the panorama is on.
        lamps: in the panorama's frame, the main light first.
        where: left, top, width and height of the panorama.
        known: whether the main light's direction is.
    """
    at, (width, height) = where[:2], where[2:]
    rings: list[Box] = []
    for lamp in lamps:
        (row,), (column,) = position(lamp.direction[None], height, width)
        x, y = at[0] + float(column), at[1] + float(row)
        size = max(10.0, lamp.angular_radius_rad / np.pi * height + 6)
        rings.append((x - size, y - size, x + size, y + size))
        draw.ellipse((x - size - 1, y - size - 1, x + size + 1, y + size + 1), None, PAPER, 4)
        draw.ellipse(rings[-1], outline=ACCENT, width=2)
    taken = list(rings)  # no label covers a ring or another label
    for number, (lamp, (x0, y0, x1, y1)) in enumerate(zip(lamps, rings, strict=True)):
        label = f"{'main light' if number == 0 else 'light'}, {lamp.radiance.max():.0f} x white"
        if not known and number == 0:
            label += ", direction not known"
        to_left = x0 + x1 > 2 * at[0] + width
        across, anchor = (x0 - 14, "rm") if to_left else (x1 + 14, "lm")
        box = draw.textbbox((across, (y0 + y1) / 2), label, _font(16), anchor)
        taken.append(_free(box, taken, at[1], at[1] + height))
        left, upper, right, lower = taken[-1]
        around = (left - 6, upper - 4, right + 6, lower + 4)
        draw.rounded_rectangle(around, 5, fill=PAPER)  # a white sky would swallow bare letters
        draw.text((across, (upper + lower) / 2), label, INK, _font(16), anchor=anchor)


def _free(box: Box, taken: Sequence[Box], top: float, bottom: float) -> Box:
    """The box, moved up or down by the least that takes it off the others and into the picture."""
    left, upper, right, lower = box
    height = lower - upper + LABEL_GAP
    steps = sorted(range(-4 * len(taken), 4 * len(taken) + 1), key=abs)
    for step in steps:
        moved = (left, upper + step * height / 2, right, lower + step * height / 2)
        inside = moved[1] >= top and moved[3] <= bottom
        if inside and not any(_overlap(moved, other) for other in taken):
            return moved
    return box


def _overlap(one: Box, other: Box) -> bool:
    apart = one[2] < other[0] or other[2] < one[0]
    gap = LABEL_GAP - 1  # against rounding
    return not (apart or one[3] + gap < other[1] or other[3] + gap < one[1])


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def _shortened(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[: length // 2]}…{text[-length // 2 + 1 :]}"
