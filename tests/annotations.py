"""How annotations, array shapes among them, are checked while tests run.

pytest is given `checked` in pyproject.toml; it is called on every function of deeplight. jaxtyping
takes a tenth of a millisecond for each call, a third of the time of all tests, though most calls
are of types and shapes that were right before: `install` has it look at each kind of call once.
"""

import dataclasses
import enum
import functools
import inspect
import threading
import types
from collections.abc import Callable, Hashable, Mapping
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype
from beartype.roar import BeartypeDecorHintPep673Exception

# An int is a float to Python's typing (PEP 484), so it is one here.
_beartype = beartype(conf=BeartypeConf(is_pep484_tower=True))
_jaxtyped = jaxtyping.jaxtyped

MOST_KINDS = 500
"""Of calls of one function that are remembered; further ones are always looked at."""
LONGEST = 16
"""Of sequences whose every value is part of the kind; calls with longer ones are looked at."""
LITERALS = 24
"""Characters of the longest word that an annotation may ask for."""


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Check the arguments and the result of each call against their annotations."""
    try:
        return _beartype(function)
    except BeartypeDecorHintPep673Exception:
        return function  # `Self` has no meaning to a checker that sees one method at a time


def install() -> None:
    """Check each kind of call once; to be called before deeplight is imported."""
    jaxtyping.jaxtyped = checked_once


def checked_once(function: Any = None, *, typechecker: Any) -> Any:
    """Stand in for `jaxtyping.jaxtyped`, a decorator of functions and dataclasses."""
    if function is None:
        return functools.partial(checked_once, typechecker=typechecker)
    if inspect.isclass(function):
        if dataclasses.is_dataclass(function) and "__init__" in vars(function):
            function.__init__ = checked_once(function.__init__, typechecker=typechecker)
        return function
    if not isinstance(function, types.FunctionType):
        return _jaxtyped(function, typechecker=typechecker)
    return _once(function, typechecker) if function.__annotations__ else function


def _once(function: types.FunctionType, typechecker: Any) -> Callable[..., Any]:
    right: dict[Hashable, set[Hashable]] = {}  # kinds of results, by the kind of the call

    @functools.cache  # made at the first call: most functions are never called by one test process
    def whole() -> Callable[..., Any]:
        checks: Callable[..., Any] = _jaxtyped(function, typechecker=typechecker)
        return checks

    @functools.cache
    def result_check() -> "ResultCheck":
        return ResultCheck(function, typechecker)

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        kind = kind_of((args, kwargs)) if kwargs else _kinds_of(args)
        results = None if kind is None else right.get(kind)
        if results is None:
            result = whole()(*args, **kwargs)
            if kind is not None and len(right) < MOST_KINDS:
                right[kind] = {kind_of(result)}
            return result
        result = function(*args, **kwargs)
        of_result = kind_of(result)
        if of_result is None or of_result not in results:
            result_check()(args, kwargs, result)
            results.add(of_result)
        return result

    return called


class ResultCheck:
    """The check of a call that was made already: of its result, by its arguments."""

    def __init__(self, function: types.FunctionType, typechecker: Any) -> None:
        results: list[Any] = []

        def given(*_: Any, **__: Any) -> Any:
            return results.pop()

        # With the function's own globals, in which the names of its annotations mean something.
        there = types.FunctionType(given.__code__, function.__globals__, closure=given.__closure__)
        self._results, self._lock = results, threading.RLock()
        self._checks: Callable[..., Any] = _jaxtyped(
            functools.update_wrapper(there, function), typechecker=typechecker
        )

    def __call__(self, args: tuple[Any, ...], kwargs: dict[str, Any], result: Any) -> None:
        with self._lock:
            self._results[:] = [result]
            self._checks(*args, **kwargs)


def kind_of(value: Any) -> Hashable:
    """What decides whether a value is what an annotation asks for; None where that is much."""
    kind = type(value)
    how = _how.get(kind)
    if how is None:  # a question for each type, not for each value: these are asked by every call
        how = _how[kind] = _how_of(kind)
    return how(value)


_how: dict[type, Callable[[Any], Hashable]] = {}


def _how_of(kind: type) -> Callable[[Any], Hashable]:
    """How to know the kind of the values of a type."""
    import numpy as np  # not before conftest.py has chosen the number of its threads

    if kind in (types.NoneType, float):
        return type
    if issubclass(kind, str):
        return lambda word: (kind, word) if len(word) <= LITERALS else kind
    if issubclass(kind, int | bytes | enum.Enum):
        return lambda value: (kind, value)
    if issubclass(kind, tuple | list):
        return lambda values: None if (parts := _kinds_of(values)) is None else (kind, parts)
    if kind is dict:
        return _kind_of_dict
    if issubclass(kind, Mapping | set | frozenset):  # looking into one may call checked code
        return lambda _: None
    if not hasattr(kind, "dtype"):  # asking the value may call a checked function
        return type
    if kind is np.ndarray:
        return lambda array: (kind, array.dtype, array.shape)
    return _kind_of_array


def _kind_of_dict(value: dict[Any, Any]) -> Hashable:
    keys, values = _kinds_of(tuple(value)), _kinds_of(tuple(value.values()))
    return None if keys is None or values is None else (dict, keys, values)


def _kind_of_array(value: Any) -> Hashable:
    dtype, shape = value.dtype, getattr(value, "shape", None)
    if dtype is None or not isinstance(shape, tuple):
        return type(value)
    numbers = all(type(size) is int for size in shape)  # not so where torch traces a network
    return (type(value), dtype, tuple(shape)) if numbers else None


def _kinds_of(values: tuple[Any, ...] | list[Any]) -> tuple[Hashable, ...] | None:
    if len(values) > LONGEST:
        return None
    kinds = []
    for value in values:
        kind = kind_of(value)
        if kind is None:
            return None
        kinds.append(kind)
    return tuple(kinds)
