"""Observations that come in words: who measured what, how much of it, and in which unit.

MAVLink's own messages have no room for a resource id or a unit. A vehicle that has them to tell
(a person's stand-in, a probe of another make) sends TUNNEL(385) with payload type 0xAFC1: in UTF-8
the JSON array [resource id, observed property, result value, result unit].
"""

import json
import math
from typing import Any, Final, NamedTuple

from mavlink_broker.dialect import Message

PAYLOAD_TYPE: Final = 0xAFC1
"""Of the range that MAVLink leaves to everybody, 0x8000 and above."""
LONGEST: Final = 100


class Worded(NamedTuple):
    """One observation in its source's own words."""

    resource_id: str
    observed_property: str
    value: float
    unit: str


def worded(message: Message) -> Worded | None:
    """Read a message; None for every other one, and for what makes no sense."""
    if message.get_type() != "TUNNEL" or message.payload_type != PAYLOAD_TYPE:
        return None
    payload = bytes(message.payload[: message.payload_length])
    try:
        fields: Any = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    match fields:
        case [str(resource_id), str(observed_property), int() | float() as value, str(unit)]:
            return _checked(resource_id, observed_property, value, unit)
    return None


def _checked(resource_id: str, observed_property: str, value: float, unit: str) -> Worded | None:
    words = resource_id, observed_property, unit
    sensible = all(word.isprintable() and 1 <= len(word) <= LONGEST for word in words)
    if isinstance(value, bool) or not sensible:
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return Worded(resource_id, observed_property, number, unit) if math.isfinite(number) else None
