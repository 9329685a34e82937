"""docs/paper-map.md names code and tests that exist."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

CODE = re.compile(r"`([\w/]+\.py):([\w.]+)`")
TEST = re.compile(r"`([\w/]+/test_\w+\.py)(?:::(\w+))?`")


def names_in(path: Path) -> Iterator[str]:
    """Everything a module defines at its top, and the members of its classes."""
    for node in ast.parse(path.read_text()).body:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        flat = (n for target in targets if target for n in ast.walk(target))
        yield from (n.id for n in flat if isinstance(n, ast.Name))
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        if isinstance(node, ast.ClassDef):
            inner = (n for n in node.body if isinstance(n, ast.FunctionDef))
            yield from (f"{node.name}.{n.name}" for n in inner)


def missing(text: str, root: Path) -> list[str]:
    """What `text` names and the tree lacks."""
    named = [(_home(file, root) / file, name) for file, name in CODE.findall(text)]
    named += [(root / "tests" / file, name) for file, name in TEST.findall(text)]
    return [
        f"{path.name}: {name}"
        for path, name in named
        if not path.exists() or (name and name not in set(names_in(path)))
    ]


def _home(file: str, root: Path) -> Path:
    return root if file.startswith("lab/") else root / "src" / "deeplight"


@pytest.fixture
def paper_map(root: Path) -> str:
    return (root / "docs" / "paper-map.md").read_text()


def test_everything_named_exists(paper_map: str, root: Path) -> None:
    assert len(CODE.findall(paper_map)) > 40
    assert missing(paper_map, root) == []


def test_a_wrong_name_would_be_found(root: Path) -> None:
    text = "`sphere.py:NoSuchThing` `laws/test_gone.py::test_x` `laws/test_relight.py::test_no`"
    assert len(missing(text, root)) == 3


def test_every_row_says_whose_it_is(paper_map: str) -> None:
    rows = [line for line in paper_map.splitlines() if re.match(r"\| [^-]", line)]
    last = [row.rstrip(" |").rsplit("|", 1)[-1] for row in rows if "in the paper" not in row]
    assert len(last) > 40
    unsure = [row for row in last if not re.search("paper|our choice|later|both forms", row)]
    assert unsure == []
