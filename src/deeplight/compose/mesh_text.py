"""The text of .obj, .mtl and .ply files, brought to what trimesh reads of it."""

import re
from collections.abc import Callable

from deeplight.compose.ply import of_triangles
from deeplight.compose.polygons import cut_obj

_CONTINUED = re.compile(rb"\\ *\n")
_INDENT = re.compile(rb"^ +", re.MULTILINE)
_COMMENT = re.compile(rb"#[^\n]*")
_COMMENTED = (b"v ", b"vt", b"vn", b"f ")  # other lines hold names, of which # may be a part
_A_ZERO = re.compile(rb" 0[/ \n]")  # much quicker to look for
_VERTEX_0 = re.compile(rb"^f +(?:\S+ +)*0(?=[/ \n]|\Z)[^\n]*", re.MULTILINE)
_LIBRARY = re.compile(rb"mtllib[ \t]+(.*?)[ \t\r]*$", re.MULTILINE)  # "^" first is slow
_ONE_NAME = re.compile(rb"\S.*?\.mtl(?=\s|$)", re.IGNORECASE)
_MAP = re.compile(rb"^([ \t]*map_kd)[ \t]+(.*?)[ \t\r]*$", re.IGNORECASE | re.MULTILINE)
_NUMBER = rb"[ \t]+[-+]?[\d.]+(?:e[-+]?\d+)?"
_OPTION = re.compile(
    rb"-(?:(?P<placed>[ost](?:"
    + _NUMBER
    + rb"){1,3})|mm"
    + _NUMBER
    + _NUMBER
    + rb"|[a-z]+[ \t]+\S+)"
    rb"[ \t]+",
    re.IGNORECASE,
)
_GREY = re.compile(rb"^([ \t]*K[ads])[ \t]+([\d.]+)[ \t\r]*$", re.MULTILINE)
_COLOUR = re.compile(
    rb"^(property[ \t]+\w+[ \t]+)(?:diffuse_)?(r|g|b)(?:ed|reen|lue)?(?=\s*$)", re.MULTILINE
)
_NAMES = {b"r": b"red", b"g": b"green", b"b": b"blue"}

LIBRARY = "deeplight-materials.mtl"
"""What `plain_obj` has an .obj name instead of its own material files."""
PLACED = "the place and scale of a texture were left out"


def unicode(text: bytes) -> bytes:
    """Give text of unknown encoding as UTF-8: what is not UTF-8 is taken for Latin-1."""
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return text.decode("utf-16", "replace").encode()
    try:
        return text.decode("utf-8-sig").encode()
    except UnicodeDecodeError:
        return text.decode("latin-1").encode()


def plain_ply(content: bytes, cut: bool = False) -> bytes:
    """Give a .ply whose header is UTF-8 and calls its colours red, green and blue.

    Args:
        content: of the file.
        cut: concave faces by their ears; trimesh fans them out.
    """
    head, end, rest = content.partition(b"end_header")  # the rest may be binary
    head = _COLOUR.sub(lambda found: found[1] + _NAMES[found[2]], unicode(head))
    return of_triangles(head, rest, cut) or head + end + rest


def plain_obj(content: bytes, cut: bool = False) -> tuple[bytes, list[str]]:
    """Give an .obj in UTF-8 that names one material file, `LIBRARY`, and the files it named.

    It may name several on one line or on many, and their names may hold spaces.

    Args:
        content: of the file.
        cut: concave faces by their ears; trimesh fans them out.

    Raises:
        ValueError: a face names vertex 0; they are counted from 1, or back from -1.
    """
    text = unicode(content).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = text.replace(b"\t", b" ")  # trimesh finds no faces behind tabs
    if text.startswith(b" ") or b"\n " in text:  # quick to see, and rare
        text = _INDENT.sub(b"", text)
    text = _uncommented(_CONTINUED.sub(b" ", text))
    if _A_ZERO.search(text) and (face := _VERTEX_0.search(text)):
        line = face[0].strip().decode(errors="replace")[:60]
        raise ValueError(f'a face names vertex 0, where they count from 1: "{line}"')
    if cut:
        text = cut_obj(text)
    lines: list[bytes] = []

    def taken(found: re.Match[bytes]) -> bytes:
        if found.start() and text[found.start() - 1] != ord("\n"):
            return found[0]
        lines.append(found[1])
        return b""

    bare = _LIBRARY.sub(taken, text)
    names = [name.decode() for line in lines for name in _ONE_NAME.findall(line) or [line]]
    if not names:
        return text, []
    return b"mtllib " + LIBRARY.encode() + b"\n" + bare, names


def _uncommented(text: bytes) -> bytes:
    """Give an .obj without what stands behind the numbers of a line."""

    def without(found: re.Match[bytes]) -> bytes:
        start = text.rfind(b"\n", 0, found.start()) + 1
        return b"" if text.startswith(_COMMENTED, start) else found[0]

    return _COMMENT.sub(without, text)


def plain_mtl(content: bytes, placed: Callable[[], None]) -> bytes:
    """Give a material file in UTF-8 without the options of textures; a lone number is grey.

    Args:
        content: of the file.
        placed: called if an option moves, scales or shakes a texture.
    """

    def bare(found: re.Match[bytes]) -> bytes:
        rest = found[2]
        while option := _OPTION.match(rest):
            numbers = re.findall(rb"[-+.\de]+", (option["placed"] or b"")[1:])
            plain = {b"o": 0.0, b"t": 0.0, b"s": 1.0}.get((option["placed"] or b"o")[:1].lower())
            if any(float(number) != plain for number in numbers):
                placed()
            rest = rest[option.end() :]
        return found[1] + b" " + rest.strip(b'"')

    return _GREY.sub(rb"\1 \2 \2 \2", _MAP.sub(bare, unicode(content)))
