"""The tree itself: one version, short functions, nothing private in it."""

import ast
import re
import subprocess
import tomllib
import zipfile
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import pytest

from deeplight.cli.main import VERBS

LONGEST_FUNCTION = 60
LONGEST_FILE = 400
TEXT_SUFFIXES = frozenset(
    ["", *".cff .css .html .js .json .md .py .sh .toml .ts .txt .yaml .yml".split()]
)


@pytest.fixture(scope="module")
def tracked(root: Path) -> list[Path]:
    """Every text file under version control; all files where there is no git."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("no git checkout")
    paths = [root / name for name in listed.stdout.split("\0") if name]
    return [path for path in paths if path.suffix in TEXT_SUFFIXES and path.is_file()]


def python_files(root: Path) -> list[Path]:
    folders = ("src", "lab", "benchmarks", "examples", "docs")
    return sorted(path for name in folders for path in (root / name).rglob("*.py"))


class Part(NamedTuple):
    """What may have a docstring; `length` is a function's lines below it, 0 of others."""

    name: str
    line: int
    docstring: str
    length: int


@cache
def parts_of(source: str) -> tuple[Part, ...]:
    """Give the modules, classes and functions of a file, parsed once for all tests."""
    functions = ast.FunctionDef | ast.AsyncFunctionDef
    parts = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | functions):
            length = body_length(node) if isinstance(node, functions) else 0
            where = getattr(node, "name", ""), getattr(node, "lineno", 1)
            parts.append(Part(*where, ast.get_docstring(node) or "", length))
    return tuple(parts)


def test_the_readme_names_every_verb_and_links_every_document(root: Path) -> None:
    text = (root / "README.md").read_text()
    assert [verb for verb in VERBS if f"deeplight {verb}" not in text] == []
    documents = {path.name for path in (root / "docs").glob("*.md")}
    assert [name for name in sorted(documents) if f"(docs/{name})" not in text] == []
    shelves = (root / "mkdocs.yml").read_text()
    assert [name for name in sorted(documents) if f" {name}\n" not in shelves] == []


def test_architecture_names_every_module_and_what_it_names_is_there(root: Path) -> None:
    text = (root / "ARCHITECTURE.md").read_text()
    package = root / "src" / "deeplight"
    entries = {path.stem for path in package.iterdir() if not path.name.startswith(("__", "."))}
    missing = [name for name in sorted(entries - {"py"}) if not re.search(rf"`{name}[/`]", text)]
    assert missing == []
    where = text.split("## Where is ...")[1].split("\n## ")[0]
    named = re.findall(r"`([\w/]+\.py)`", where)
    assert len(named) > 10
    assert [name for name in named if not (package / name).is_file()] == []


FENCE = re.compile(r'\w*( title="[^"]+")?')


def test_the_site_understands_the_heads_of_code_blocks(root: Path) -> None:
    """Of any other it makes text."""
    for path in (root / "docs").glob("*.md"):
        heads = [line[3:] for line in path.read_text().splitlines() if line.startswith("```")]
        assert [head for head in heads if not FENCE.fullmatch(head)] == [], path.name
    assert not FENCE.fullmatch("python file=a.py")  # what was once read as text


def test_the_site_understands_examples_of_docstrings(root: Path) -> None:
    """They stand below `Examples:`; elsewhere their marks are taken for quotations."""
    for path in (root / "src").rglob("*.py"):
        for part in parts_of(path.read_text()):
            before = part.docstring.split(">>>")[0]
            assert before == part.docstring or "Examples:\n" in before, path


PLAIN = re.compile(r"\b(told|tells?|beside|so many)\b", re.IGNORECASE)
"""Words that have a plainer one: say, print, report, next to, number of."""


def test_words_are_plain(tracked: list[Path], root: Path) -> None:
    found = []
    for path in tracked:
        if path == Path(__file__) or path.name == "package-lock.json":
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if PLAIN.search(line.replace(".tell()", "")):
                found.append(f"{path.relative_to(root)}:{number} {line.strip()[:60]}")
    assert found == []


def test_every_place_names_the_same_version(root: Path) -> None:
    with (root / "pyproject.toml").open("rb") as file:
        stated = tomllib.load(file)["project"]["version"]
    assert version("deeplight") == stated
    headings = [
        line for line in (root / "CHANGELOG.md").read_text().splitlines() if line[:3] == "## "
    ]
    assert headings[0].split()[1] == stated
    assert f"\nversion: {stated}\n" in (root / "CITATION.cff").read_text()
    assert f'"version": "{stated}"' in (root / "web/packages/deeplight/package.json").read_text()
    initial = (root / "src" / "deeplight" / "__init__.py").read_text()
    assert "__version__" not in initial or f'__version__ = "{stated}"' in initial


def test_functions_are_short(root: Path) -> None:
    too_long = []
    for path in python_files(root):
        for part in parts_of(path.read_text()):
            if part.length > LONGEST_FUNCTION:
                too_long.append(f"{path.name}:{part.line} {part.name}: {part.length} lines")
    assert too_long == []


def test_no_file_is_long(root: Path) -> None:
    paths = [*python_files(root), *(root / "tests").rglob("*.py")]
    lines = {path.name: path.read_text().count("\n") for path in paths}
    assert {name: count for name, count in lines.items() if count > LONGEST_FILE} == {}


def body_length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Count the lines of a function below its docstring."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def test_a_long_function_would_be_found() -> None:
    source = 'def f():\n    """Doc."""\n' + "    x = 1\n" * 61
    assert [part.length for part in parts_of(source)] == [0, 61]


DESCRIBES = set(
    "Adds Applies Brings Builds Carries Checks Collects Computes Converts Creates Decodes Draws"
    " Estimates Fills Finds Follows Gets Gives Has Holds Is Keeps Lets Loads Makes Moves Prints"
    " Puts Raises Reads Removes Renders Returns Runs Says Sends Serves Sets Turns Writes".split()
)
"""First words that say of a function what it does, where others command or name what is given."""


def moods(source: str) -> list[str]:
    """First lines of docstrings in the third person."""
    first = [(part.docstring or "-").splitlines()[0] for part in parts_of(source)]
    return [line for line in first if line.split()[0] in DESCRIBES]


def test_docstrings_command_or_name(root: Path) -> None:
    """As CONTRIBUTING says: "Write the panorama" or "Rows of the panorama"."""
    found = {path.name: moods(path.read_text()) for path in python_files(root)}
    # `runs` of neighbouring frames are things.
    allowed = "Runs of up to `longest` neighbouring frames"
    assert [line for lines in found.values() for line in lines if allowed not in line] == []
    assert moods('"""Returns the rows."""') == ["Returns the rows."]  # the twin
    names = 'def f():\n    """Rows of the panorama."""\n\n\nclass A:\n    """Write it."""\n'
    assert moods(names) == []


def test_annotations_are_real_objects(root: Path) -> None:
    line = "from __future__ import annotations"
    assert [path.name for path in python_files(root) if line in path.read_text()] == []


def test_nothing_private_and_no_merge_markers(tracked: list[Path]) -> None:
    # Written in pieces, so that this file does not find itself.
    forbidden = [
        "<" * 7 + " ", ">" * 7 + " ", "/" + "work/", "/" + "home/", "/" + "root/", "/" + "Users/",
    ]  # fmt: skip
    found = [
        f"{path.name}:{number}: {mark.strip()}"
        for path in tracked
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1)
        for mark in forbidden
        if mark in line
    ]
    assert found == []


def test_the_wheel_holds_the_program_and_its_weights(root: Path, tmp_path: Path) -> None:
    hatchling = pytest.importorskip("hatchling.builders.wheel")
    builder = hatchling.WheelBuilder(str(root))
    wheel = next(builder.build(directory=str(tmp_path), versions=["standard"]))
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    inside = root / "src"
    shipped = (inside / "deeplight/weights").iterdir()
    weights = [path.relative_to(inside).as_posix() for path in shipped if path.is_file()]
    assert {
        "deeplight/__init__.py",
        "deeplight/py.typed",
        "deeplight/cli/main.py",
        *weights,
    } <= names
    assert not any(name.startswith(("tests", "benchmarks")) for name in names)
