"""What vehicles may tell in words of AFarCloud, where MAVLink's own messages have no room.

TUNNEL(385) with a payload type that MAVLink leaves to everybody, and a JSON array in UTF-8:

    0xAFC1  [resource id, observed property, result value, result unit], one observation
    0xAFC2  [first, second], the two parameters of the alarm that comes next
"""

import json
import math
from typing import Any, Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message

OBSERVATION: Final = 0xAFC1
ALARM_PARAMETERS: Final = 0xAFC2
LONGEST: Final = 100


class Worded(NamedTuple):
    """One observation in its source's own words."""

    resource_id: str
    observed_property: str
    value: float
    unit: str


def worded(message: Message) -> Worded | None:
    """Read an observation; None for every other message, and for what makes no sense."""
    match _fields(message, OBSERVATION):
        case [str(resource_id), str(observed_property), int() | float() as value, str(unit)]:
            return _checked(resource_id, observed_property, value, unit)
    return None


def alarm_parameters(message: Message) -> tuple[float, float] | None:
    """Read the parameters of an alarm; None for every other message."""
    match _fields(message, ALARM_PARAMETERS):
        case [int() | float() as first, int() | float() as second]:
            one, two = _number(first), _number(second)
            return None if one is None or two is None else (one, two)
    return None


def _fields(message: Message, kind: int) -> Any:
    if message.get_type() != "TUNNEL" or message.payload_type != kind:
        return None
    try:
        return json.loads(bytes(message.payload[: message.payload_length]))
    except (ValueError, RecursionError):
        return None


def _checked(resource_id: str, observed_property: str, value: float, unit: str) -> Worded | None:
    words = resource_id, observed_property, unit
    number = _number(value)
    if number is None or not all(w.isprintable() and 1 <= len(w) <= LONGEST for w in words):
        return None
    return Worded(resource_id, observed_property, number, unit)


def _number(value: float) -> float | None:
    """A finite number; a truth value is none."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
