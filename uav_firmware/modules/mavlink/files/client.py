"""One client of the file server: its sessions, its bursts, and what becomes of its requests.

Sans-IO but for the file store: a request in, a reply out, time as an argument.
"""

import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from uav_firmware.cal.files import Entry, FileStore, OpenMode, Place
from uav_firmware.modules.mavlink.files.checksum import Checksum
from uav_firmware.modules.mavlink.files.codec import (
    DATA_MAX,
    Fault,
    FileError,
    Opcode,
    Reply,
    Request,
    acknowledge,
    refuse,
    refuse_for,
)
from uav_firmware.modules.mavlink.files.listing import page
from uav_firmware.modules.mavlink.files.names import read_place, read_two_places
from uav_firmware.modules.mavlink.files.replies import ReplyMemory
from uav_firmware.modules.mavlink.files.sessions import Burst, Session, SessionTable

MAX_WAITING: Final = 32
"""Requests beyond it are lost, as in a full buffer."""
BURST_PACKETS: Final = 96
"""Then the client has to ask on: a burst fits into the smallest usual receive buffer."""
LISTING_KEPT_US: Final = 2_000_000
_CHECKSUM_COST: Final = 8
_COSTS: Final[Mapping[int, int]] = {
    Opcode.READ_FILE: 1,
    Opcode.WRITE_FILE: 2,
    Opcode.BURST_READ_FILE: 1,
    Opcode.OPEN_FILE_RO: 16,
}
_OTHER_COST: Final = 8
_ENTRIES_PER_TOKEN: Final = 8
_END: Final = Fault.END_OF_FILE

_Handler = Callable[[Request, int], Reply | None]


class _Listing(NamedTuple):
    """What a folder held when its first page was asked for."""

    place: Place
    entries: Sequence[Entry]
    until_us: int


class FileClient:
    """Serves one client."""

    def __init__(self, store: FileStore, now_us: int) -> None:
        self._store = store
        self._sessions = SessionTable()
        self._replies = ReplyMemory()
        self._waiting: deque[Request] = deque()
        self._checksum: tuple[Place, Checksum, Request] | None = None
        self._listing: _Listing | None = None
        self._extra_cost = 0  # Of the request in hand, beyond what its kind costs
        self.heard_us = now_us
        self._handlers: Mapping[int, _Handler] = {
            Opcode.NONE: lambda request, _now_us: acknowledge(request),
            Opcode.TERMINATE_SESSION: self._terminate,
            Opcode.RESET_SESSIONS: self._reset,
            Opcode.LIST_DIRECTORY: self._list,
            Opcode.LIST_DIRECTORY_WITH_TIME: self._list,
            Opcode.OPEN_FILE_RO: self._open_to_read,
            Opcode.READ_FILE: self._read,
            Opcode.CREATE_FILE: self._create,
            Opcode.WRITE_FILE: self._write,
            Opcode.REMOVE_FILE: self._on_place(lambda place, _: store.remove(place)),
            Opcode.CREATE_DIRECTORY: self._on_place(lambda place, _: store.make_folder(place)),
            Opcode.REMOVE_DIRECTORY: self._on_place(lambda place, _: store.remove_folder(place)),
            Opcode.OPEN_FILE_WO: self._open_to_write,
            Opcode.TRUNCATE_FILE: self._on_place(store.truncate),
            Opcode.RENAME: self._rename,
            Opcode.CALC_FILE_CRC32: self._begin_checksum,
            Opcode.BURST_READ_FILE: self._begin_burst,
        }

    @property
    def has_work(self) -> bool:
        """Whether something waits to be done or sent."""
        return bool(self._waiting or self._checksum) or any(s.burst for s in self._sessions)

    @property
    def is_idle(self) -> bool:
        """Whether nothing is kept that the client could miss."""
        return not self._sessions and not self.has_work

    def ask(self, request: Request, now_us: int) -> None:
        """Take a request in."""
        self.heard_us = now_us
        if len(self._waiting) < MAX_WAITING:
            self._waiting.append(request)

    def step(self, now_us: int) -> tuple[Reply | None, int]:
        """Do one piece of work; gives what is to be sent, and the tokens that it cost."""
        if self._waiting:
            request = self._waiting.popleft()
            self._extra_cost = 0
            reply = self._answer(request, now_us)
            return reply, _COSTS.get(request.opcode, _OTHER_COST) + self._extra_cost
        for session in self._sessions:
            if session.burst is not None:
                return self._next_packet(session, session.burst), 1
        return self._advance_checksum(), _CHECKSUM_COST

    def close_idle(self, since_us: int) -> None:
        """Close the files of which nothing has been wanted since."""
        self._sessions.close_idle(since_us)

    def leave(self) -> None:
        """Close everything: the client is gone."""
        self._sessions.abandon_all()
        if self._checksum is not None:
            self._checksum[1].stop()

    def _answer(self, request: Request, now_us: int) -> Reply | None:
        earlier = self._replies.find(request, now_us)
        if earlier is not None:
            return earlier
        reply = self._carry_out(request, now_us)
        if reply is not None:
            self._replies.keep(request, reply, now_us)
        return reply

    def _carry_out(self, request: Request, now_us: int) -> Reply | None:
        handler = self._handlers.get(request.opcode)
        if handler is None:
            return refuse(request, Fault.UNKNOWN_COMMAND)
        if request.size > DATA_MAX:
            return refuse(request, Fault.INVALID_DATA_SIZE)
        try:
            return handler(request, now_us)
        except FileError as refused:
            return refuse(request, refused.fault)
        except OSError as error:
            return refuse_for(request, error)

    def _terminate(self, request: Request, now_us: int) -> Reply:
        self._replies.session_closed(request.session)
        self._sessions.close(request.session, now_us)
        return acknowledge(request)

    def _reset(self, request: Request, _now_us: int) -> Reply:
        self._replies.clear()
        self._sessions.close_all()
        return acknowledge(request)

    def _list(self, request: Request, now_us: int) -> Reply:
        place = read_place(request.data)
        listing = self._listing
        known = listing is not None and listing.place == place and now_us < listing.until_us
        if request.offset == 0 or listing is None or not known:
            entries = self._store.entries(place)
            listing = self._listing = _Listing(place, entries, now_us + LISTING_KEPT_US)
            self._extra_cost = len(entries) // _ENTRIES_PER_TOKEN
        with_time = request.opcode == Opcode.LIST_DIRECTORY_WITH_TIME
        return acknowledge(request, page(listing.entries, request.offset, with_time=with_time))

    def _open_to_read(self, request: Request, now_us: int) -> Reply:
        session = self._open(request, OpenMode.READ, now_us)
        size = min(session.file.size, 0xFFFFFFFF)
        return acknowledge(request, struct.pack("<I", size), session=session.number)

    def _create(self, request: Request, now_us: int) -> Reply:
        return acknowledge(request, session=self._open(request, OpenMode.CREATE, now_us).number)

    def _open_to_write(self, request: Request, now_us: int) -> Reply:
        return acknowledge(request, session=self._open(request, OpenMode.WRITE, now_us).number)

    def _open(self, request: Request, mode: OpenMode, now_us: int) -> Session:
        place = read_place(request.data)
        session = self._sessions.fresh(place, mode, request.session)
        if session is None:
            number = request.session
            self._sessions.make_free(number, now_us)
            file = self._store.open(place, mode)
            session = Session(number, file, place, mode, now_us)
            self._sessions.add(session)
            self._replies.session_opened(number)
        session.touched_us = now_us
        return session

    def _read(self, request: Request, now_us: int) -> Reply:
        session = self._sessions.get(request.session, now_us)
        session.used = True
        data = session.file.read(request.offset, request.size or DATA_MAX)
        if not data:
            raise FileError(_END)
        return acknowledge(request, data)

    def _write(self, request: Request, now_us: int) -> Reply:
        session = self._sessions.get(request.session, now_us)
        if session.mode is OpenMode.READ:
            raise FileError(Fault.FILE_PROTECTED)
        session.used = True
        session.file.write(request.offset, request.data)
        return acknowledge(request)

    def _on_place(self, action: Callable[[Place, int], None]) -> _Handler:
        """A handler that does something at the place that the request names."""

        def handler(request: Request, _now_us: int) -> Reply:
            place = read_place(request.data)
            if not place:
                raise FileError(Fault.INVALID_DATA_SIZE)
            action(place, request.offset)
            return acknowledge(request)

        return handler

    def _rename(self, request: Request, _now_us: int) -> Reply:
        self._store.rename(*read_two_places(request.data))
        return acknowledge(request)

    def _begin_checksum(self, request: Request, _now_us: int) -> None:
        """Begin a checksum; asked for again, the one under way answers the newest request."""
        place = read_place(request.data)
        if self._checksum is not None:
            former, checksum, _ = self._checksum
            if former == place:
                self._checksum = (place, checksum, request)
                return
            checksum.stop()
            self._checksum = None
        self._checksum = (place, Checksum(self._store.open(place, OpenMode.READ)), request)

    def _advance_checksum(self) -> Reply | None:
        if self._checksum is None:
            return None
        _, checksum, request = self._checksum
        try:
            value = checksum.advance()
        except OSError as error:
            self._checksum = None
            checksum.stop()
            return refuse_for(request, error)
        if value is None:
            return None
        self._checksum = None
        return acknowledge(request, struct.pack("<I", value))

    def _begin_burst(self, request: Request, now_us: int) -> Reply | None:
        """Begin a burst, which goes on without being asked; a new one replaces the former."""
        session = self._sessions.get(request.session, now_us)
        session.used = True
        if request.offset >= session.file.size:
            session.burst = None
            raise FileError(_END)
        size = request.size or DATA_MAX
        session.burst = Burst(request.offset, BURST_PACKETS, size, (request.seq + 1) & 0xFFFF)
        return self._next_packet(session, session.burst)

    def _next_packet(self, session: Session, burst: Burst) -> Reply:
        """The next packet of a burst; the last one says so, at the end of the file too.

        After the end there is no NAK: some clients would take it, coming after a packet that
        was lost, for the failure of the whole transfer. They ask on and are told then.
        """
        request = Request(
            burst.seq - 1, session.number, Opcode.BURST_READ_FILE, 0, burst.offset, b""
        )
        try:
            data = session.file.read(burst.offset, burst.size)
            at_end = burst.offset + len(data) >= session.file.size
        except OSError as error:
            session.burst = None
            return refuse_for(request, error)
        burst.packets -= 1
        complete = at_end or burst.packets == 0
        reply = acknowledge(request, data, complete=complete)
        burst.offset += len(data)
        burst.seq = (burst.seq + 1) & 0xFFFF
        if complete:
            session.burst = None
        return reply
