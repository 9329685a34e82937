"""What mkdocs.yml hooks in: documents next to this folder become pages of the site too.

In the repository documents link to each other and to code by their places in it. On the site the
same links lead to pages; what is no page of it is only named, since code has no address there.
"""

import os
import re
from pathlib import Path, PurePosixPath
from typing import Any

ROOT = Path(__file__).resolve().parents[1]

MORE_PAGES = {
    "README.md": "project/readme.md",
    "ARCHITECTURE.md": "project/architecture.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "MODEL_CARD.md": "project/model-card.md",
    "SECURITY.md": "project/security.md",
    "CODE_OF_CONDUCT.md": "project/code-of-conduct.md",
    "web/packages/deeplight/README.md": "project/npm.md",
}
"""Their places in the repository, and on the site."""

_LINK = re.compile(r"(?P<text>\[(?:[^\[\]]|\[[^\]]*\])*\])\((?P<to>[^)\s]+)\)")
_CODE = re.compile(r"(^```.*?^```|`[^`\n]*`)", re.MULTILINE | re.DOTALL)


def on_files(files: Any, config: Any) -> Any:
    """Add the further pages."""
    from mkdocs.structure.files import File

    for place, uri in MORE_PAGES.items():
        files.append(File.generated(config, uri, content=(ROOT / place).read_text("utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Turn a document's links in the repository into links of the site."""
    return site_links(markdown, page.file.src_uri)


def site_links(markdown: str, uri: str) -> str:
    """Write the links of the page at `uri` for the site; those in code are left alone."""
    places = {other: place for place, other in MORE_PAGES.items()}
    folder = PurePosixPath(places.get(uri, f"docs/{uri}")).parent

    def replaced(link: re.Match[str]) -> str:
        target, mark, anchor = link["to"].partition("#")
        if not target or ":" in target:
            return link[0]
        place = os.path.normpath(folder / target)
        if place.startswith("docs/"):
            there = place.removeprefix("docs/")
        elif place in MORE_PAGES:
            there = MORE_PAGES[place]
        elif (ROOT / place).exists():
            return link["text"][1:-1]
        else:
            return link[0]  # nowhere: mkdocs ends with an error
        start = os.path.relpath(there, PurePosixPath(uri).parent)
        return f"{link['text']}({start}{mark}{anchor})"

    parts = _CODE.split(markdown)
    return "".join(p if number % 2 else _LINK.sub(replaced, p) for number, p in enumerate(parts))
