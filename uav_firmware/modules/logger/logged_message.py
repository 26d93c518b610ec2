"""What a logged message is: a ULog topic and how its values come out of a message of ours.

A message carries PX4's message and field names in PX4's units, as far as this flight stack
knows the values; readers find them by name. NaN means "not known", as there.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from uav_firmware.modules.logger.ulog import Field, fields

Values = tuple[float, ...]
"""A message's numbers in the order of its fields, arrays laid flat."""


class LoggedMessage(NamedTuple):
    """One ULog topic: its name, its fields, and what they hold of a message of ours."""

    name: str
    fields: tuple[Field, ...]
    values: Callable[[Any], Values]


def declare(name: str, declaration: str, values: Callable[[Any], Values]) -> LoggedMessage:
    """Make a message; the time stamp [us since boot] comes first in all of them."""
    return LoggedMessage(name, fields("uint64_t timestamp; " + declaration), values)
