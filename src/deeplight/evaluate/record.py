"""What an evaluation was: run.toml, to be able to do it again."""

import json
import platform
import subprocess
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from deeplight.io.atomic import replacing

PACKAGES = ("deeplight", "numpy", "onnxruntime", "pillow")


def write_run_toml(folder: Path, settings: Mapping[str, Any], facts: Mapping[str, Any]) -> None:
    """Write settings, facts (hashes of data and model, seed), commit and versions.

    Raises:
        OSError: the folder cannot be written.
    """
    versions = {"python": platform.python_version()}
    versions |= {package: version(package) for package in PACKAGES}
    sections = {
        "settings": settings,
        "run_facts": {**facts, "commit": commit()},
        "versions": versions,
    }
    text = "\n".join(_section(name, values) for name, values in sections.items())
    with replacing(folder / "run.toml") as temporary:
        temporary.write_text(text, encoding="utf-8")


def commit() -> str:
    """Give the commit of the package, with -dirty if files were changed; "unknown" without git."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=40"]
    try:
        result = subprocess.run(
            command, cwd=Path(__file__).parent, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return result.stdout.strip()


def _section(name: str, values: Mapping[str, Any]) -> str:
    # JSON's strings, numbers and booleans are TOML's, which has no null.
    lines = [f"{key} = {json.dumps(value)}" for key, value in values.items() if value is not None]
    return "\n".join([f"[{name}]", *lines]) + "\n"
