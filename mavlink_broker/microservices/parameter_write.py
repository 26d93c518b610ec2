"""Writes one parameter by name, and knows what it was before.

The parameter is read first: its type says how its value travels, and its old value is what may
have to be put back. PARAM_SET(23) is repeated until PARAM_VALUE(22) shows the new value. A vehicle
that refuses shows the old one again, and some also say why (PARAM_ERROR); one that lacks the
parameter may stay silent.

Integers travel in a field that is a float, either as their bits or as their value. A capability
in AUTOPILOT_VERSION says which (PARAM_ENCODE_BYTEWISE, PARAM_ENCODE_C_CAST); the wrong choice
corrupts them silently.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, NamedTuple, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Refused
from mavlink_broker.microservices.round_trip import RoundTrip

ATTEMPTS: Final = 6
"""Per question: at 20 % loss each way one in 460 stays unanswered after as many."""
CONTRADICTIONS: Final = 3
"""Answers with another value before it is believed: one may still belong to the reading."""

_LAYOUTS: Final = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<B3x",
    mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_UINT16: "<H2x",
    mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
    mavlink.MAV_PARAM_TYPE_REAL32: "<f",
}
"""How a value of each MAV_PARAM_TYPE lies in the field's four bytes."""
_ERRORS: Final = {
    1: "it does not exist",
    2: "the value is out of its range",
    3: "permission denied",
    4: "component not found",
    5: "it is read-only",
    6: "its type is not supported",
    7: "its type is another one",
    8: "it cannot be read",
}
"""PARAM_ERROR.error; the shipped dialect lacks the names of 6, 7 and 8."""


class ParameterEncoding(Enum):
    """How a vehicle puts integers into the float field."""

    BYTEWISE = auto()
    C_CAST = auto()


class Setting(NamedTuple):
    """A parameter and the value that it is to have."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Written:
    """The vehicle has the value now; `previous` is what it had before."""

    previous: float


@dataclass(frozen=True, slots=True)
class Left:
    """It was not written, because of the value that it has."""

    value: float


WriteOutcome: TypeAlias = Written | Left | Refused


class Consent(Enum):
    """Whether a value that was read may be overwritten."""

    GIVEN = auto()
    AWAITED = auto()
    DENIED = auto()


def always(previous: float) -> Consent:
    """Let every value be overwritten."""
    del previous
    return Consent.GIVEN


def encoding_of(capabilities: int, otherwise: ParameterEncoding) -> ParameterEncoding:
    """Read a vehicle's encoding from AUTOPILOT_VERSION.capabilities, where it says one."""
    if capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE:
        return ParameterEncoding.BYTEWISE
    if capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST:
        return ParameterEncoding.C_CAST
    return otherwise


def to_field(value: float, kind: int, encoding: ParameterEncoding) -> float:
    """Give the number that stands in the message for a value of a MAV_PARAM_TYPE.

    Raises:
        KeyError: if values of that type do not fit the message.
        struct.error, OverflowError, ValueError: if the value does not fit the type.
    """
    layout = _LAYOUTS[kind]
    if kind == mavlink.MAV_PARAM_TYPE_REAL32:
        return _as_float(struct.pack(layout, value))
    packed = struct.pack(layout, round(value))
    return _as_float(packed) if encoding is ParameterEncoding.BYTEWISE else float(round(value))


def from_field(field: float, kind: int, encoding: ParameterEncoding) -> float:
    """Give the value that a number in the message stands for.

    Raises:
        KeyError: if values of that type do not fit the message.
    """
    layout = _LAYOUTS[kind]
    if kind == mavlink.MAV_PARAM_TYPE_REAL32 or encoding is ParameterEncoding.C_CAST:
        return field
    (value,) = struct.unpack(layout, struct.pack("<f", field))
    return float(value)


class ParameterWrite:
    """One parameter on its way to a value; `consent` is asked before the old one goes."""

    def __init__(
        self,
        setting: Setting,
        route: Route,
        round_trip: RoundTrip,
        encoding: ParameterEncoding,
        consent: Callable[[float], Consent] = always,
    ) -> None:
        self._consent = consent
        self._awaits_consent = False
        self._setting = setting
        self._route = route
        self._round_trip = round_trip
        self._encoding = encoding
        self._kind: int | None = None  # None: not read yet
        self._previous = 0.0
        self._attempts = 0
        self._contradictions = 0
        self._sent_at = 0.0
        self._deadline = 0.0
        self.shown: float | None = None  # What it was instead, since it was to be another
        self.outcome: WriteOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Ask for what it is."""
        self._attempts = 0
        return self._send(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take an answer; everything else is ignored."""
        if self.outcome is not None or getattr(message, "param_id", None) != self._setting.name:
            return []
        if message.get_type() == "PARAM_ERROR" and self._route.is_for_us(message):
            why = _ERRORS.get(message.error, f"error {message.error}")
            self._refuse(why)
        elif message.get_type() == "PARAM_VALUE":
            return self._take(message, now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self._awaits_consent:
            return self._write(now)
        if self.outcome is not None or now < self._deadline:
            return []
        if self._attempts >= ATTEMPTS:
            self._refuse(f"no answer after {ATTEMPTS} attempts")
            return []
        return self._send(now)

    def _take(self, message: Message, now: float) -> list[Message]:
        if self._attempts == 1:
            self._round_trip.sample(now - self._sent_at)
        if message.param_type not in _LAYOUTS:
            self._refuse(f"its type {message.param_type} cannot be written")
            return []
        value = from_field(message.param_value, message.param_type, self._encoding)
        if not math.isfinite(value):  # Nobody could give it back
            self._refuse(f"the vehicle has {value}, which is not a number")
            return []
        if self._kind is None:
            return self._begin_writing(message.param_type, value, now)
        return [] if self._awaits_consent else self._compare(value, now)

    def _compare(self, value: float, now: float) -> list[Message]:
        """Hold what the vehicle shows against what it is to have."""
        if self._is_wanted(value):
            self.outcome = Written(self._previous)
            return []
        self._contradictions += 1
        self.shown = value
        if self._contradictions >= CONTRADICTIONS:
            self._refuse(f"the vehicle keeps it at {value:g}")
        elif self._contradictions > 1:
            return self._send(now)
        return []

    def _begin_writing(self, kind: int, value: float, now: float) -> list[Message]:
        self._kind, self._previous, self._attempts = kind, value, 0
        if self._is_wanted(value):
            self.outcome = Written(value)
            return []
        try:
            to_field(self._setting.value, kind, self._encoding)
        except (struct.error, OverflowError, ValueError):
            self._refuse(f"{self._setting.value:g} does not fit its type")
            return []
        return self._write(now)

    def _write(self, now: float) -> list[Message]:
        consent = self._consent(self._previous)
        self._awaits_consent = consent is Consent.AWAITED
        match consent:
            case Consent.GIVEN:
                return self._send(now)
            case Consent.DENIED:
                self.outcome = Left(self._previous)
        return []

    def _is_wanted(self, value: float) -> bool:
        """Whether a value is the wanted one, as far as the type can tell."""
        if self._kind == mavlink.MAV_PARAM_TYPE_REAL32:
            return struct.pack("<f", value) == struct.pack("<f", self._setting.value)
        return value == round(self._setting.value)

    def _send(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        target = self._route.target_system, self._route.target_component
        name = self._setting.name.encode("ascii")
        if self._kind is None:
            return [mavlink.MAVLink_param_request_read_message(*target, name, -1)]
        field = to_field(self._setting.value, self._kind, self._encoding)
        return [mavlink.MAVLink_param_set_message(*target, name, field, self._kind)]

    def _refuse(self, why: str) -> None:
        self.outcome = Refused(f"parameter {self._setting.name}: {why}")


def _as_float(four_bytes: bytes) -> float:
    (field,) = struct.unpack("<f", four_bytes)
    return float(field)
