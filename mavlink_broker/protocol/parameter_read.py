"""Reads one parameter by name; a vehicle that lacks it may stay silent, which is an answer too."""

from typing import Final

from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.round_trip import RoundTrip
from mavlink_broker.protocol.route import Route

ATTEMPTS: Final = 5


class ParameterRead:
    """One PARAM_REQUEST_READ(20), repeated until the value comes or the attempts are spent."""

    def __init__(self, name: str, route: Route, round_trip: RoundTrip) -> None:
        self._name = name
        self._route = route
        self._round_trip = round_trip
        self._attempts = 0
        self._deadline = 0.0
        self._refused = False
        self.value: float | None = None

    @property
    def is_over(self) -> bool:
        """Whether nothing more is going to be sent."""
        return self.value is not None or self._refused or self._attempts >= ATTEMPTS

    def receive(self, message: Message) -> None:
        """Take the value when it comes; a float parameter is one on every kind of autopilot."""
        if message.get_type() == "PARAM_ERROR" and message.param_id == self._name:
            self._refused = True
        elif (
            message.get_type() == "PARAM_VALUE"
            and message.param_id == self._name
            and message.param_type == mavlink.MAV_PARAM_TYPE_REAL32
        ):
            self.value = message.param_value

    def tick(self, now: float) -> list[Message]:
        """Ask, and ask again."""
        if self.is_over or now < self._deadline:
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
