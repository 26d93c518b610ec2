"""Downloads a plan (mission, geofence or rally points) of a vehicle.

One request is outstanding and is repeated until it is answered: many vehicles abort a download at
the first request that they do not expect. PX4 up to 1.14.0 sends the items of a geofence and rally
points as those of a mission; their commands show what they are.

`MissionVerify` verifies before a flight that the vehicle holds the uploaded plan. MISSION_CURRENT
must report the id of the acknowledgement. For vehicles without ids and for uncertain uploads, the
plan is read back and compared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.mavlink.dialect import MISSION_RESULT_NAMES, Message, MissionAck, Route, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.message_rates import request_message
from mavlink_broker.microservices.mission_protocol import (
    ID_NAMES,
    MAX_ITEMS,
    MISSION,
    PLAN_NAMES,
    UNTYPED_COMMANDS,
)

ATTEMPTS: Final = 10
TRANSFERS: Final = 4
PAUSE_S: Final = 1.0
ID_ATTEMPTS: Final = 6
Comparison: TypeAlias = Callable[[Sequence[Message]], str | None]
"""Returns the first difference from the uploaded plan, or None."""


@dataclass(frozen=True, slots=True)
class Downloaded:
    """The items as received, in order: MISSION_ITEM_INT, or MISSION_ITEM."""

    items: tuple[Message, ...]


@dataclass(frozen=True, slots=True)
class NotDownloaded:
    """The vehicle has refused, has not answered, or holds more than `MAX_ITEMS`."""

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
        """Handle the count, an item or a refusal; other messages are ignored."""
        if self.outcome is not None or self._pausing or not self._is_for_us(message):
            return []
        match message.get_type():
            case "MISSION_COUNT" if self._count is None and message.count > MAX_ITEMS:
                self._fail(f"it has {message.count} items, limit {MAX_ITEMS}")
                cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
                return [MissionAck(*self._route.target, cancelled, self._type)]
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
        kind = getattr(message, "mission_type", MISSION)
        is_untyped = (
            kind == MISSION
            and message.get_type() in {"MISSION_ITEM_INT", "MISSION_ITEM"}
            and message.command in UNTYPED_COMMANDS.get(self._type, ())
        )
        return (kind == self._type or is_untyped) and self._route.is_for_us(message)

    def _ask(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        if self._count is None:
            return [mavlink.MAVLink_mission_request_list_message(*self._route.target, self._type)]
        request = (
            mavlink.MAVLink_mission_request_message
            if self._as_floats
            else mavlink.MAVLink_mission_request_int_message
        )
        return [request(*self._route.target, len(self._items), self._type)]

    def _answered(self, now: float) -> list[Message]:
        if self._attempts == 1:
            self._round_trip.sample(now - self._sent_at)
        self._attempts = 0
        if len(self._items) != self._count:
            return self._ask(now)
        self.outcome = Downloaded(tuple(self._items))
        return [MissionAck(*self._route.target, mavlink.MAV_MISSION_ACCEPTED, self._type)]

    def _pause(self, now: float) -> None:
        if self._transfers >= TRANSFERS:
            self._fail(self._last_error)
            return
        self._pausing = True
        self._deadline = now + PAUSE_S * 2 ** (self._transfers - 1)

    def _fail(self, reason: str) -> None:
        self.outcome = NotDownloaded(f"{PLAN_NAMES[self._type]} could not be read back: {reason}")


@dataclass(frozen=True, slots=True)
class Verified:
    """The vehicle holds exactly the uploaded plan."""


@dataclass(frozen=True, slots=True)
class Different:
    """The vehicle holds another plan, of so many items; None: it could not be read."""

    reason: str
    count: int | None = None


class ReadBackFailed(Different):
    """The plan could not be read back; the link may be lost."""


VerifyOutcome: TypeAlias = Verified | Different


class MissionVerify:
    """One verification; `opaque_id` is that of the acknowledgement, 0 without one."""

    def __init__(
        self,
        opaque_id: int,
        difference: Comparison,
        route: Route,
        round_trip: RoundTrip,
        *,
        mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION,
        as_floats: bool = False,
    ) -> None:
        self._type = mission_type
        self._as_floats = as_floats
        self._opaque_id = opaque_id
        self._difference = difference
        self._route = route
        self._round_trip = round_trip
        self._attempts = 0
        self._deadline = 0.0
        self._download: MissionDownload | None = None
        self.outcome: VerifyOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Request the id, or the items if there is no id."""
        return self._request_id(now) if self._opaque_id else self._read_back(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the mission protocol."""
        if self.outcome is not None:
            return []
        if self._download is not None:
            return [*self._download.receive(message, now), *self._compare()]
        is_current = message.get_type() == "MISSION_CURRENT"
        if is_current and getattr(message, ID_NAMES[self._type]) == self._opaque_id:
            self.outcome = Verified()
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue; without the right id the plan is read back."""
        if self.outcome is not None:
            return []
        if self._download is not None:
            return [*self._download.tick(now), *self._compare()]
        if now < self._deadline:
            return []
        return self._request_id(now) if self._attempts < ID_ATTEMPTS else self._read_back(now)

    def _request_id(self, now: float) -> list[Message]:
        self._attempts += 1
        self._deadline = now + self._round_trip.timeout_s
        return [request_message(self._route, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)]

    def _read_back(self, now: float) -> list[Message]:
        self._download = MissionDownload(
            self._route, self._round_trip, mission_type=self._type, as_floats=self._as_floats
        )
        return self._download.start(now)

    def _compare(self) -> list[Message]:
        match self._download.outcome if self._download else None:
            case Downloaded(items):
                difference = self._difference(items)
                self.outcome = Different(difference, len(items)) if difference else Verified()
            case NotDownloaded(reason):
                self.outcome = ReadBackFailed(reason)
            case _:
                pass
        return []
