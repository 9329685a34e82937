"""How annotations, array shapes among them, are checked while tests run.

pytest is given `checked` in pyproject.toml; it is called on every function of deeplight.
"""

from collections.abc import Callable
from typing import Any

from beartype import BeartypeConf, beartype
from beartype.roar import BeartypeDecorHintPep673Exception

# An int is a float to Python's typing (PEP 484), so it is one here.
_beartype = beartype(conf=BeartypeConf(is_pep484_tower=True))


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Check the arguments and the result of each call against their annotations."""
    try:
        return _beartype(function)
    except BeartypeDecorHintPep673Exception:
        return function  # `Self` has no meaning to a checker that sees one method at a time
