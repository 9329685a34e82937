"""The image of the paper's pipeline, as far as it can be tried where no image can be built."""

import re
import shutil
import tomllib
import zipfile
from pathlib import Path

import pytest

from deeplight.cli.main import main


@pytest.fixture(scope="module")
def recipe(root: Path) -> str:
    """What the image is built by."""
    if not (root / "Containerfile").exists():
        pytest.skip("no Containerfile in this distribution")
    return (root / "Containerfile").read_text()


def wheel_names(recipe: str, root: Path, tmp_path: Path) -> set[str]:
    """Files of the wheel that is built from nothing but what is copied into the image."""
    wheels = pytest.importorskip("hatchling.builders.wheel")
    inside = tmp_path / "image"
    for line in re.findall(r"^COPY (.*)$", recipe, re.MULTILINE):
        *sources, to = line.split()
        for name in sources:
            if (root / name).is_dir():
                leave = shutil.ignore_patterns("site", "__pycache__")
                shutil.copytree(root / name, inside / to, ignore=leave)
            else:
                (inside / to).mkdir(parents=True, exist_ok=True)
                shutil.copy(root / name, inside / to)
    builder = wheels.WheelBuilder(str(inside))
    wheel = next(builder.build(directory=str(tmp_path), versions=["standard"]))
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_what_is_copied_is_enough_to_install(recipe: str, root: Path, tmp_path: Path) -> None:
    names = wheel_names(recipe, root, tmp_path)
    assert {"deeplight/cli/main.py", "deeplight/weights/deeplight.onnx"} <= names


def test_without_the_sources_it_would_not_be(recipe: str, root: Path, tmp_path: Path) -> None:
    lacking = recipe.replace("COPY src src\n", "")
    assert lacking != recipe
    assert "deeplight/cli/main.py" not in wheel_names(lacking, root, tmp_path)


def test_its_extras_are_the_package_s(recipe: str, root: Path) -> None:
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    (extras,) = re.findall(r'"\.\[(.*)\]"', recipe)
    assert set(extras.split(",")) <= set(project["optional-dependencies"])


def test_its_commands_have_the_flags_that_they_are_given(
    recipe: str, capsys: pytest.CaptureFixture[str]
) -> None:
    commands = re.findall(r"^# +podman run .* deeplight (\w+) (--.*)$", recipe, re.MULTILINE)
    assert [verb for verb, _ in commands] == ["simulate", "train"]
    for verb, options in commands:
        with pytest.raises(SystemExit):
            main([verb, "--help"])
        help_text = capsys.readouterr().out
        for flag in re.findall(r"--\w+", options):
            assert f"{flag} " in help_text, f"{verb} {flag}"
        assert "--nonsense " not in help_text
