"""Which channels of an EXR are its light, where it has several layers or parts."""

import re
from pathlib import Path
from typing import NamedTuple

import OpenImageIO as oiio

from deeplight.errors import ImageFileError

MAX_PARTS = 256
PREFERRED = ("combined", "rgba", "beauty", "rgb")
"""Last words of the names that renderers give to the picture as a whole, the surest first."""

_COLOURS = {"r": 0, "red": 0, "g": 1, "green": 1, "b": 2, "blue": 2}
_NO_LIGHT = ("a", "alpha", "depth", "id", "mask", "mist", "z")  # channels that stand alone
_MOST_NAMED = 12  # layers named in an error


class Layer(NamedTuple):
    """Three colour channels of one part of a file.

    Attributes:
        part: its number.
        part_name: empty where the file has one part.
        name: what stands before the last dot of its channels; empty for plain R, G, B.
        channels: places of red, green and blue.
    """

    part: int
    part_name: str
    name: str
    channels: tuple[int, int, int]

    @property
    def label(self) -> str:
        """How a person finds it."""
        return ".".join(word for word in (self.part_name, self.name) if word) or "R, G, B"

    @property
    def last_word(self) -> str:
        return re.split(r"[./\s]", (self.name or self.part_name).lower())[-1]


def choose_layer(file: oiio.ImageInput, path: Path, wanted: str | None = None) -> Layer:
    """Find the light in an opened file, and leave the file at its part.

    One layer is it; plain R, G, B before named ones; the one whose name ends in one of `PREFERRED`.
    A file without colour gives its one grey channel three times.

    Args:
        wanted: label of the layer to take instead; capital letters do not matter.

    Raises:
        ImageFileError: several could be the light, none is the wanted one, deep pixels, or no
            colour.
    """
    layers: list[Layer] = []
    greys: list[Layer] = []
    names: list[str] = []
    has_parts = file.format_name() == "openexr"  # further pages of a TIFF are thumbnails and such
    for part in range(MAX_PARTS if has_parts else 1):
        if not file.seek_subimage(part, 0):
            file.geterror()  # or OpenImageIO prints it when the process ends
            break
        spec = file.spec()
        if spec.deep:
            got = f"{path}, a deep EXR: many values for each pixel"
            raise ImageFileError("an image with one value for each pixel", got, "flatten it")
        found = tuple(spec.channelnames)
        names += found
        part_name = spec.get_string_attribute("oiio:subimagename") if has_parts else ""
        layers += _layers(part, part_name, found)
        greys += _grey(part, part_name, found)
    if len({layer.part for layer in layers}) < 2:  # a lone part's name says nothing
        layers = [layer._replace(part_name="") for layer in layers]
    if wanted is None:
        chosen = _chosen(layers, path) or next(iter(greys), None)
    else:
        chosen = _named(wanted, layers + greys, path)
    if chosen is None:
        got = f"{path} with channels {', '.join(names[:8])}"
        raise ImageFileError("channels R, G, B or one grey channel", got, "export it as RGB")
    file.seek_subimage(chosen.part, 0)
    return chosen


def _layers(part: int, part_name: str, names: tuple[str, ...]) -> list[Layer]:
    """The layers of a part that have all three colours, in their order."""
    places: dict[str, dict[int, int]] = {}
    for index, name in enumerate(names):
        layer, _, word = name.rpartition(".")
        colour = _COLOURS.get(word.lower())
        if colour is not None:
            places.setdefault(layer, {}).setdefault(colour, index)
    return [
        Layer(part, part_name, layer, (at[0], at[1], at[2]))
        for layer, at in places.items()
        if len(at) == 3 and "crypto" not in layer.lower()  # Cryptomatte's numbers of objects
    ]


def _grey(part: int, part_name: str, names: tuple[str, ...]) -> list[Layer]:
    is_no_grey = bool({"RY", "BY", "X", "Z"} & set(names))  # chroma, or CIE XYZ, or places
    return [
        Layer(part, part_name, "", (index,) * 3)
        for index, name in enumerate(names)
        if (name == "Y" and not is_no_grey)
        or (len(names) == 1 and name.lower().rpartition(".")[2] not in _NO_LIGHT)
    ]


def _named(wanted: str, layers: list[Layer], path: Path) -> Layer:
    found = [layer for layer in layers if layer.label.lower() == wanted.lower()]
    if len(found) != 1:
        got = f"{path} with {_listed(layers)}"
        raise ImageFileError(f"a layer {wanted!r}", got, "name one of these")
    return found[0]


def _listed(layers: list[Layer]) -> str:
    labels = [layer.label for layer in layers]
    return ", ".join(labels[:_MOST_NAMED]) + (", ..." if len(labels) > _MOST_NAMED else "")


def _chosen(layers: list[Layer], path: Path) -> Layer | None:
    if len(layers) < 2:
        return next(iter(layers), None)
    plain = [layer for layer in layers if not layer.name]
    if len(plain) == 1 and not plain[0].part_name:
        return plain[0]
    wanted = [[layer for layer in layers if layer.last_word == word] for word in PREFERRED]
    for candidates in (*wanted, plain):
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            break
    do = "take one with `deeplight convert IN.exr --layer NAME --out light.exr`, or save it alone"
    expected = "one layer that is the light (Combined, rgba or beauty)"
    raise ImageFileError(expected, f"{path} with several: {_listed(layers)}", do)
