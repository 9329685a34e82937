"""Scripts outside the package, such as those that write golden files, as modules."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


def loaded(path: Path) -> ModuleType:
    """Run a script without its `__main__` part; it may import its neighbours while it loads."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look their module up
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def web_maker(root: Path, name: str) -> ModuleType:
    """A script that writes golden files for the page; the test is skipped where there is none."""
    if not (root / "web").exists():
        pytest.skip("no web folder in this distribution")
    return loaded(root / f"tests/golden/{name}.py")
