"""Puts a plan (mission, fence, rally points) onto a vehicle over a link that loses and repeats.

The vehicle leads: we announce the count, it requests items, it acknowledges. Requests are
answered statelessly, any number of times. What heals which loss:

    count or first request lost   the count is repeated
    request or item lost          the vehicle requests again; nothing is sent unasked
    final acknowledgement lost    the last item is repeated, which makes the vehicle repeat it
    transfer given up or refused as busy   begun again, after a pause that doubles

A vehicle that goes on asking is alive, however often it asks for the same item; one that is
silent, or asks for one item without end, has given up.

An acknowledgement counts only after every item was requested. Even then the outcome is no more
than a claim: the caller verifies what the vehicle holds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import MISSION_RESULT_NAMES, Message, MissionCount, mavlink
from mavlink_broker.microservices.float_items import in_floats
from mavlink_broker.microservices.plan_kinds import PLAN_NAMES
from mavlink_broker.microservices.round_trip import RoundTrip

COUNT_ATTEMPTS: Final = 8
LAST_ITEM_ATTEMPTS: Final = 6
TRANSFERS: Final = 4
STALLED_AFTER_S: Final = 5.0
MOST_REPETITIONS: Final = 60
"""Of one request: at 30 % loss each way nobody asks so often who can hear the answer."""
FIRST_PAUSE_S: Final = 1.0

_REQUESTS: Final = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT"})
_BUSY: Final = frozenset({mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_DENIED})
_TRANSIENT: Final = frozenset({mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_INVALID_SEQUENCE})
"""What some vehicles answer to a repeated item although the transfer goes on, or is complete."""
_UNSUPPORTED: Final = frozenset(
    {
        mavlink.MAV_MISSION_UNSUPPORTED,
        mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
        mavlink.MAV_MISSION_INVALID,
        *range(mavlink.MAV_MISSION_INVALID_PARAM1, mavlink.MAV_MISSION_INVALID_PARAM7 + 1),
    }
)
"""What a vehicle answers to a command that it does not know as an item, or not so."""


@dataclass(frozen=True, slots=True)
class Stored:
    """The vehicle says that it holds the mission, under this id (0: it gives none)."""

    opaque_id: int


@dataclass(frozen=True, slots=True)
class Uncertain:
    """Every item was sent and the final word is missing: only reading back can tell."""


@dataclass(frozen=True, slots=True)
class NotStored:
    """The vehicle refused the mission, at this item as far as one can tell, or was not there."""

    reason: str
    item: int | None = None
    is_unsupported: bool = False  # It knows no such item, or not with such parameters
    is_too_long: bool = False  # It has no space for so many items


UploadOutcome: TypeAlias = Stored | Uncertain | NotStored


class _Phase(Enum):
    COUNTING = auto()  # Announced, no request yet
    SENDING = auto()  # Items are being requested
    CLOSING = auto()  # Every item was requested, no acknowledgement yet
    PAUSING = auto()  # Waiting to begin again


class MissionUpload:
    """One mission on its way to one vehicle."""

    def __init__(
        self,
        items: Sequence[Message],
        route: Route,
        round_trip: RoundTrip,
        *,
        busy_pause_s: float,
        mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION,
        as_floats: bool = False,
    ) -> None:
        """Begin with nothing sent.

        Args:
            items: MISSION_ITEM_INT messages in order, of that mission type.
            route: From whom to whom.
            round_trip: Estimate of the link.
            busy_pause_s: Pause [s] after the vehicle has said that it is busy.
            mission_type: MAV_MISSION_TYPE.
            as_floats: The vehicle knows no integer items: what it asks for by MISSION_REQUEST(40)
                it gets as MISSION_ITEM(39).
        """
        self._items = items
        self._type = mission_type
        self._as_floats = as_floats
        self._route = route
        self._round_trip = round_trip
        self._busy_pause_s = busy_pause_s
        self._phase = _Phase.PAUSING
        self._transfers = 0
        self._attempts = 0
        self._deadline = 0.0
        self._sent_at = 0.0
        self._requested: set[int] = set()
        self._last_requested: int | None = None
        self._repetitions = 0
        self._complaint = "no answer to MISSION_COUNT"
        self._refused = False  # The complaint is the vehicle's own
        self.outcome: UploadOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Announce the mission."""
        self._transfers += 1
        self._attempts = 0
        self._requested.clear()
        self._last_requested = None
        self._refused = False
        self._phase = _Phase.COUNTING
        return self._count(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a request or an acknowledgement; everything else is ignored."""
        if self.outcome is not None or not self._is_ours(message):
            return []
        if message.get_type() in _REQUESTS:
            wants_float = self._as_floats and message.get_type() == "MISSION_REQUEST"
            return [in_floats(i) if wants_float else i for i in self._answer(message.seq, now)]
        if message.get_type() == "MISSION_ACK":
            self._acknowledged(message, now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat or begin again what is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        match self._phase:
            case _Phase.COUNTING:
                return self._repeat_count(now)
            case _Phase.SENDING:
                if not self._refused:
                    self._complaint = f"item {self._last_requested} was the last one requested"
                self._pause(FIRST_PAUSE_S * 2 ** (self._transfers - 1), now)
                return []
            case _Phase.CLOSING:
                return self._repeat_last_item(now)
            case _Phase.PAUSING:
                return self.start(now)

    def _is_ours(self, message: Message) -> bool:
        same_type = getattr(message, "mission_type", 0) == self._type
        return same_type and self._route.is_for_us(message)

    def _count(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        target = self._route.target_system, self._route.target_component
        return [MissionCount(*target, len(self._items), self._type)]

    def _repeat_count(self, now: float) -> list[Message]:
        if self._attempts < COUNT_ATTEMPTS:
            return self._count(now)
        self._pause(FIRST_PAUSE_S * 2 ** (self._transfers - 1), now)
        return []

    def _answer(self, seq: int, now: float) -> list[Message]:
        """Give the item that was asked for, any number of times."""
        if seq >= len(self._items):
            return []
        if self._phase is _Phase.PAUSING and seq in self._requested:
            return [self._items[seq]]  # No progress: it is begun again all the same
        if seq not in self._requested:
            self._sample(now)
            self._requested.add(seq)
            self._sent_at = now
            self._attempts = 1
            self._repetitions = 0
        self._last_requested = seq
        self._repetitions += 1
        complete = len(self._requested) == len(self._items)
        self._phase = _Phase.CLOSING if complete else _Phase.SENDING
        if self._repetitions <= MOST_REPETITIONS:
            self._deadline = now + (self._closing_timeout_s if complete else STALLED_AFTER_S)
        return [self._items[seq]]

    def _sample(self, now: float) -> None:
        if self._attempts == 1 and self._phase in {_Phase.COUNTING, _Phase.SENDING}:
            self._round_trip.sample(now - self._sent_at)

    @property
    def _closing_timeout_s(self) -> float:
        return min(3.0, 3 * self._round_trip.timeout_s)

    def _repeat_last_item(self, now: float) -> list[Message]:
        if self._attempts >= LAST_ITEM_ATTEMPTS:
            self.outcome = Uncertain()
            return []
        self._attempts += 1
        self._deadline = now + self._closing_timeout_s
        return [self._items[-1]]

    def _acknowledged(self, message: Message, now: float) -> None:
        result = message.type
        complete = self._phase is _Phase.CLOSING
        if result == mavlink.MAV_MISSION_ACCEPTED:
            if complete:
                self.outcome = Stored(getattr(message, "opaque_id", 0))
            return
        self._complaint = MISSION_RESULT_NAMES.get(result, f"MAV_MISSION_RESULT {result}")
        self._refused = True
        if self._phase is _Phase.PAUSING:
            return
        if result == mavlink.MAV_MISSION_OPERATION_CANCELLED:
            self._pause(FIRST_PAUSE_S, now)
        elif self._phase is _Phase.COUNTING and result in _BUSY:
            self._pause(self._busy_pause_s, now)
        elif complete and self._attempts > 1 and result in _TRANSIENT:
            self.outcome = Uncertain()
        elif result not in _TRANSIENT:
            is_too_long = result == mavlink.MAV_MISSION_NO_SPACE
            size = f" for {len(self._items)} items" if is_too_long else ""
            self.outcome = NotStored(
                f"{PLAN_NAMES[self._type]} refused: {self._complaint}{size}",
                self._last_requested,
                is_unsupported=result in _UNSUPPORTED,
                is_too_long=is_too_long,
            )

    def _pause(self, seconds: float, now: float) -> None:
        if self._transfers >= TRANSFERS:
            self.outcome = NotStored(
                f"{PLAN_NAMES[self._type]} upload failed {TRANSFERS} times: {self._complaint}",
                self._last_requested,
            )
            return
        self._phase = _Phase.PAUSING
        self._deadline = now + seconds
