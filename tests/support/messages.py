"""Messages in tests, of whichever kind their class is: named tuple, or plain with final fields."""

import inspect
from typing import Any, TypeVar

T = TypeVar("T")


def fields_of(message: Any) -> dict[str, Any]:
    """Values by name, in the order in which the class takes them."""
    names = inspect.signature(type(message)).parameters
    return {name: getattr(message, name) for name in names}


def changed(message: T, **fields: Any) -> T:
    """The same message with some fields changed."""
    return type(message)(**{**fields_of(message), **fields})


def said(value: Any) -> Any:
    """What a message says, or each of several, to be compared: plain classes become tuples."""
    if isinstance(value, (list, tuple)):
        return tuple(said(part) for part in value)
    if hasattr(value, "__slots__") and type(value).__module__.startswith(("sim.", "uav_firmware.")):
        return (type(value), *(said(part) for part in fields_of(value).values()))
    return value
