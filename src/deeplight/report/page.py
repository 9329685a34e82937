"""A report as one HTML file: pictures inside, no script, readable in light and dark and on paper.

    page = Page("Clip 7", "What was found in it")
    page.add(Heading("Geometry"), Table(("sphere", "angle"), [("mirror", "27.1")]))
    page.write(Path("clip7.html"))

Text is escaped by the template; nothing in a report comes from the network.
"""

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import UInt8

from deeplight.errors import MissingExtraError
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg, encode_png
from deeplight.report.chart import Chart

if TYPE_CHECKING:
    import jinja2

TEMPLATE = Path(__file__).with_name("page.html")
JPEG_QUALITY = 88


@dataclass(frozen=True)
class Heading:
    """A heading of a section; `anchor` makes it a link's target."""

    text: str
    anchor: str = ""
    kind: Literal["heading"] = "heading"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; `tone` colours it: a note, a warning or a failure stands out."""

    text: str
    tone: Literal["plain", "note", "warning", "failure"] = "plain"
    kind: Literal["paragraph"] = "paragraph"


@dataclass(frozen=True)
class Link:
    """A cell of a table that leads to another file or anchor."""

    text: str
    target: str


@dataclass(frozen=True)
class Table:
    """A table; cells that are numbers are set to the right."""

    head: Sequence[str]
    rows: Sequence[Sequence[str | int | float | Link]]
    caption: str = ""
    kind: Literal["table"] = "table"


@dataclass(frozen=True, eq=False)
class Figure:
    """A picture with its caption.

    Attributes:
        pixels: 8-bit RGB.
        caption: shown below it.
        alt: says what is to be seen to those who do not see it; left out, the caption.
        width_px: as shown; 0 is the picture's own.
        exact: keep every pixel (PNG, and enlarged without smoothing), else JPEG.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    caption: str = ""
    alt: str = ""
    width_px: int = 0
    exact: bool = False
    kind: Literal["figure"] = "figure"

    @property
    def data_uri(self) -> str:
        """The picture itself as an address."""
        name = "png" if self.exact else "jpeg"
        content = encode_png(self.pixels) if self.exact else encode_jpeg(self.pixels, JPEG_QUALITY)
        return f"data:image/{name};base64,{base64.b64encode(content).decode('ascii')}"


@dataclass(frozen=True)
class PageRow:
    """Figures side by side, in as many lines as the window's width asks for."""

    figures: Sequence[Figure]
    caption: str = ""
    kind: Literal["row"] = "row"


Block = Heading | Paragraph | Table | Figure | PageRow | Chart


@dataclass
class Page:
    """A report under construction: blocks in their order."""

    title: str
    summary: str = ""
    blocks: list[Block] = field(default_factory=list)

    def add(self, *blocks: Block) -> None:
        """Put blocks at the end."""
        self.blocks += blocks

    def html(self) -> str:
        """Give the whole file as text.

        Raises:
            MissingExtraError: jinja2 is not installed.
        """
        return _template().render(page=self)

    def write(self, path: Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            MissingExtraError: jinja2 is not installed.
            OSError: the file cannot be written.
        """
        html = self.html()
        with replacing(path) as temporary:
            temporary.write_text(html, encoding="utf-8", errors="replace")  # names may not be

    def __iter__(self) -> Iterator[Block]:
        return iter(self.blocks)


@cache
def _template() -> "jinja2.Template":
    try:
        import jinja2
    except ImportError as error:
        raise MissingExtraError("capture", "reports as HTML") from error
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.tests["figures"] = lambda cell: isinstance(cell, int | float)
    environment.tests["link"] = lambda cell: isinstance(cell, Link)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
