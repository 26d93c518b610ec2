"""TUNNEL(385) messages with contents of AFarCloud's model for which MAVLink has no message.

The project's own autopilot sends them. The payload types are in the range for private use; the
payload is a JSON array in UTF-8:

    0xAFC1  [resource id, observed property, result value, result unit], one observation
    0xAFC2  [first, second], the two parameters of the alarm that comes next
"""

import json
import math
from typing import Any, Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message

OBSERVATION: Final = 0xAFC1
ALARM_PARAMETERS: Final = 0xAFC2
MAX_TEXT_CHARACTERS: Final = 100


class TunnelObservation(NamedTuple):
    """One observation, named by its source."""

    resource_id: str
    observed_property: str
    value: float
    unit: str


def tunnel_observation(message: Message) -> TunnelObservation | None:
    """Decode an observation; None for other messages and for invalid values."""
    match _fields(message, OBSERVATION):
        case [str(resource_id), str(observed_property), int() | float() as value, str(unit)]:
            return _checked(resource_id, observed_property, value, unit)
    return None


def alarm_parameters(message: Message) -> tuple[float, float] | None:
    """Decode the parameters of an alarm; None for other messages and for invalid values."""
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


def _checked(
    resource_id: str, observed_property: str, value: float, unit: str
) -> TunnelObservation | None:
    texts = resource_id, observed_property, unit
    number = _number(value)
    if number is None or not all(
        w.isprintable() and 1 <= len(w) <= MAX_TEXT_CHARACTERS for w in texts
    ):
        return None
    return TunnelObservation(resource_id, observed_property, number, unit)


def _number(value: float) -> float | None:
    """A finite number; None for others and for a bool."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
