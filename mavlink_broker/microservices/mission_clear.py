"""Clears a plan (mission, geofence or rally points) of a vehicle and waits for its answer."""

from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import MISSION_RESULT_NAMES, Message, mavlink
from mavlink_broker.microservices.mission_protocol import PLAN_NAMES
from mavlink_broker.microservices.round_trip import RoundTrip

ATTEMPTS: Final = 10
REFUSALS: Final = 4
_BUSY: Final = frozenset({mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_DENIED})


@dataclass(frozen=True, slots=True)
class Cleared:
    """The vehicle has confirmed that it holds none."""


@dataclass(frozen=True, slots=True)
class NotCleared:
    """The vehicle has refused, or has not answered."""

    reason: str


ClearOutcome: TypeAlias = Cleared | NotCleared


class MissionClear:
    """One MISSION_CLEAR_ALL(45), repeated until it is acknowledged."""

    def __init__(
        self, route: Route, round_trip: RoundTrip, *, mission_type: int, busy_pause_s: float
    ) -> None:
        self._route = route
        self._round_trip = round_trip
        self._type = mission_type
        self._busy_pause_s = busy_pause_s
        self._attempts = 0
        self._refusals = 0
        self._deadline = 0.0
        self._pausing = False
        self.outcome: ClearOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Send the request."""
        self._attempts += 1
        self._pausing = False
        self._deadline = now + self._round_trip.timeout_s
        target = self._route.target_system, self._route.target_component
        return [mavlink.MAVLink_mission_clear_all_message(*target, self._type)]

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take the acknowledgement; a busy vehicle is retried."""
        if self.outcome is not None or self._pausing or not self._is_answer(message):
            return []
        if message.type == mavlink.MAV_MISSION_ACCEPTED:
            self.outcome = Cleared()
            return []
        self._refusals += 1
        if message.type in _BUSY and self._refusals < REFUSALS:
            self._pausing, self._attempts = True, 0
            self._deadline = now + self._busy_pause_s
        else:
            self._fail(MISSION_RESULT_NAMES.get(message.type, str(message.type)))
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        if self._attempts >= ATTEMPTS:
            self._fail("no answer")
            return []
        return self.start(now)

    def _is_answer(self, message: Message) -> bool:
        return (
            message.get_type() == "MISSION_ACK"
            and getattr(message, "mission_type", 0) == self._type
            and self._route.is_for_us(message)
        )

    def _fail(self, why: str) -> None:
        self.outcome = NotCleared(f"{PLAN_NAMES[self._type]} could not be removed: {why}")
