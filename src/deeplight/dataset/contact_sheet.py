"""A contact sheet: backgrounds with their three spheres beneath, to look at what was made."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from deeplight.dataset.example import Example
from deeplight.dataset.reading import DataSet, SplitIndex
from deeplight.io.photos import write_png
from deeplight.sphere import SPHERES

Picture = UInt8[np.ndarray, "_ _ 3"]  # any height and width

LABEL_HEIGHT = 13
GAP = 6
PAPER = 24  # grey of the sheet


def write_contact_sheet(
    data: DataSet, path: Path, split: str | None = None, count: int = 48
) -> Path:
    """Write a PNG of about `count` examples, spread over the places; give its path.

    Args:
        split: a split or a group; left out, every split gets its share.

    Raises:
        DataSetError: there is no such split, or an example cannot be read.
        OSError: the file cannot be written.
    """
    splits = [name for name in data.splits if data.manifest.examples(name)]
    indices = [data.index(name) for name in (splits if split is None else [split])]
    share = -(-count // max(len(indices), 1))
    examples = [index[n] for index in indices for n in spread_over_places(index, share)]
    write_png(path, contact_sheet(examples))
    return path


def spread_over_places(index: SplitIndex, count: int) -> list[int]:
    """Choose `count` examples: every place in turn, and within a place evenly over its takes.

    The same index always gives the same choice, in the order of the index.
    """
    places = [np.flatnonzero(index.places == place) for place in np.unique(index.places)]
    count = min(count, len(index))
    if count < len(places):
        chosen = np.linspace(0, len(places) - 1, count).round().astype(int)
        return sorted(int(places[n][len(places[n]) // 2]) for n in chosen)
    shares = np.zeros(len(places), int)
    sizes = np.array([len(numbers) for numbers in places])
    while shares.sum() < count:  # one more of every place that has more, until it is enough
        open_places = np.flatnonzero(shares < sizes)[: count - shares.sum()]
        shares[open_places] += 1
    return sorted(
        int(numbers[at])
        for numbers, share in zip(places, shares, strict=True)
        for at in ((np.arange(share) + 0.5) * len(numbers) / share).astype(int)
    )


def contact_sheet(examples: Sequence[Example], columns: int = 8) -> Picture:
    """Lay out examples in rows: background, its spheres, the name of the place."""
    return grid([_tile(example) for example in examples], columns)


def _tile(example: Example) -> Picture:
    width = example.background.shape[1]
    spheres = row([enlarged(example.spheres[name], width // 3) for name in SPHERES])
    return column(
        [example.background, spheres, label(f"{example.meta.split}: {example.meta.place}", width)]
    )


def enlarged(picture: Picture, size: int) -> Picture:
    """Bring a square picture to size x size, smoothly."""
    return np.asarray(Image.fromarray(picture).resize((size, size), Image.Resampling.BICUBIC))


def label(text: str, width: int) -> Picture:
    """Give a line of small text, cut to `width` pixels."""
    strip = Image.new("RGB", (width, LABEL_HEIGHT), (PAPER,) * 3)
    ImageDraw.Draw(strip).text((1, 0), text, fill=(220, 220, 220))
    return np.asarray(strip)


def row(pictures: Sequence[Picture], gap: int = 0) -> Picture:
    """Put pictures side by side, aligned at the top."""
    turned = [picture.transpose(1, 0, 2) for picture in pictures]
    return np.ascontiguousarray(column(turned, gap).transpose(1, 0, 2))


def column(pictures: Sequence[Picture], gap: int = 0) -> Picture:
    """Put pictures below each other, aligned at the left."""
    height = sum(len(picture) for picture in pictures) + gap * (len(pictures) - 1)
    sheet = np.full((height, max(picture.shape[1] for picture in pictures), 3), PAPER, np.uint8)
    top = 0
    for picture in pictures:
        sheet[top : top + len(picture), : picture.shape[1]] = picture
        top += len(picture) + gap
    return sheet


def grid(pictures: Sequence[Picture], columns: int) -> Picture:
    """Put pictures in rows of `columns`."""
    starts = range(0, len(pictures), columns)
    return column([row(pictures[start : start + columns], GAP) for start in starts], GAP)
