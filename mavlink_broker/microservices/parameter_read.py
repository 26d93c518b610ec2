"""Reads one parameter by name; a vehicle that lacks it may stay silent, which is an answer too."""

from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.parameter_write import ParameterEncoding, from_field
from mavlink_broker.microservices.round_trip import RoundTrip

ATTEMPTS: Final = 5


@dataclass(frozen=True, slots=True)
class Told:
    """The vehicle has the parameter."""

    value: float


@dataclass(frozen=True, slots=True)
class Lacking:
    """It has none of that name, or does not tell."""


ReadOutcome: TypeAlias = Told | Lacking


class ParameterRead:
    """One PARAM_REQUEST_READ(20), repeated until the value comes or the attempts are spent.

    Without an encoding only a float parameter is understood: it is one on every kind of autopilot.
    """

    def __init__(
        self,
        name: str,
        route: Route,
        round_trip: RoundTrip,
        *,
        encoding: ParameterEncoding | None = None,
        attempts: int = ATTEMPTS,
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
        """The value, once it has come."""
        return self.outcome.value if isinstance(self.outcome, Told) else None

    @property
    def is_over(self) -> bool:
        """Whether nothing more is going to be sent."""
        return self.outcome is not None or self._attempts >= self._most_attempts

    def start(self, now: float) -> list[Message]:
        """Ask for the first time."""
        return self.tick(now)

    def receive(self, message: Message, now: float = 0.0) -> list[Message]:
        """Take the value when it comes, also after it was given up."""
        del now
        if getattr(message, "param_id", None) != self._name:
            return []
        if message.get_type() == "PARAM_ERROR":
            self.outcome = Lacking()
        elif message.get_type() == "PARAM_VALUE":
            self._take(message)
        return []

    def tick(self, now: float) -> list[Message]:
        """Ask, and ask again."""
        if self.outcome is not None or now < self._deadline:
            return []
        if self._attempts >= self._most_attempts:
            self.outcome = Lacking()
            return []
        self._attempts += 1
        self._deadline = now + self._round_trip.timeout_s
        return [
            mavlink.MAVLink_param_request_read_message(
                self._route.target_system,
                self._route.target_component,
                self._name.encode("ascii"),
                -1,
            )
        ]

    def _take(self, message: Message) -> None:
        kind = message.param_type
        if kind == mavlink.MAV_PARAM_TYPE_REAL32:
            self.outcome = Told(message.param_value)
        elif self._encoding is not None:
            try:
                self.outcome = Told(from_field(message.param_value, kind, self._encoding))
            except KeyError:  # A type whose values do not fit the message
                self.outcome = Lacking()
