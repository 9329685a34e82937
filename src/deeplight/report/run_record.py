"""run.toml: what a run was, to be able to do it again."""

import json
import platform
import subprocess
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from deeplight.io.atomic import replacing

PACKAGES = (
    "deeplight",
    "lightning",
    "lightning-fabric",
    "numpy",
    "onnxruntime",
    "pillow",
    "safetensors",
    "torch",
)
"""The packages that decide numbers; run.toml gives the versions of those installed."""


def write_run_toml(
    folder: Path, settings: Mapping[str, Mapping[str, Any]], facts: Mapping[str, Any]
) -> None:
    """Write run.toml: facts of the run and the commit, versions, and the settings by section.

    Values are strings, numbers, booleans and lists or tuples of these; None is left out, as TOML
    has no null.

    Raises:
        OSError: the folder cannot be written.
    """
    sections = {
        "run_facts": {**facts, "commit": _commit()},
        "versions": {"python": platform.python_version(), **_versions()},
        **settings,
    }
    text = "\n".join(_section(name, values) for name, values in sections.items())
    with replacing(folder / "run.toml") as temporary:
        temporary.write_text(text, encoding="utf-8")


def _section(name: str, values: Mapping[str, Any]) -> str:
    # JSON's strings, numbers, booleans and arrays of these are TOML's.
    lines = [f"{key} = {json.dumps(value)}" for key, value in values.items() if value is not None]
    return "\n".join([f"[{name}]", *lines]) + "\n"


def _versions() -> dict[str, str]:
    found = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _commit() -> str:
    """Give the commit of the package, with -dirty if files were changed; installed without its
    repository (which another one may lie around), its name and version."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=40"]
    own = ["git", "ls-files", "--error-unmatch", Path(__file__).name]
    try:
        for words in (own, command):
            result = subprocess.run(
                words, cwd=Path(__file__).parent, capture_output=True, text=True, check=True
            )
    except (OSError, subprocess.CalledProcessError):
        return f"deeplight {_versions().get('deeplight', 'of unknown version')}"
    return result.stdout.strip()
