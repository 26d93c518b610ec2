"""Uploads a plan (mission, geofence or rally points) over a link that loses and repeats.

The broker announces the count, the vehicle requests the items and acknowledges. Requests are
answered any number of times, but for copies that a link makes of one. Recovery from losses:

    count or first request lost   the count is repeated
    request or item lost          the vehicle repeats its request
    final acknowledgement lost    the last item is repeated, and the vehicle repeats the answer
    transfer aborted or refused as busy   a new transfer starts, after a pause that doubles

A busy vehicle may be taking a plan of another system: the caller may want to read what it holds
then, before it replaces that (`NotBegun`).

A transfer continues as long as the vehicle requests items. It has failed when the vehicle is
silent, or requests the same item more often than losses explain.

An acknowledgement counts only after every item was requested. The caller then verifies what the
vehicle holds.

`MissionClear` clears a plan and waits for the answer.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, TypeAlias

from mavlink_broker.mavlink.dialect import (
    MISSION_RESULT_NAMES,
    Message,
    MissionCount,
    Route,
    mavlink,
)
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_protocol import PLAN_NAMES, to_float_item

COUNT_ATTEMPTS: Final = 8
LAST_ITEM_ATTEMPTS: Final = 6
TRANSFERS: Final = 4
STALLED_AFTER_S: Final = 5.0
MOST_REPETITIONS: Final = 60
"""Repetitions of one request; more than a loss of 30 % in each direction causes."""
FIRST_PAUSE_S: Final = 1.0
_REQUESTS: Final = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT"})
_BUSY: Final = frozenset({mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_DENIED})
_TRANSIENT: Final = frozenset({mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_INVALID_SEQUENCE})
"""Answers of some vehicles to a repeated item although the transfer continues or is complete."""
_UNSUPPORTED: Final = frozenset(
    {
        mavlink.MAV_MISSION_UNSUPPORTED,
        mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
        mavlink.MAV_MISSION_INVALID,
        *range(mavlink.MAV_MISSION_INVALID_PARAM1, mavlink.MAV_MISSION_INVALID_PARAM7 + 1),
    }
)
"""Answers to an item whose command or parameters the vehicle does not support."""
COPY_WITHIN_S: Final = 0.005
"""A request that follows sooner is a copy of the network: also a fast simulated vehicle waits
longer."""
CLEAR_ATTEMPTS: Final = 10


@dataclass(frozen=True, slots=True)
class Stored:
    """The vehicle has acknowledged the plan with this id; 0 if it has none."""

    opaque_id: int


@dataclass(frozen=True, slots=True)
class Uncertain:
    """Every item was sent and the acknowledgement is missing: the plan must be read back."""


@dataclass(frozen=True, slots=True)
class NotStored:
    """The vehicle has refused the plan or has not answered; `item` is the last one requested."""

    reason: str
    item: int | None = None
    is_unsupported: bool = False  # It does not support such an item or its parameters
    is_too_long: bool = False  # It has no space for so many items


@dataclass(frozen=True, slots=True)
class NotBegun:
    """The vehicle is busy, perhaps with a plan of another system, and has taken no item."""

    reason: str


UploadOutcome: TypeAlias = Stored | Uncertain | NotStored | NotBegun


class _Phase(Enum):
    COUNTING = auto()  # Count sent, no request yet
    SENDING = auto()  # Items are being requested
    CLOSING = auto()  # Every item was requested, no acknowledgement yet
    PAUSING = auto()  # Waits before the next transfer


class MissionUpload:
    """One upload to one vehicle."""

    def __init__(
        self,
        items: Sequence[Message],
        route: Route,
        round_trip: RoundTrip,
        *,
        busy_pause_s: float,
        mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION,
        as_floats: bool = False,
        yields: bool = False,
    ) -> None:
        """Prepare an upload.

        Args:
            items: MISSION_ITEM_INT messages in order, of that mission type.
            route: Source and target ids.
            round_trip: Estimate of the link's round trip.
            busy_pause_s: Pause [s] after the vehicle has answered that it is busy.
            mission_type: MAV_MISSION_TYPE.
            as_floats: The vehicle supports no integer items: MISSION_REQUEST(40) is answered by
                MISSION_ITEM(39).
            yields: A vehicle that is busy ends it, unless it has taken items (`NotBegun`).
        """
        self._items = items
        self._type = mission_type
        self._as_floats = as_floats
        self._route = route
        self._round_trip = round_trip
        self._busy_pause_s = busy_pause_s
        self._yields = yields
        self._phase = _Phase.PAUSING
        self._transfers = 0
        self._attempts = 0
        self._deadline = 0.0
        self._sent_at = 0.0
        self._requested: set[int] = set()
        self._answered_at = -math.inf  # When the item that was requested last was sent last
        self._last_requested: int | None = None
        self._repetitions = 0
        self._last_error = "no answer to MISSION_COUNT"
        self._is_refused_by_vehicle = False  # The complaint is the vehicle's own
        self.outcome: UploadOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Announce the count."""
        self._transfers += 1
        self._attempts = 0
        self._requested.clear()
        self._last_requested = None
        self._is_refused_by_vehicle = False
        self._phase = _Phase.COUNTING
        return self._count(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a request or an acknowledgement; other messages are ignored."""
        if self.outcome is not None or not self._is_for_us(message):
            return []
        if message.get_type() in _REQUESTS:
            wants_float = self._as_floats and message.get_type() == "MISSION_REQUEST"
            return [to_float_item(i) if wants_float else i for i in self._answer(message.seq, now)]
        if message.get_type() == "MISSION_ACK":
            self._acknowledged(message, now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat or restart what is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        match self._phase:
            case _Phase.COUNTING:
                return self._repeat_count(now)
            case _Phase.SENDING:
                if not self._is_refused_by_vehicle:
                    self._last_error = f"item {self._last_requested} was the last one requested"
                self._pause(FIRST_PAUSE_S * 2 ** (self._transfers - 1), now)
                return []
            case _Phase.CLOSING:
                return self._repeat_last_item(now)
            case _Phase.PAUSING:
                return self.start(now)

    def _is_for_us(self, message: Message) -> bool:
        same_type = getattr(message, "mission_type", 0) == self._type
        return same_type and self._route.is_for_us(message)

    def _count(self, now: float) -> list[Message]:
        self._attempts += 1
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        return [MissionCount(*self._route.target, len(self._items), self._type)]

    def _repeat_count(self, now: float) -> list[Message]:
        if self._attempts < COUNT_ATTEMPTS:
            return self._count(now)
        self._pause(FIRST_PAUSE_S * 2 ** (self._transfers - 1), now)
        return []

    def _answer(self, seq: int, now: float) -> list[Message]:
        """Return the requested item, as often as the vehicle repeats its request.

        One that a link has doubled is answered once: where each copy of an item leads to a request,
        and each copy of a request to an item, their number would grow from item to item.
        """
        is_copy = seq == self._last_requested and now - self._answered_at < COPY_WITHIN_S
        if seq >= len(self._items) or is_copy:
            return []
        self._answered_at = now
        self._yields = False
        if self._phase is _Phase.PAUSING and seq in self._requested:
            return [self._items[seq]]  # No progress: the transfer restarts nevertheless
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
        self._last_error = MISSION_RESULT_NAMES.get(result, f"MAV_MISSION_RESULT {result}")
        self._is_refused_by_vehicle = True
        if self._phase is _Phase.PAUSING:
            return
        if result == mavlink.MAV_MISSION_OPERATION_CANCELLED:
            self._pause(FIRST_PAUSE_S, now)
        elif self._phase is _Phase.COUNTING and result in _BUSY:
            if self._yields:
                self.outcome = NotBegun(f"{PLAN_NAMES[self._type]} refused: {self._last_error}")
            else:
                self._pause(self._busy_pause_s, now)
        elif complete and self._attempts > 1 and result in _TRANSIENT:
            self.outcome = Uncertain()
        elif result not in _TRANSIENT:
            is_too_long = result == mavlink.MAV_MISSION_NO_SPACE
            size = f" for {len(self._items)} items" if is_too_long else ""
            self.outcome = NotStored(
                f"{PLAN_NAMES[self._type]} refused: {self._last_error}{size}",
                self._last_requested,
                is_unsupported=result in _UNSUPPORTED,
                is_too_long=is_too_long,
            )

    def _pause(self, seconds: float, now: float) -> None:
        if self._transfers >= TRANSFERS:
            self.outcome = NotStored(
                f"{PLAN_NAMES[self._type]} upload failed {TRANSFERS} times: {self._last_error}",
                self._last_requested,
            )
            return
        self._phase = _Phase.PAUSING
        self._deadline = now + seconds


@dataclass(frozen=True, slots=True)
class Cleared:
    """The vehicle has confirmed that it holds none."""


@dataclass(frozen=True, slots=True)
class NotCleared:
    """The vehicle has refused, or has not answered."""

    reason: str


ClearOutcome: TypeAlias = Cleared | NotCleared | NotBegun


class MissionClear:
    """One MISSION_CLEAR_ALL(45), repeated until it is acknowledged."""

    def __init__(self, route: Route, round_trip: RoundTrip, *, mission_type: int) -> None:
        self._route = route
        self._round_trip = round_trip
        self._type = mission_type
        self._attempts = 0
        self._deadline = 0.0
        self.outcome: ClearOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Send the request."""
        self._attempts += 1
        self._deadline = now + self._round_trip.timeout_s
        return [mavlink.MAVLink_mission_clear_all_message(*self._route.target, self._type)]

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle the acknowledgement."""
        del now
        if self.outcome is not None or not self._is_answer(message):
            return []
        if message.type == mavlink.MAV_MISSION_ACCEPTED:
            self.outcome = Cleared()
        else:
            reason = self._failure(MISSION_RESULT_NAMES.get(message.type, str(message.type)))
            is_busy = message.type in _BUSY
            self.outcome = NotBegun(reason) if is_busy else NotCleared(reason)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        if self._attempts >= CLEAR_ATTEMPTS:
            self.outcome = NotCleared(self._failure("no answer"))
            return []
        return self.start(now)

    def _is_answer(self, message: Message) -> bool:
        return (
            message.get_type() == "MISSION_ACK"
            and getattr(message, "mission_type", 0) == self._type
            and self._route.is_for_us(message)
        )

    def _failure(self, why: str) -> str:
        return f"{PLAN_NAMES[self._type]} could not be removed: {why}"
