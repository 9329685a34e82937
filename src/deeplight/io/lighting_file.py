"""Lighting on disk: an environment to light with, and a JSON file that says what it means."""

import base64
import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Float32

from deeplight.errors import ImageFileError, InputError
from deeplight.harmonics import (
    CONDON_SHORTLEY,
    DominantLight,
    dominant_light,
    spherical_harmonics,
)
from deeplight.io.atomic import replacing
from deeplight.io.json_text import read_json
from deeplight.io.radiance import write_exr, write_hdr
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.mappings.resample import shrink_latlong

FORMAT = "deeplight lighting"
FORMAT_VERSION = 1
LATLONG_HEIGHT = 256
SEEN_HEIGHT = 64
_WRITE_AGAIN = "write it again with this version of deeplight"
FRAME = "camera: +X right, +Y up, +Z towards the camera; the camera looks along -Z"
UNIT = "linear radiance; 1.0 is the camera's white, where a pixel of the photo just saturates"
COLOUR_SPACE = "linear, primaries of Rec. 709 and sRGB, white D65 (lin_rec709)"
MAX_SIZE = 2048  # pixels across the ball
VIEW_U = "deeplight:viewU"
"""Header entry of an EXR: the column of the view direction, 0 (left) to 1 (right)."""


@dataclass(frozen=True)
class Turn:
    """How far an environment is turned from ours, whose centre column is the view.

    Attributes:
        made_for: the tool it is turned for; None is ours.
        view_u: column of the view direction, 0 (left) to 1 (right), a multiple of 1/4.
        axes: our axes in the tool's, in words.
    """

    made_for: str | None = None
    view_u: float = 0.5
    axes: str = "our own"

    def of(
        self, latlong: Float32[np.ndarray, "height width channels"]
    ) -> Float32[np.ndarray, "height width channels"]:
        """Turn our environment (centre = the view) this way.

        Raises:
            InputError: the width is no multiple of 4.
        """
        width = latlong.shape[1]
        columns = (self.view_u - 0.5) * width
        if columns != round(columns):
            got = f"{width} pixels"
            raise InputError("a width of whole quarter turns", got, "use a multiple of 4")
        return np.roll(latlong, round(columns), axis=1)


def save_lighting(
    lighting: Lighting,
    stem: Path | str,
    *,
    turn: Turn | None = None,
    hdr: bool = False,
    facts: Mapping[str, Any] | None = None,
    latlong: Float[np.ndarray, "height width 3"] | None = None,
    seen: Float[np.ndarray, "height width"] | None = None,
    main_light: DominantLight | None = None,
) -> list[Path]:
    """Write `<stem>.exr` and `<stem>.json`, each whole or not at all.

    Args:
        lighting: in the camera frame.
        stem: path without suffix; a dot in it stays.
        turn: how to turn the environment; left out, the centre column is the view (-Z), right of
            it is +X. The JSON's numbers stay in the camera frame in any case.
        hdr: also write `<stem>.hdr` (Radiance RGBE).
        facts: further entries for the JSON, such as the model's hash.
        latlong: the environment to write, of which `lighting` is the mirror ball; left out, that
            ball enlarged to 256 rows.
        seen: how much of each texel a photo shows, 0 to 1, for a channel `seen` of the EXR.
        main_light: of the environment; left out, the ball's dominant light.

    Returns:
        The files written.

    Raises:
        OSError: a file cannot be written.
    """
    turn = turn or Turn()
    folder, name = Path(stem).parent, Path(stem).name
    if latlong is None:
        latlong = lighting.latlong(LATLONG_HEIGHT)
    turned = turn.of(latlong)
    files = [folder / f"{name}.exr"]
    header: dict[str, str | int | float] = {
        "deeplight:unit": UNIT,
        "deeplight:frame": FRAME,
        VIEW_U: turn.view_u,
    }
    channels = {} if seen is None else {"seen": turn.of(seen[..., None])[..., 0]}
    write_exr(files[0], turned, header, channels)
    if hdr:
        files.append(folder / f"{name}.hdr")
        write_hdr(files[1], turned)
    light = main_light or dominant_light(lighting)
    record = _record(lighting, light, turn, [file.name for file in files], len(turned))
    record |= facts or {}
    files.append(folder / f"{name}.json")
    with replacing(files[-1]) as temporary:
        temporary.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return files


def read_lighting_json(path: Path) -> Lighting:
    """Read the mirror ball of the `.json` that `save_lighting` wrote; exact.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ImageFileError: not a lighting file, of another version, or damaged.
    """
    with _damage_named(path):
        ball = read_record(path)["mirror_ball"]
        size = int(ball["size"])
        if not 0 < size <= MAX_SIZE:
            raise ValueError(f"a mirror ball of {size} pixels")
        values = np.frombuffer(base64.b64decode(ball["radiance"]), "<f4")
        return Lighting(values.reshape(size, size, 3))


def read_record(path: Path) -> dict[str, Any]:
    """Read the whole `.json` that `save_lighting` wrote.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ImageFileError: not a lighting file, of another version, or damaged.
    """
    with _damage_named(path):
        record: dict[str, Any] = read_json(path)
        kind = (record["format"], record["format_version"])
        if kind != (FORMAT, FORMAT_VERSION):
            expected = f"a {FORMAT} file of version {FORMAT_VERSION}"
            raise ImageFileError(expected, f"{kind}", _WRITE_AGAIN)
        return record


def lamps_record(lamps: Sequence[Lamp], in_environment: bool) -> dict[str, Any]:
    """Give the JSON entry of lamps; `in_environment`: whether the environment files hold them."""
    return {
        "in_environment": in_environment,
        "meaning": "even discs far away; direction: unit vector towards the lamp; flux: RGB "
        "radiance integrated over the disc; irradiance: on a surface that faces it, both in the "
        "radiance unit times sr; when they are used as lights, the environment must hold the rest "
        "only (in_environment false)",
        "lamps": [
            {
                "direction": lamp.direction.tolist(),
                "flux": lamp.flux.tolist(),
                "irradiance": lamp.irradiance.tolist(),
                "angular_radius_rad": lamp.angular_radius_rad,
            }
            for lamp in lamps
        ],
    }


def seen_record(seen: Float[np.ndarray, "height width"]) -> dict[str, Any]:
    """Give the JSON entry of what a photo shows, at 64 rows or fewer, 8 bits."""
    height = min(SEEN_HEIGHT, len(seen))
    small = shrink_latlong(seen[..., None], height)[..., 0]
    levels = np.floor(small.clip(0, 1) * 255 + 0.5).astype(np.uint8)
    return {
        "height": height,
        "width": 2 * height,
        "encoding": "base64 of zlib of 8 bits, rows from the top, 255 = the photo shows it; "
        "centre column = the view, whatever the environment files are turned for",
        "levels": base64.b64encode(zlib.compress(levels.tobytes(), 9)).decode(),
    }


def lamps_of_record(record: Mapping[str, Any]) -> tuple[tuple[Lamp, ...] | None, bool]:
    """The lamps of a lighting file, None where it lists none, and whether its environment files
    hold them too."""
    entry = record.get("lamps")
    if entry is None:
        return None, True
    lamps = [
        Lamp(np.array(lamp["direction"]), np.array(lamp["flux"]), lamp["angular_radius_rad"])
        for lamp in entry["lamps"]
    ]
    return tuple(lamps), bool(entry["in_environment"])


def seen_of_record(record: Mapping[str, Any]) -> Float32[np.ndarray, "height width"] | None:
    """What the photo shows, 0 to 1, as stored in a lighting file; None where it does not say."""
    entry = record.get("seen")
    if entry is None:
        return None
    shape = int(entry["height"]), int(entry["width"])
    if not 0 < min(shape) <= max(shape) <= MAX_SIZE:
        raise ValueError(f"a map of {shape}")
    unpack = zlib.decompressobj()
    content = unpack.decompress(base64.b64decode(entry["levels"]), shape[0] * shape[1])
    levels = np.frombuffer(content, np.uint8)
    return levels.reshape(shape).astype(np.float32) / np.float32(255)


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    try:
        yield
    except (ValueError, KeyError, TypeError, OverflowError, AttributeError) as error:
        got = f"{path}, which is none ({type(error).__name__}: {error})"
        raise ImageFileError(f"a {FORMAT} file", got, _WRITE_AGAIN) from error


def _record(
    lighting: Lighting, light: DominantLight, turn: Turn, environments: list[str], height: int
) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "frame": FRAME,
        "unit": UNIT,
        "colour_space": COLOUR_SPACE,
        "environment": {
            "files": environments,
            "mapping": "equirectangular, top row up (+Y), seen from inside",
            "height": height,
            "width": 2 * height,
            "made_for": turn.made_for,
            "view_u": turn.view_u,
            "axes": turn.axes,
        },
        "dominant_light": _dominant(light),
        "spherical_harmonics": _harmonics(lighting),
        "mirror_ball": {
            "size": lighting.size,
            "encoding": "base64 of float32, little-endian, rows from the top, RGB",
            "radiance": base64.b64encode(lighting.radiance.astype("<f4").tobytes()).decode(),
        },
    }


def _dominant(light: DominantLight) -> dict[str, Any]:
    return {
        "primary_light_direction": light.direction.tolist(),
        "primary_light_intensity": light.irradiance.tolist(),
        "meaning": "direction: unit vector towards the light; intensity: RGB irradiance on a "
        "surface that faces it, radiance unit times sr",
        "share_of_power": light.share,
    }


def _harmonics(lighting: Lighting) -> dict[str, Any]:
    coefficients = spherical_harmonics(lighting)
    return {
        "quantity": "radiance of the whole environment, dominant light included",
        "order": "00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22, each RGB",
        "basis": "orthonormal real harmonics in x, y, z of the frame above",
        "spherical_harmonics_coefficients": coefficients.tolist(),
        "sign": "all positive (three.js, Ramamoorthi and Hanrahan 2001)",
        "spherical_harmonics_coefficients_condon_shortley": (
            coefficients * CONDON_SHORTLEY[:, None]
        ).tolist(),
        "sign_condon_shortley": "1, 3, 5 and 7 negated (ARCore, WebXR in Chromium)",
    }
