"""How many bytes broker and edge server hold: their objects, and what they refer to."""

import sys
from collections import deque
from collections.abc import Iterable
from typing import Any, Final

PACKAGES: Final = frozenset({"afarcloud", "edge_server", "mavlink_broker"})
MOST_OF_BROKER: Final = 512 << 10
"""Per vehicle, several times what a broker holds after a shift with everything in it."""
MOST_OF_EDGE: Final = 128 << 10
"""Four times what an edge server holds after a day: the rest is in its database."""


def held_bytes(root: object) -> int:
    """Add the sizes of all that an object of the product refers to, each once.

    Objects of other packages, such as the simulation's own, end the search; so do classes,
    functions and what is nowhere but in the interpreter.
    """
    seen: set[int] = set()
    waiting: list[Any] = [root]
    total = 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        referred = _referred(one)
        if referred is not None:
            total += sys.getsizeof(one)
            waiting += referred
    return total


def _referred(one: Any) -> Iterable[Any] | None:
    """Give what an object refers to; None if it is not counted."""
    if isinstance(one, dict):
        return [*one.keys(), *one.values()]
    if isinstance(one, list | tuple | set | frozenset | deque):
        return list(one)
    if isinstance(one, str | bytes | bytearray | int | float):
        return ()
    kind = type(one)
    packages = {base.__module__.split(".")[0] for base in kind.__mro__}
    if isinstance(one, type) or not packages & PACKAGES:
        return None
    names = {name for base in kind.__mro__ for name in getattr(base, "__slots__", ())}
    slots = [getattr(one, name) for name in sorted(names) if hasattr(one, name)]
    return [*slots, *vars(one).values()] if hasattr(one, "__dict__") else slots
