"""The examples in docstrings of public names give what they say."""

import doctest
import sys
from pathlib import Path

import numpy as np
import pytest

import deeplight

# What needs a network, a data set, several pictures or a renderer has an example in examples/.
WITHOUT = {
    "DeepLightError",
    "InputError",
    "PAPER_RIG",
    "compose_photo",
    "estimate_many",
    "evaluate_models",
    "fuse_views",
    "load_estimator",
    "read_environment",  # in convert's
}


@pytest.mark.parametrize("name", sorted({*deeplight.__all__} - WITHOUT))
def test_the_example_of_a_public_name(name: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    value = getattr(deeplight, name)
    home = sys.modules[value.__module__]
    finder = doctest.DocTestFinder(recurse=False)
    (example,) = finder.find(value, name, home, globs={"deeplight": deeplight, "np": np})
    assert example.examples
    report: list[str] = []
    failed, tried = doctest.DocTestRunner().run(example, out=report.append)
    assert tried > 0
    assert failed == 0, "".join(report)


def test_a_wrong_number_is_noticed() -> None:
    (example,) = doctest.DocTestFinder().find(wrong, "wrong")
    runner = doctest.DocTestRunner()
    assert runner.run(example, out=lambda line: None).failed == 1


def wrong() -> None:
    """It is not three.

    >>> 1 + 1
    3
    """
