"""An example as the members of a WebDataset tar: `<key>.background.jpg`, `<key>.json`, ..."""

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from deeplight.dataset.example import Example, ExampleMeta
from deeplight.errors import DataSetError
from deeplight.io.arrays_file import array_of
from deeplight.io.json_text import parse_json
from deeplight.io.photos import decode_rgb, encode_jpeg, encode_png
from deeplight.sphere import SPHERES

BACKGROUND = "background.jpg"
METADATA = "json"
LIGHTING = "lighting.npy"
SUFFIXES = (BACKGROUND, *(f"{name}.png" for name in SPHERES), METADATA, LIGHTING)

JPEG_QUALITY = 95  # of a background that comes without its camera's JPEG


def to_members(example: Example, jpeg_quality: int = JPEG_QUALITY) -> dict[str, bytes]:
    """Encode `example` as the bytes of each member, by suffix, in the order of `SUFFIXES`."""
    jpeg = example.background_jpeg or encode_jpeg(example.background, jpeg_quality)
    members = {BACKGROUND: jpeg}
    for name in SPHERES:
        members[f"{name}.png"] = encode_png(example.spheres[name])
    metadata = {**example.meta.to_dict(), "true_lighting": example.true_lighting is not None}
    members[METADATA] = json.dumps(metadata, sort_keys=True, allow_nan=False).encode()
    if example.true_lighting is not None:
        buffer = io.BytesIO()
        np.save(buffer, example.true_lighting, allow_pickle=False)
        members[LIGHTING] = buffer.getvalue()
    return members


def from_members(key: str, members: Mapping[str, bytes]) -> Example:
    """Decode what `to_members` gave.

    Raises:
        DataSetError: a member is missing or cannot be read.
    """
    suffix = METADATA
    try:
        metadata = parse_json(members[suffix])
        has_lighting = metadata.pop("true_lighting")
        meta = ExampleMeta.from_dict(metadata)
        suffix = BACKGROUND
        background = decode_rgb(members[suffix])
        spheres = {}
        for name in SPHERES:
            suffix = f"{name}.png"
            spheres[name] = decode_rgb(members[suffix])
        lighting = None
        if has_lighting:
            suffix = LIGHTING
            lighting = array_of(members[suffix])
        return Example(key, background, spheres, meta, lighting, members[BACKGROUND])
    except Exception as error:  # decoders raise errors of every kind
        raise unreadable(f"{key}.{suffix}", error) from error


def decode_details(key: str, members: Mapping[str, bytes]) -> Mapping[str, Any]:
    """Decode only `ExampleMeta.details`, no picture.

    Raises:
        DataSetError: the metadata are missing or cannot be read.
    """
    try:
        details: Mapping[str, Any] = parse_json(members[METADATA]).get("details", {})
        return details
    except Exception as error:
        raise unreadable(f"{key}.{METADATA}", error) from error


def decode_pixels(key: str, members: Mapping[str, bytes]) -> tuple[np.ndarray, np.ndarray]:
    """Decode only the pictures: background (H, W, 3) and spheres (3, 32, 32, 3), uint8.

    What training reads for every step; the spheres are in the order of `SPHERES`.

    Raises:
        DataSetError: a picture is missing or cannot be read.
    """
    suffix = BACKGROUND
    pictures = []
    try:
        for suffix in (BACKGROUND, *(f"{name}.png" for name in SPHERES)):
            pictures.append(decode_rgb(members[suffix]))
        return pictures[0], np.stack(pictures[1:])
    except Exception as error:
        raise unreadable(f"{key}.{suffix}", error) from error


def unreadable(what: str, error: Exception) -> DataSetError:
    """Give the error for a part of a shard that cannot be read."""
    return DataSetError(
        f"a readable {what}",
        str(error) or type(error).__name__,
        "delete that shard and its .json, then run `deeplight simulate` again: it makes only what "
        "is missing",
    )
