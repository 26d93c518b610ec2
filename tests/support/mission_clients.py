"""How ground stations transfer a plan: models of three, sans-IO, each as its documents have it.

    client = QgcUpload(items)
    messages = client.start(now_s)
    messages = client.receive(message, now_s)      # for each message of the vehicle
    messages = client.tick(now_s)               # periodically
    client.outcome                          # None while it is busy, then DONE or a sentence

What they have in common is little: QGroundControl repeats MISSION_COUNT until the first request
and then lives from the vehicle's requests, each within 1.5 s; MAVSDK waits 0.5 s five times and
counts every repeated request as one of them; MAVProxy announces once, answers for as long as
requests come within 10 s, and believes that it has finished when it has sent the last item. The
fourth, the persistent one, does all that the specification allows against loss.
"""

from collections.abc import Sequence
from typing import Any, Final, Protocol

from pymavlink.dialects.v20 import common

Message = Any
DONE: Final = "done"
ACCEPTED: Final[int] = common.MAV_MISSION_ACCEPTED
VEHICLE: Final = (1, 1)
_REQUESTS: Final = frozenset({"MISSION_REQUEST_INT", "MISSION_REQUEST"})


class Client(Protocol):
    """One transfer by one ground station."""

    outcome: str | None

    def start(self, now_s: float) -> list[Message]:
        """Begin."""

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Process a message of the vehicle."""

    def tick(self, now_s: float) -> list[Message]:
        """Do what is due."""


class Download(Client, Protocol):
    """A transfer that fetches a plan."""

    items: dict[int, Message]


def count_of(items: Sequence[Message]) -> Message:
    """MISSION_COUNT of a plan."""
    return common.MAVLink_mission_count_message(*VEHICLE, len(items), items[0].mission_type)


def list_request(mission_type: int) -> Message:
    """MISSION_REQUEST_LIST."""
    return common.MAVLink_mission_request_list_message(*VEHICLE, mission_type)


def item_request(seq: int, mission_type: int) -> Message:
    """MISSION_REQUEST_INT."""
    return common.MAVLink_mission_request_int_message(*VEHICLE, seq, mission_type)


def final_ack(mission_type: int) -> Message:
    """MISSION_ACK of a client that has all items."""
    return common.MAVLink_mission_ack_message(*VEHICLE, ACCEPTED, mission_type)


class QgcUpload:
    """QGroundControl's PlanManager writing: 1.5 s for each answer, 5 repetitions of the count."""

    TIMEOUT_S: Final = 1.5
    RETRIES: Final = 5

    def __init__(self, items: Sequence[Message]) -> None:
        self._items = items
        self._unrequested = set(range(len(items)))
        self._counts = 0
        self._deadline_s = 0.0
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Announce the plan."""
        self._counts += 1
        self._deadline_s = now_s + self.TIMEOUT_S
        return [count_of(self._items)]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Answer each request, again and again; an ACK ends it."""
        if self.outcome is not None or message.mission_type != self._items[0].mission_type:
            return []
        if message.get_type() in _REQUESTS:
            self._deadline_s = now_s + self.TIMEOUT_S
            self._unrequested.discard(message.seq)
            return [self._items[message.seq]]
        if message.get_type() == "MISSION_ACK":
            if message.type != ACCEPTED:
                self.outcome = f"vehicle: {message.type}"
            else:
                self.outcome = "requests missing" if self._unrequested else DONE
        return []

    def tick(self, now_s: float) -> list[Message]:
        """Announce again before the first request; later a silence is the end."""
        if self.outcome is not None or now_s < self._deadline_s:
            return []
        if len(self._unrequested) == len(self._items) and self._counts <= self.RETRIES:
            return self.start(now_s)
        self.outcome = "vehicle did not request all items, or sent no final ack"
        return []


class QgcDownload:
    """QGroundControl's PlanManager reading: one request outstanding, repeated after 250 ms."""

    LIST_TIMEOUT_S: Final = 1.5
    ITEM_TIMEOUT_S: Final = 0.25
    RETRIES: Final = 5

    def __init__(self, mission_type: int = 0) -> None:
        self._type = mission_type
        self._count: int | None = None
        self._attempts = 0
        self._deadline_s = 0.0
        self.items: dict[int, Message] = {}
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Ask for the number of items."""
        self._attempts += 1
        self._deadline_s = now_s + self.LIST_TIMEOUT_S
        return [list_request(self._type)]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Take the count or an item, whichever it is."""
        if self.outcome is not None or message.mission_type != self._type:
            return []
        if message.get_type() == "MISSION_COUNT" and self._count is None:
            self._count = message.count
        elif message.get_type() == "MISSION_ITEM_INT" and self._count is not None:
            if message.seq in self.items:
                return []
            self.items[message.seq] = message
        else:
            return []
        self._attempts = 0
        if len(self.items) == self._count:
            self.outcome = DONE
            return [final_ack(self._type)]
        return self._request(now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Ask again, so many times."""
        if self.outcome is not None or now_s < self._deadline_s:
            return []
        if self._attempts > self.RETRIES:
            self.outcome = "no answer"
            return []
        return self.start(now_s) if self._count is None else self._request(now_s)

    def _request(self, now_s: float) -> list[Message]:
        self._attempts += 1
        self._deadline_s = now_s + self.ITEM_TIMEOUT_S
        missing = next(seq for seq in range(self._count or 0) if seq not in self.items)
        return [item_request(missing, self._type)]


class MavsdkUpload:
    """MAVSDK's transfer: half a second five times; repeats the count, no item without request.

    A repeated request uses up one of the five; an ACK of whatever plan is taken as its own.
    """

    TIMEOUT_S: Final = 0.5
    RETRIES: Final = 5

    def __init__(self, items: Sequence[Message]) -> None:
        self._items = items
        self._next = 0
        self._retries = 0
        self._deadline_s = 0.0
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Announce the plan."""
        self._deadline_s = now_s + self.TIMEOUT_S
        return [count_of(self._items)]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Answer the next request, or one that has been answered before."""
        if self.outcome is not None:
            return []
        if message.get_type() == "MISSION_ACK":
            complete = self._next == len(self._items)
            accepted = message.type == ACCEPTED
            self.outcome = DONE if accepted and complete else f"vehicle: {message.type}"
            return []
        if message.get_type() != "MISSION_REQUEST_INT" or message.seq > self._next:
            return []
        self._deadline_s = now_s + self.TIMEOUT_S
        if message.seq < self._next:
            if self._retries >= self.RETRIES:
                self.outcome = "timeout"
                return []
            self._retries += 1
        else:
            self._next += 1
            self._retries = 0
        return [self._items[message.seq]]

    def tick(self, now_s: float) -> list[Message]:
        """Wait again, five times."""
        if self.outcome is not None or now_s < self._deadline_s:
            return []
        if self._retries >= self.RETRIES:
            self.outcome = "timeout"
            return []
        self._retries += 1
        self._deadline_s = now_s + self.TIMEOUT_S
        return [count_of(self._items)] if self._next == 0 else []


class MavsdkDownload:
    """MAVSDK's transfer: one request outstanding, each repeated five times after half a second."""

    TIMEOUT_S: Final = 0.5
    RETRIES: Final = 5

    def __init__(self, mission_type: int = 0) -> None:
        self._type = mission_type
        self._count: int | None = None
        self._retries = 0
        self._deadline_s = 0.0
        self.items: dict[int, Message] = {}
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Ask for the number of items."""
        return self._request(now_s)

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Take the count once and the items in their order."""
        if self.outcome is not None or message.mission_type != self._type:
            return []
        if message.get_type() == "MISSION_COUNT" and self._count is None:
            self._count = message.count
        elif message.get_type() == "MISSION_ITEM_INT" and message.seq == len(self.items):
            self.items[message.seq] = message
        else:
            return []
        self._retries = 0
        if len(self.items) == self._count:
            self.outcome = DONE
            return [final_ack(self._type)]
        return self._request(now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Ask again, five times."""
        if self.outcome is not None or now_s < self._deadline_s:
            return []
        if self._retries >= self.RETRIES:
            self.outcome = "timeout"
            return []
        self._retries += 1
        return self._request(now_s)

    def _request(self, now_s: float) -> list[Message]:
        self._deadline_s = now_s + self.TIMEOUT_S
        if self._count is None:
            return [list_request(self._type)]
        return [item_request(len(self.items), self._type)]


class MavproxyUpload:
    """MAVProxy's loader: announces once and leaves the rest to the vehicle for 10 s at a time."""

    PATIENCE_S: Final = 10.0

    def __init__(self, items: Sequence[Message]) -> None:
        self._items = items
        self._received_s = 0.0
        self._loading = True
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Announce the plan."""
        self._received_s = now_s
        return [count_of(self._items)]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Answer requests until the last item has been requested; then only an ACK counts."""
        if self.outcome is not None or message.mission_type != self._items[0].mission_type:
            return []
        if message.get_type() == "MISSION_ACK":
            accepted = message.type == ACCEPTED
            self.outcome = DONE if accepted else f"vehicle: {message.type}"
            return []
        if message.get_type() not in _REQUESTS or not self._loading:
            return []
        self._received_s = now_s
        self._loading = message.seq < len(self._items) - 1
        return [self._items[message.seq]]

    def tick(self, now_s: float) -> list[Message]:
        """Give up when nothing was requested for too long."""
        if self.outcome is None and now_s - self._received_s > 2 * self.PATIENCE_S:
            self.outcome = "nothing more came"
        return []


class PersistentUpload:
    """MISSION_COUNT every second until the first request; the last item every 3 s until an ACK."""

    COUNT_S: Final = 1.0
    LAST_ITEM_S: Final = 3.0

    def __init__(self, items: Sequence[Message]) -> None:
        self._items = items
        self._complete = False
        self._due_s = 0.0
        self._begun = False
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Announce the plan."""
        self._due_s = now_s + self.COUNT_S
        return [count_of(self._items)]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Answer every request; an ACK ends it."""
        if self.outcome is not None or message.mission_type != self._items[0].mission_type:
            return []
        if message.get_type() == "MISSION_ACK":
            self.outcome = DONE if message.type == ACCEPTED else f"vehicle: {message.type}"
        if message.get_type() not in _REQUESTS:
            return []
        self._begun = True
        self._complete = self._complete or message.seq == len(self._items) - 1
        self._due_s = now_s + self.LAST_ITEM_S
        return [self._items[message.seq]]

    def tick(self, now_s: float) -> list[Message]:
        """Repeat the first or the last message of the transfer."""
        if self.outcome is not None or now_s < self._due_s:
            return []
        if not self._begun:
            return self.start(now_s)
        self._due_s = now_s + self.LAST_ITEM_S
        return [self._items[-1]] if self._complete else []


class MavproxyDownload:
    """MAVProxy's loader: five requests outstanding, each repeated after 2 s."""

    WINDOW: Final = 5
    REPEAT_S: Final = 2.0
    CHECK_S: Final = 0.5

    def __init__(self, mission_type: int = 0) -> None:
        self._type = mission_type
        self._count: int | None = None
        self._requested_s: dict[int, float] = {}
        self._check_s = 0.0
        self.items: dict[int, Message] = {}
        self.outcome: str | None = None

    def start(self, now_s: float) -> list[Message]:
        """Ask for the number of items."""
        self._check_s = now_s + self.REPEAT_S
        return [list_request(self._type)]

    def receive(self, message: Message, now_s: float) -> list[Message]:
        """Take the count or any item of the window."""
        if self.outcome is not None or message.mission_type != self._type:
            return []
        if message.get_type() == "MISSION_COUNT" and self._count is None:
            self._count = message.count
        elif message.get_type() == "MISSION_ITEM_INT" and message.seq not in self.items:
            self.items[message.seq] = message
            self._requested_s.pop(message.seq, None)
        else:
            return []
        if len(self.items) == self._count:
            self.outcome = DONE
            return [final_ack(self._type)]
        return self._fill_window(now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Twice a second, ask again for what is overdue."""
        if self.outcome is not None or now_s < self._check_s:
            return []
        if self._count is None:
            return self.start(now_s)
        self._check_s = now_s + self.CHECK_S
        overdue = [seq for seq, at_s in self._requested_s.items() if now_s - at_s > self.REPEAT_S]
        self._requested_s.update(dict.fromkeys(overdue, now_s))
        return [item_request(seq, self._type) for seq in overdue]

    def _fill_window(self, now_s: float) -> list[Message]:
        self._check_s = min(self._check_s, now_s + self.CHECK_S)
        requested = []
        for seq in range(self._count or 0):
            if len(self._requested_s) >= self.WINDOW:
                break
            if seq not in self.items and seq not in self._requested_s:
                self._requested_s[seq] = now_s
                requested.append(item_request(seq, self._type))
        return requested
