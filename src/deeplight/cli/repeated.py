"""Options that take several values and may be repeated: --model A B is --model A --model B."""

from itertools import chain

import tyro

Repeated = tyro.conf.UseAppendAction[tuple[tuple[str, ...], ...]]


def flat(given: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """All values in the order they were given in."""
    return tuple(chain.from_iterable(given))
