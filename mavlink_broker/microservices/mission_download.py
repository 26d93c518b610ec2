"""Downloads a plan (mission, geofence or rally points) of a vehicle.

One request is outstanding and is repeated until it is answered: many vehicles abort a download at
the first request that they do not expect.
"""

from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import MISSION_RESULT_NAMES, Message, MissionAck, mavlink
from mavlink_broker.microservices.mission_protocol import PLAN_NAMES
from mavlink_broker.microservices.round_trip import RoundTrip

ATTEMPTS: Final = 10
TRANSFERS: Final = 4
PAUSE_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Downloaded:
    """The items as received, in order: MISSION_ITEM_INT, or MISSION_ITEM."""

    items: tuple[Message, ...]


@dataclass(frozen=True, slots=True)
class NotDownloaded:
    """The vehicle has refused, or has not answered."""

    reason: str


DownloadOutcome: TypeAlias = Downloaded | NotDownloaded


class MissionDownload:
    """One download; `as_floats` if the vehicle supports no integer items."""

    def __init__(
        self,
        route: Route,
        round_trip: RoundTrip,
        *,
        mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION,
        as_floats: bool = False,
    ) -> None:
        self._type = mission_type
        self._as_floats = as_floats
        self._route = route
        self._round_trip = round_trip
        self._target = route.target_system, route.target_component
        self._count: int | None = None
        self._items: list[Message] = []
        self._attempts = 0
        self._transfers = 0
        self._sent_at = 0.0
        self._deadline = 0.0
        self._pausing = False
        self._last_error = "no answer"
        self.outcome: DownloadOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Request the count."""
        self._transfers += 1
        self._count = None
        self._items = []
        self._attempts = 0
        self._pausing = False
        return self._ask(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take the count, an item or a refusal; other messages are ignored."""
        if self.outcome is not None or self._pausing or not self._is_for_us(message):
            return []
        match message.get_type():
            case "MISSION_COUNT" if self._count is None:
                self._count = message.count
                return self._answered(now)
            case "MISSION_ITEM_INT" | "MISSION_ITEM" if self._count and message.seq == len(
                self._items
            ):
                self._items.append(message)
                return self._answered(now)
            case "MISSION_ACK" if message.type != mavlink.MAV_MISSION_ACCEPTED:
                self._last_error = MISSION_RESULT_NAMES.get(message.type, str(message.type))
                self._pause(now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        if self._pausing:
            return self.start(now)
        if self._attempts < ATTEMPTS:
            return self._ask(now)
        self._pause(now)
        return []

    def _is_for_us(self, message: Message) -> bool:
        same_type = getattr(message, "mission_type", 0) == self._type
        return same_type and self._route.is_for_us(message)

    def _ask(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        if self._count is None:
            return [mavlink.MAVLink_mission_request_list_message(*self._target, self._type)]
        request = (
            mavlink.MAVLink_mission_request_message
            if self._as_floats
            else mavlink.MAVLink_mission_request_int_message
        )
        return [request(*self._target, len(self._items), self._type)]

    def _answered(self, now: float) -> list[Message]:
        if self._attempts == 1:
            self._round_trip.sample(now - self._sent_at)
        self._attempts = 0
        if len(self._items) != self._count:
            return self._ask(now)
        self.outcome = Downloaded(tuple(self._items))
        return [MissionAck(*self._target, mavlink.MAV_MISSION_ACCEPTED, self._type)]

    def _pause(self, now: float) -> None:
        if self._transfers >= TRANSFERS:
            self.outcome = NotDownloaded(
                f"{PLAN_NAMES[self._type]} could not be read back: {self._last_error}"
            )
            return
        self._pausing = True
        self._deadline = now + PAUSE_S * 2 ** (self._transfers - 1)
