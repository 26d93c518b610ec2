"""Server of the log protocol: lists and downloads of flight logs.

Sans-IO but for the file store. A client's log numbers are valid until its next list: a log removed
in between keeps its number and has no data. Log 0 is the oldest. Files are
`2026-03-01/09_30_00.ulg`; a second one of the same second is `09_30_00_2.ulg`.

Two stations have the same ids where neither has been given its own, so a client is its ids and its
address.

A range that ends at the end of the log ends with its last packet. A request beyond the end is
answered with one empty packet, which marks the end for clients.

All clients together get 180 kB/s in vehicle time, and each at most its own pace (`log_pace`).
"""

import calendar
import re
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from uav_firmware.cal.files import Entry, FileStore, OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.files.log_pace import MOST_PER_S, LogPace
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.modules.mavlink.wire.token_bucket import TokenBucket

_DAY: Final = re.compile(r"(\d{4})-(\d{2})-(\d{2})")
_LOG: Final = re.compile(r"(\d{2})_(\d{2})_(\d{2})(?:_(\d+))?\.ulg")
PACKET_BYTES: Final = 90
PACKETS_MAX: Final = 96
"""Largest burst, of all clients together."""
MAX_REQUESTS: Final = 32
MAX_CLIENTS: Final = 4
MESSAGE_TYPES: Final = ("LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_ERASE")
_LIST_COST: Final = 16
_WARNING: Final[int] = mavlink.MAV_SEVERITY_WARNING
_INFO: Final[int] = mavlink.MAV_SEVERITY_INFO


class Log(NamedTuple):
    """One flight log."""

    time_utc_s: int  # [s since 1970] At its beginning
    number: int  # Of those that began in the same second, from 1
    place: Place
    size: int  # [bytes] When it was listed


def find_logs(store: FileStore) -> list[Log]:
    """All logs, oldest first.

    Raises:
        OSError: if the store cannot be read.
    """
    return sorted(
        log
        for day in store.entries(())
        if day.is_folder and (date := _DAY.fullmatch(day.name))
        for log in _logs_of_day(store, day, date)
    )


def _logs_of_day(store: FileStore, day: Entry, date: "re.Match[str]") -> Iterator[Log]:
    for entry in store.entries((day.name,)):
        time = _LOG.fullmatch(entry.name)
        if time and entry.is_plain and not entry.is_folder:
            fields = [int(part) for part in (*date.groups(), *time.groups()[:3])]
            seconds = calendar.timegm((*fields, 0, 0, 0))
            yield Log(seconds, int(time[4] or 1), (day.name, entry.name), entry.size)


@dataclass(slots=True)
class _Range:
    """A range of a log in transfer."""

    log_id: int
    offset: int
    left: int


@dataclass(slots=True)
class _Client:
    """Pending requests of one client."""

    sender: Sender
    logs: list[Log] = field(default_factory=list)  # By number, as last listed for this client
    list_from: int | None = None  # First log of a requested list
    list_to: int = 0
    entries: deque[int] = field(default_factory=deque)  # Numbers still to send
    ranges: deque[_Range] = field(default_factory=deque)
    file: tuple[int, OpenFile] | None = None  # The open log
    pace: LogPace = field(default_factory=LogPace)
    sent_log: int = -1  # The log that was sent last
    sent_end: int = 0  # [bytes] The farthest that was sent of it

    @property
    def has_work(self) -> bool:
        return self.list_from is not None or bool(self.entries or self.ranges)

    def close(self) -> None:
        """Close the open log."""
        if self.file is not None:
            self.file[1].abandon()
            self.file = None


class LogServer:
    """Serves LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END and LOG_ERASE."""

    def __init__(
        self,
        *,
        system_id: int,
        store: FileStore,
        is_armed: Callable[[], bool],
        texts: StatusTexts,
    ) -> None:
        """`store` is the folder of logs; `is_armed` returns whether the vehicle is armed."""
        self._system_id = system_id
        self._store = store
        self._is_armed = is_armed
        self._texts = texts
        self._bucket = TokenBucket(MOST_PER_S, PACKETS_MAX)
        self._clients: dict[Sender, _Client] = {}
        self._handlers: dict[str, Callable[[Message, _Client, int], None]] = {
            "LOG_REQUEST_LIST": self._request_list,
            "LOG_REQUEST_DATA": self._request_data,
        }

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle a message of the log protocol."""
        if not is_for_us(message, self._system_id):
            return []
        kind = message.get_type()
        if kind == "LOG_REQUEST_END":
            self._stop(sender)
            return []
        if kind == "LOG_ERASE":
            return self._erase(now_us)
        client = self._client(sender)
        if client is not None:
            self._handlers[kind](message, client, now_us)
        return self._work(now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Continue the transfers."""
        return self._work(now_us) if self._clients else []

    def _client(self, sender: Sender) -> _Client | None:
        """State of a client; an idle client is dropped if there are too many."""
        client = self._clients.get(sender)
        if client is None:
            if len(self._clients) >= MAX_CLIENTS:
                idle = [key for key, one in self._clients.items() if not one.has_work]
                if not idle:
                    return None
                self._drop_client(idle[0])
            client = self._clients[sender] = _Client(sender)
        return client

    def _stop(self, sender: Sender) -> None:
        """End the transfers of a client, which keeps its numbers."""
        client = self._clients.get(sender)
        if client is not None:
            client.close()
            self._clients[sender] = _Client(sender, client.logs)

    def _drop_client(self, sender: Sender) -> None:
        client = self._clients.pop(sender, None)
        if client is not None:
            client.close()

    def _request_list(self, message: Message, client: _Client, _now_us: int) -> None:
        client.list_from, client.list_to = message.start, message.end
        client.entries.clear()

    def _request_data(self, message: Message, client: _Client, now_us: int) -> None:
        """Queue a range; a request for another log drops the pending ranges."""
        others = [
            one for one in client.ranges if one.log_id == message.id and one.offset != message.ofs
        ]
        sent_end = client.sent_end if client.sent_log == message.id else 0
        follows = 0 < sent_end <= message.ofs and not client.ranges
        client.ranges = deque(others[: MAX_REQUESTS - 1])
        client.ranges.append(_Range(message.id, message.ofs, message.count))
        client.pace.request(
            now_us,
            pending=sum(_pieces_left(client, one) for one in client.ranges),
            again=_pieces(min(message.count, sent_end - message.ofs)),
            follows=follows,
        )

    def _work(self, now_us: int) -> list[Outgoing]:
        self._bucket.refill(now_us)
        outgoing: list[Outgoing] = []
        busy = [client for client in self._clients.values() if client.has_work]
        for client in busy:
            client.pace.refill(now_us)
        while busy := [client for client in busy if client.has_work and client.pace.ready]:
            for client in busy:
                if not self._bucket.ready:
                    return outgoing
                self._bucket.spend()
                client.pace.spend()
                outgoing += self._step(client)
        return outgoing

    def _step(self, client: _Client) -> list[Outgoing]:
        """Send one message, or build a list."""
        if client.list_from is not None:
            return self._build_list(client, client.list_from)
        if client.entries:
            return [self._entry(client, client.entries.popleft())]
        return self._packet(client, client.ranges[0])

    def _build_list(self, client: _Client, first: int) -> list[Outgoing]:
        """Number the logs again for a list from the beginning, or at the first request."""
        client.list_from = None
        if first == 0 or not client.logs:
            self._bucket.spend(_LIST_COST)
            self._number(client)
        last = min(client.list_to, len(client.logs) - 1)
        client.entries.extend(range(first, last + 1))
        return [] if client.logs else [self._no_entry(client)]

    def _number(self, client: _Client) -> None:
        """Number the logs for a client."""
        client.close()
        client.logs = self._find()

    def _find(self) -> list[Log]:
        """All logs; unreadable folders count as empty."""
        try:
            return find_logs(self._store)
        except OSError:
            return []

    def _entry(self, client: _Client, log_id: int) -> Outgoing:
        if log_id >= len(client.logs):
            return self._no_entry(client)
        log = client.logs[log_id]
        return _to(
            client,
            mavlink.MAVLink_log_entry_message(
                id=log_id,
                num_logs=len(client.logs),
                last_log_num=len(client.logs) - 1,
                time_utc=log.time_utc_s,
                size=min(log.size, 0xFFFFFFFF),
            ),
        )

    def _no_entry(self, client: _Client) -> Outgoing:
        """Report that there are no logs."""
        return _to(client, mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))

    def _packet(self, client: _Client, log_range: _Range) -> list[Outgoing]:
        """The next packet of a range; none for a missing log."""
        if not client.logs:
            self._number(client)
        data = self._read(client, log_range)
        if data is None:
            client.ranges.popleft()
            return []
        packet = mavlink.MAVLink_log_data_message(
            id=log_range.log_id,
            ofs=log_range.offset,
            count=len(data),
            data=data.ljust(PACKET_BYTES, b"\x00"),
        )
        log_range.offset += len(data)
        log_range.left -= len(data)
        if client.sent_log != log_range.log_id:
            client.sent_log, client.sent_end = log_range.log_id, 0
        client.sent_end = max(client.sent_end, log_range.offset)
        at_end = len(data) < PACKET_BYTES or log_range.offset >= client.logs[log_range.log_id].size
        if at_end or log_range.left <= 0:
            client.ranges.popleft()
        return [_to(client, packet)]

    def _read(self, client: _Client, log_range: _Range) -> bytes | None:
        """Contents of the next packet; None if the log cannot be read."""
        if log_range.log_id >= len(client.logs):
            return None
        log = client.logs[log_range.log_id]
        count = min(PACKET_BYTES, log_range.left, max(log.size - log_range.offset, 0))
        try:
            if client.file is None or client.file[0] != log_range.log_id:
                client.close()
                client.file = (log_range.log_id, self._store.open(log.place, OpenMode.READ))
            return client.file[1].read(log_range.offset, count)
        except OSError:
            return None

    def _erase(self, now_us: int) -> list[Outgoing]:
        """Remove all logs but the one being written; refused while armed."""
        self._bucket.refill(now_us)
        if not self._bucket.ready:
            return []
        self._bucket.spend(_LIST_COST)
        if self._is_armed():
            return self._texts.encode(_WARNING, "Logs not erased: the vehicle is armed")
        logs, kept = self._find(), 0
        for log in logs:
            try:
                self._store.remove(log.place)
            except OSError:
                kept += 1
        for day in {log.place[:-1] for log in logs}:
            with suppress(OSError):  # A folder that is not empty stays
                self._store.remove_folder(day)
        erased = len(logs) - kept
        text = f"{erased} logs erased" + (f", {kept} kept" if kept else "")
        return self._texts.encode(_INFO, text)


def _pieces_left(client: _Client, log_range: _Range) -> int:
    """Pieces that are left of a range of a listed log."""
    left = log_range.left
    if log_range.log_id < len(client.logs):
        left = min(left, client.logs[log_range.log_id].size - log_range.offset)
    return _pieces(left)


def _pieces(size: int) -> int:
    """Pieces of so many bytes."""
    return max(0, -(-size // PACKET_BYTES))


def _to(client: _Client, message: Message) -> Outgoing:
    return Outgoing(message, client.sender.address)
