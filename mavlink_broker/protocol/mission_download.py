"""Reads the mission that a vehicle holds: one request outstanding, each repeated until answered."""

from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.dialect import MISSION_RESULT_NAMES, Message, MissionAck, mavlink
from mavlink_broker.protocol.round_trip import RoundTrip
from mavlink_broker.protocol.route import Route

ATTEMPTS: Final = 10
TRANSFERS: Final = 4
PAUSE_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Downloaded:
    """The items as the vehicle gave them, MISSION_ITEM_INT in order."""

    items: tuple[Message, ...]


@dataclass(frozen=True, slots=True)
class NotDownloaded:
    """The vehicle would not tell."""

    reason: str


DownloadOutcome: TypeAlias = Downloaded | NotDownloaded


class MissionDownload:
    """One mission on its way from one vehicle."""

    def __init__(self, route: Route, round_trip: RoundTrip) -> None:
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
        self._complaint = "no answer"
        self.outcome: DownloadOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Ask for the count."""
        self._transfers += 1
        self._count = None
        self._items = []
        self._attempts = 0
        self._pausing = False
        return self._ask(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take the count, an item or a refusal; everything else is ignored."""
        if self.outcome is not None or self._pausing or not self._is_ours(message):
            return []
        match message.get_type():
            case "MISSION_COUNT" if self._count is None:
                self._count = message.count
                return self._answered(now)
            case "MISSION_ITEM_INT" if self._count and message.seq == len(self._items):
                self._items.append(message)
                return self._answered(now)
            case "MISSION_ACK" if message.type != mavlink.MAV_MISSION_ACCEPTED:
                self._complaint = MISSION_RESULT_NAMES.get(message.type, str(message.type))
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

    def _is_ours(self, message: Message) -> bool:
        return getattr(message, "mission_type", 0) == 0 and self._route.is_for_us(message)

    def _ask(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        if self._count is None:
            return [mavlink.MAVLink_mission_request_list_message(*self._target)]
        return [mavlink.MAVLink_mission_request_int_message(*self._target, len(self._items))]

    def _answered(self, now: float) -> list[Message]:
        if self._attempts == 1:
            self._round_trip.sample(now - self._sent_at)
        self._attempts = 0
        if len(self._items) != self._count:
            return self._ask(now)
        self.outcome = Downloaded(tuple(self._items))
        return [MissionAck(*self._target, mavlink.MAV_MISSION_ACCEPTED)]

    def _pause(self, now: float) -> None:
        if self._transfers >= TRANSFERS:
            self.outcome = NotDownloaded(f"mission could not be read back: {self._complaint}")
            return
        self._pausing = True
        self._deadline = now + PAUSE_S * 2 ** (self._transfers - 1)
