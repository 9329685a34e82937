"""`import deeplight` is quick and light, and its public names are what they say."""

import json
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

import deeplight
from annotations import checked, checked_once

HEAVY = ("torch", "cv2", "mitsuba", "onnxruntime", "av", "matplotlib")


def in_new_process(code: str) -> str:
    """Run Python code in a fresh interpreter and give what it prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_loads_nothing_heavy() -> None:
    loaded = json.loads(
        in_new_process("import deeplight, sys, json; print(json.dumps([*sys.modules]))")
    )
    assert "deeplight" in loaded
    assert [name for name in HEAVY if name in loaded] == []


def test_importing_is_quick() -> None:
    code = "import time; t = time.process_time(); import deeplight; print(time.process_time() - t)"
    # Processor time, the best of several: the rest of the suite is running on the same cores.
    seconds = min(float(in_new_process(code)) for _ in range(3))
    assert seconds < 0.3


def refuse_circles(package: str) -> grimp.ImportGraph:
    """Raise CycleError if a module imports itself by way of others, inside functions too."""
    graph = grimp.build_graph(package, cache_dir=None)
    imported = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    TopologicalSorter(imported).prepare()
    return graph


def test_no_module_imports_itself_by_way_of_others() -> None:
    assert len(refuse_circles("deeplight").modules) > 300


def test_a_circle_would_be_found(tmp_path: Path, monkeypatch) -> None:
    folder = tmp_path / "going_round"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "a.py").write_text("from going_round.b import y\n")
    (folder / "b.py").write_text("def x() -> None:\n    from going_round import a\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(CycleError):
        refuse_circles("going_round")


def test_public_names_are_sorted_few_and_real() -> None:
    names = list(deeplight.__all__)
    assert names == sorted(set(names))
    assert len(names) <= 20
    assert [name for name in names if not hasattr(deeplight, name)] == []


def test_public_names_are_all_listed() -> None:
    found = {
        name
        for name, value in vars(deeplight).items()
        if not name.startswith("_") and getattr(value, "__module__", "").startswith("deeplight")
    }
    assert found <= set(deeplight.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError):
        _ = deeplight.no_such_name  # type: ignore[attr-defined]


def test_annotations_are_checked_while_tests_run() -> None:
    import numpy as np

    from deeplight.io.photos import encode_png

    with pytest.raises(Exception, match=r"encode_png"):
        encode_png(np.zeros((4, 4, 2), np.uint8))
    for _ in range(2):  # a kind of call that is right is looked at once, a wrong one always
        encode_png(np.zeros((4, 4, 3), np.uint8))
        with pytest.raises(Exception, match=r"encode_png"):
            encode_png(np.zeros((4, 4, 3), np.float32))


def test_results_are_checked_after_calls_that_were_right() -> None:
    import numpy as np
    from jaxtyping import Float, TypeCheckError

    def cut(values: Float[np.ndarray, "n 3"], name: str = "") -> Float[np.ndarray, "n 3"]:
        return np.zeros((2, 2)) if name == "a" * 99 + "!" else values

    function = checked_once(cut, typechecker=checked)
    values = np.zeros((2, 3))
    assert function(values, "a" * 100).shape == (2, 3)
    with pytest.raises(TypeCheckError, match="return value"):
        function(values, "a" * 99 + "!")  # the same kind of call
    with pytest.raises(TypeCheckError, match="parameters"):
        function(values.astype(int))
