"""The log protocol's vehicle end: a list of flight logs, and their contents in pieces.

Sans-IO but for the file store. The numbers of the logs hold from one list to the next: a log
that is removed in between keeps its number and gives no data.

A stretch that ends with the log ends with its last piece. A request beyond the end is answered
by one piece without contents, by which clients know that there is no more.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from uav_firmware.cal.files import FileStore, OpenFile, OpenMode
from uav_firmware.modules.mavlink.log.index import Log, find_logs
from uav_firmware.modules.mavlink.telemetry.status_text import StatusTexts
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.pace import Pace

PIECE_BYTES: Final = 90
PIECES_PER_SECOND: Final = 2_000
"""180 kB/s of vehicle time; unlike a file transfer, the client does not hold it back."""
PIECES_MAX: Final = 96
MAX_REQUESTS: Final = 32
MAX_CLIENTS: Final = 4
MESSAGE_TYPES: Final = ("LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_ERASE")
_LIST_COST: Final = 16
_WARNING: Final[int] = mavlink.MAV_SEVERITY_WARNING
_INFO: Final[int] = mavlink.MAV_SEVERITY_INFO


@dataclass(slots=True)
class _Stretch:
    """A part of a log that is being sent."""

    log_id: int
    offset: int
    left: int


@dataclass(slots=True)
class _Client:
    """What one client waits for."""

    sender: Sender
    list_from: int | None = None  # First log of a list that is still to be made
    list_to: int = 0
    entries: deque[int] = field(default_factory=deque)  # Numbers that are still to be told
    stretches: deque[_Stretch] = field(default_factory=deque)
    file: tuple[int, OpenFile] | None = None  # The log that is being read

    @property
    def has_work(self) -> bool:
        return self.list_from is not None or bool(self.entries or self.stretches)

    def close(self) -> None:
        """Read no more."""
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
        """Take the folder of logs, and a way to ask whether the vehicle is armed."""
        self._system_id = system_id
        self._store = store
        self._is_armed = is_armed
        self._texts = texts
        self._pace = Pace(PIECES_PER_SECOND, PIECES_MAX)
        self._clients: dict[tuple[int, int], _Client] = {}
        self._logs: list[Log] = []
        self._handlers: dict[str, Callable[[Message, _Client], None]] = {
            "LOG_REQUEST_LIST": self._want_list,
            "LOG_REQUEST_DATA": self._want_data,
        }

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take a message of the log protocol."""
        if not is_for_us(message, self._system_id):
            return []
        kind = message.get_type()
        if kind == "LOG_REQUEST_END":
            self._leave(sender.identity)
            return []
        if kind == "LOG_ERASE":
            return self._erase(now_us)
        client = self._client(sender)
        if client is not None:
            self._handlers[kind](message, client)
        return self._work(now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Go on with what is under way."""
        return self._work(now_us) if self._clients else []

    def _client(self, sender: Sender) -> _Client | None:
        """State of a client; of too many, the one that waits for nothing makes room."""
        client = self._clients.get(sender.identity)
        if client is None:
            if len(self._clients) >= MAX_CLIENTS:
                idle = [key for key, one in self._clients.items() if not one.has_work]
                if not idle:
                    return None
                self._leave(idle[0])
            client = self._clients[sender.identity] = _Client(sender)
        client.sender = sender
        return client

    def _leave(self, identity: tuple[int, int]) -> None:
        client = self._clients.pop(identity, None)
        if client is not None:
            client.close()

    def _want_list(self, message: Message, client: _Client) -> None:
        client.list_from, client.list_to = message.start, message.end
        client.entries.clear()

    def _want_data(self, message: Message, client: _Client) -> None:
        """Queue a stretch; one of another log ends what was wanted of the former."""
        others = [
            one
            for one in client.stretches
            if one.log_id == message.id and one.offset != message.ofs
        ]
        client.stretches = deque(others[: MAX_REQUESTS - 1])
        client.stretches.append(_Stretch(message.id, message.ofs, message.count))

    def _work(self, now_us: int) -> list[Outgoing]:
        self._pace.refill(now_us)
        outgoing: list[Outgoing] = []
        busy = [client for client in self._clients.values() if client.has_work]
        while busy:
            for client in busy:
                if not self._pace.ready:
                    return outgoing
                self._pace.spend()
                outgoing += self._step(client)
            busy = [client for client in busy if client.has_work]
        return outgoing

    def _step(self, client: _Client) -> list[Outgoing]:
        """One message, or the making of a list."""
        if client.list_from is not None:
            return self._make_list(client, client.list_from)
        if client.entries:
            return [self._entry(client, client.entries.popleft())]
        return self._piece(client, client.stretches[0])

    def _make_list(self, client: _Client, first: int) -> list[Outgoing]:
        """Number the logs anew for a list from the beginning, or at the first request."""
        client.list_from = None
        if first == 0 or not self._logs:
            self._pace.spend(_LIST_COST)
            self._find()
        last = min(client.list_to, len(self._logs) - 1)
        client.entries.extend(range(first, last + 1))
        return [] if self._logs else [self._no_entry(client)]

    def _find(self) -> None:
        """Number the logs; those that cannot be read are none."""
        for client in self._clients.values():
            client.close()
        self._logs = []
        with suppress(OSError):
            self._logs = find_logs(self._store)

    def _entry(self, client: _Client, log_id: int) -> Outgoing:
        if log_id >= len(self._logs):
            return self._no_entry(client)
        log = self._logs[log_id]
        return _to(
            client,
            mavlink.MAVLink_log_entry_message(
                id=log_id,
                num_logs=len(self._logs),
                last_log_num=len(self._logs) - 1,
                time_utc=log.time_utc_s,
                size=min(log.size, 0xFFFFFFFF),
            ),
        )

    def _no_entry(self, client: _Client) -> Outgoing:
        """That there are no logs."""
        return _to(client, mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))

    def _piece(self, client: _Client, stretch: _Stretch) -> list[Outgoing]:
        """The next piece of a stretch; none of a log that is not there."""
        if not self._logs:
            self._find()
        data = self._read(client, stretch)
        if data is None:
            client.stretches.popleft()
            return []
        piece = mavlink.MAVLink_log_data_message(
            id=stretch.log_id,
            ofs=stretch.offset,
            count=len(data),
            data=data.ljust(PIECE_BYTES, b"\x00"),
        )
        stretch.offset += len(data)
        stretch.left -= len(data)
        at_end = len(data) < PIECE_BYTES or stretch.offset >= self._logs[stretch.log_id].size
        if at_end or stretch.left <= 0:
            client.stretches.popleft()
        return [_to(client, piece)]

    def _read(self, client: _Client, stretch: _Stretch) -> bytes | None:
        """Contents of the next piece; None if the log cannot be read."""
        if stretch.log_id >= len(self._logs):
            return None
        log = self._logs[stretch.log_id]
        count = min(PIECE_BYTES, stretch.left, max(log.size - stretch.offset, 0))
        try:
            if client.file is None or client.file[0] != stretch.log_id:
                client.close()
                client.file = (stretch.log_id, self._store.open(log.place, OpenMode.READ))
            return client.file[1].read(stretch.offset, count)
        except OSError:
            return None

    def _erase(self, now_us: int) -> list[Outgoing]:
        """Remove all logs but the one being written; on the ground only."""
        self._pace.refill(now_us)
        if not self._pace.ready:
            return []
        self._pace.spend(_LIST_COST)
        if self._is_armed():
            return self._texts.say(_WARNING, "Logs not erased: the vehicle is armed")
        self._find()
        kept = 0
        for log in self._logs:
            try:
                self._store.remove(log.place)
            except OSError:
                kept += 1
        for day in {log.place[:-1] for log in self._logs}:
            with suppress(OSError):  # A folder that still holds something stays
                self._store.remove_folder(day)
        erased = len(self._logs) - kept
        self._logs = []
        said = f"{erased} logs erased" + (f", {kept} kept" if kept else "")
        return self._texts.say(_INFO, said)


def _to(client: _Client, message: Message) -> Outgoing:
    return Outgoing(message, client.sender.address)
