"""What the flags of several verbs share."""

from dataclasses import fields
from itertools import chain
from typing import Any

import tyro

from deeplight.errors import ConfigError

Repeated = tyro.conf.UseAppendAction[tuple[tuple[str, ...], ...]]
"""A flag that takes several values and may be repeated: --model A B is --model A --model B."""

CALLED = {"inputs": "IN", "made_from": "--from"}
"""Fields that users see by another name than their own."""


def flat(given: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """All values of a repeated flag, in the order they were given in."""
    return tuple(chain.from_iterable(given))


def check_fov(fov_deg: float | None) -> None:
    """Refuse a field of view that cannot be; None is one that is not given.

    Raises:
        ConfigError: it is not between 0 and 180 degrees.
    """
    if fov_deg is not None and not 0 < fov_deg < 180:
        raise ConfigError("--fov between 0 and 180 degrees", f"{fov_deg:g}", "correct it")


def refuse_unused(args: Any, why: str, *names: str) -> None:
    """Refuse flags that would change nothing.

    Args:
        args: of the verb, a dataclass with defaults for `names`.
        why: they change nothing, as "without --data".
        names: fields of `args` that must have their defaults.

    Raises:
        ConfigError: one has another value.
    """
    defaults = {field.name: field.default for field in fields(args)}
    given = [name for name in names if getattr(args, name) not in ((), defaults[name])]
    if given:
        flags = ", ".join(CALLED.get(name, f"--{name.replace('_', '-')}") for name in given)
        do = "leave it out" if len(given) == 1 else "leave them out"
        raise ConfigError("flags that are used", f"{flags} {why}", do)
