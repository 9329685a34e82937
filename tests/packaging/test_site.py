"""Links of the documents as a site: each leads to a page of it, or is no link."""

import importlib.util
import os
import re
from pathlib import Path, PurePosixPath
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def site(root: Path) -> ModuleType:
    """What mkdocs.yml hooks in."""
    spec = importlib.util.spec_from_file_location("site_of_documents", root / "docs" / "site.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def dead(site: ModuleType, markdown: str, uri: str, files: set[str]) -> list[str]:
    """The relative links of the page at `uri` that lead to none of the site's `files`."""
    written = site.site_links(markdown, uri)
    parts = site._CODE.split(written)[::2]
    targets = [link["to"].partition("#")[0] for p in parts for link in site._LINK.finditer(p)]
    folder = PurePosixPath(uri).parent
    return [t for t in targets if t and ":" not in t and os.path.normpath(folder / t) not in files]


def test_every_link_of_the_site_leads_to_a_page(site: ModuleType, root: Path) -> None:
    docs = root / "docs"
    files = {path.relative_to(docs).as_posix() for path in docs.rglob("*") if path.is_file()}
    pages = {uri: docs / uri for uri in files if uri.endswith(".md")}
    pages |= {uri: root / place for place, uri in site.MORE_PAGES.items()}
    files |= set(pages)
    assert {uri: found for uri, path in pages.items()
            if (found := dead(site, path.read_text("utf-8"), uri, files))} == {}  # fmt: skip
    assert dead(site, "[no page](nowhere.md)", "README.md", files) == ["nowhere.md"]  # the twin
    shelves = (root / "mkdocs.yml").read_text()
    assert [uri for uri in pages if f" {uri}\n" not in shelves] == []


def headings(text: str) -> set[str]:
    """What a link into a page may name after its #."""
    markdown = pytest.importorskip("markdown")  # comes with tensorboard
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = "\n\n".join(line for line in prose.splitlines() if line.startswith("#"))
    return set(re.findall(r' id="([^"]+)"', markdown.markdown(lines, extensions=["toc"])))


def without_heading(site: ModuleType, text: str, page: Path) -> list[str]:
    """Links of a page to headings that no page has."""
    links = (link["to"] for p in site._CODE.split(text)[::2] for link in site._LINK.finditer(p))
    lost = []
    for link in links:
        place, _, heading = link.partition("#")
        target = page.parent / place if place else page
        if ":" not in link and heading and target.suffix == ".md":
            there = text if target == page else target.read_text("utf-8")
            lost += [link] * (heading not in headings(there))
    return lost


def test_every_link_into_a_page_leads_to_a_heading(site: ModuleType, root: Path) -> None:
    pages = [*(root / "docs").rglob("*.md"), *(root / place for place in site.MORE_PAGES)]
    found = {page.name: without_heading(site, page.read_text("utf-8"), page) for page in pages}
    assert {name: lost for name, lost in found.items() if lost} == {}
    here = root / "docs" / "compose.md"
    twin = "[a](#nowhere) [b](estimate.md#nowhere) [c](estimate.md#speed)"
    assert without_heading(site, twin, here) == ["#nowhere", "estimate.md#nowhere"]


@pytest.mark.parametrize(
    ("uri", "here", "there"),
    [
        ("README.md", "[R](../README.md)", "[R](project/readme.md)"),
        ("README.md", "[e](../examples) and `[e](../examples)`", "e and `[e](../examples)`"),
        ("project/readme.md", "[lamps](docs/training.md#lamps)", "[lamps](../training.md#lamps)"),
        ("project/readme.md", "![a](docs/pictures/fuse.jpg)", "![a](../pictures/fuse.jpg)"),
        ("project/npm.md", "[up](../../../README.md)", "[up](readme.md)"),
        ("web.md", "[a](https://x.org/a.md) [b](b.md)", "[a](https://x.org/a.md) [b](b.md)"),
        ("web.md", "```\n[e](../examples)\n```", "```\n[e](../examples)\n```"),
    ],
)  # fmt: skip
def test_links_of_the_repository_become_links_of_the_site(
    site: ModuleType, uri: str, here: str, there: str
) -> None:
    assert site.site_links(here, uri) == there
