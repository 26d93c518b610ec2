"""MAVLink's parameter protocol: reads and writes one parameter by name.

A parameter is read before it is written: its type gives the encoding, and its old value may have to
be restored. PARAM_SET(23) is repeated until PARAM_VALUE(22) reports the new value. A vehicle that
refuses reports the old value, and some also the reason (PARAM_ERROR); one that lacks the parameter
may stay silent.

Integers are sent in a float field, either as their bits or as their value. A capability in
AUTOPILOT_VERSION shows which (PARAM_ENCODE_BYTEWISE, PARAM_ENCODE_C_CAST); the wrong choice
corrupts them without an error.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, NamedTuple, TypeAlias

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.command import Refused, RoundTrip

WRITE_ATTEMPTS: Final = 6
"""Per request: at 20 % loss each way one in 460 stays unanswered."""
MAX_CONTRADICTIONS: Final = 3
"""Answers with another value before the write fails: one may still answer the read request."""

_LAYOUTS: Final = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<B3x",
    mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_UINT16: "<H2x",
    mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
    mavlink.MAV_PARAM_TYPE_REAL32: "<f",
}
"""Layout of a value of each MAV_PARAM_TYPE in the field's four bytes."""
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
PARAMETER_MESSAGES: Final = frozenset({"PARAM_VALUE", "PARAM_ERROR"})
"""Answers of the parameter protocol."""


class ParameterEncoding(Enum):
    """How a vehicle encodes integers in the float field."""

    BYTEWISE = auto()
    C_CAST = auto()


class Setting(NamedTuple):
    """A parameter and its requested value."""

    name: str
    value: float


class Limit(Setting):
    """A parameter and its largest value: a vehicle whose own is lower keeps that."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Written:
    """The vehicle has the value; `previous` is its value before."""

    previous: float


@dataclass(frozen=True, slots=True)
class NotOverwritten:
    """It was not written, because overwriting its value was denied."""


WriteOutcome: TypeAlias = Written | NotOverwritten | Refused


class Permission(Enum):
    """Whether the value that was read may be overwritten."""

    GRANTED = auto()
    PENDING = auto()
    DENIED = auto()


def always_granted(previous: float) -> Permission:
    """Permit overwriting every value."""
    del previous
    return Permission.GRANTED


def encoding_of(capabilities: int, otherwise: ParameterEncoding) -> ParameterEncoding:
    """Encoding by AUTOPILOT_VERSION.capabilities; `otherwise` if they give none."""
    if capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE:
        return ParameterEncoding.BYTEWISE
    if capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST:
        return ParameterEncoding.C_CAST
    return otherwise


def to_field(value: float, kind: int, encoding: ParameterEncoding) -> float:
    """Encode a value of a MAV_PARAM_TYPE for the message.

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
    """Decode a value of the message.

    Raises:
        KeyError: if values of that type do not fit the message.
    """
    layout = _LAYOUTS[kind]
    if kind == mavlink.MAV_PARAM_TYPE_REAL32 or encoding is ParameterEncoding.C_CAST:
        return field
    (value,) = struct.unpack(layout, struct.pack("<f", field))
    return float(value)


class ParameterWrite:
    """Writes one parameter; `permission` is called with the old value before it is overwritten."""

    def __init__(
        self,
        setting: Setting,
        route: Route,
        round_trip: RoundTrip,
        encoding: ParameterEncoding,
        permission: Callable[[float], Permission] = always_granted,
    ) -> None:
        self._permission = permission
        self._awaits_permission = False
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
        self.reported_value: float | None = None  # Another value, reported after the write
        self.outcome: WriteOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Request its value."""
        self._attempts = 0
        return self._send(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle an answer; other messages are ignored."""
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
        if self._awaits_permission:
            return self._write(now)
        if self.outcome is not None or now < self._deadline:
            return []
        if self._attempts >= WRITE_ATTEMPTS:
            self._refuse(f"no answer after {WRITE_ATTEMPTS} attempts")
            return []
        return self._send(now)

    def _take(self, message: Message, now: float) -> list[Message]:
        if self._attempts == 1:
            self._round_trip.sample(now - self._sent_at)
        if message.param_type not in _LAYOUTS:
            self._refuse(f"its type {message.param_type} cannot be written")
            return []
        value = from_field(message.param_value, message.param_type, self._encoding)
        if not math.isfinite(value):  # It could not be restored
            self._refuse(f"the vehicle has {value}, which is not a number")
            return []
        if self._kind is None:
            return self._start_write(message.param_type, value, now)
        return [] if self._awaits_permission else self._compare(value, now)

    def _compare(self, value: float, now: float) -> list[Message]:
        """Compare the reported value with the requested one."""
        if self._is_wanted(value):
            self.outcome = Written(self._previous)
            return []
        self._contradictions += 1
        self.reported_value = value
        if self._contradictions >= MAX_CONTRADICTIONS:
            self._refuse(f"the vehicle keeps it at {value:g}")
        elif self._contradictions > 1:
            return self._send(now)
        return []

    def _start_write(self, kind: int, value: float, now: float) -> list[Message]:
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
        permission = self._permission(self._previous)
        self._awaits_permission = permission is Permission.PENDING
        match permission:
            case Permission.GRANTED:
                return self._send(now)
            case Permission.DENIED:
                self.outcome = NotOverwritten()
        return []

    def _is_wanted(self, value: float) -> bool:
        """Whether a value is the requested one, within the precision of the type."""
        if self._kind == mavlink.MAV_PARAM_TYPE_REAL32:
            return struct.pack("<f", value) == struct.pack("<f", self._setting.value)
        return value == round(self._setting.value)

    def _send(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        name = self._setting.name.encode("ascii")
        if self._kind is None:
            return [mavlink.MAVLink_param_request_read_message(*self._route.target, name, -1)]
        field = to_field(self._setting.value, self._kind, self._encoding)
        return [mavlink.MAVLink_param_set_message(*self._route.target, name, field, self._kind)]

    def _refuse(self, why: str) -> None:
        self.outcome = Refused(f"parameter {self._setting.name}: {why}")


def _as_float(four_bytes: bytes) -> float:
    (field,) = struct.unpack("<f", four_bytes)
    return float(field)


READ_ATTEMPTS: Final = 5


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """The vehicle has reported the parameter."""

    value: float


@dataclass(frozen=True, slots=True)
class ParameterMissing:
    """The vehicle has no parameter of that name, or has not answered."""


ReadOutcome: TypeAlias = ParameterValue | ParameterMissing


class ParameterRead:
    """One PARAM_REQUEST_READ(20), repeated until it is answered or the attempts are used up.

    Without an encoding only a float parameter is decoded, which is the same for every autopilot.
    """

    def __init__(
        self,
        name: str,
        route: Route,
        round_trip: RoundTrip,
        *,
        encoding: ParameterEncoding | None = None,
        attempts: int = READ_ATTEMPTS,
    ) -> None:
        self._name = name
        self._route = route
        self._round_trip = round_trip
        self._encoding = encoding
        self._most_attempts = attempts
        self._attempts = 0
        self._deadline = 0.0
        self.outcome: ReadOutcome | None = None

    @property
    def value(self) -> float | None:
        """The value, once it is received."""
        return self.outcome.value if isinstance(self.outcome, ParameterValue) else None

    def start(self, now: float) -> list[Message]:
        """Send the first request."""
        return self.tick(now)

    def receive(self, message: Message, now: float = 0.0) -> list[Message]:
        """Handle the value, also after the last timeout."""
        del now
        if getattr(message, "param_id", None) != self._name:
            return []
        if message.get_type() == "PARAM_ERROR":
            self.outcome = ParameterMissing()
        elif message.get_type() == "PARAM_VALUE":
            self._take(message)
        return []

    def tick(self, now: float) -> list[Message]:
        """Send the request, repeat it when it is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        if self._attempts >= self._most_attempts:
            self.outcome = ParameterMissing()
            return []
        self._attempts += 1
        self._deadline = now + self._round_trip.timeout_s
        return [
            mavlink.MAVLink_param_request_read_message(
                *self._route.target, self._name.encode("ascii"), -1
            )
        ]

    def _take(self, message: Message) -> None:
        kind = message.param_type
        if kind == mavlink.MAV_PARAM_TYPE_REAL32:
            self.outcome = ParameterValue(message.param_value)
        elif self._encoding is not None:
            try:
                self.outcome = ParameterValue(from_field(message.param_value, kind, self._encoding))
            except KeyError:  # A type whose values do not fit the message
                self.outcome = ParameterMissing()
