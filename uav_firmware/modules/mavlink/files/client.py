"""One client of the file server: sessions, bursts and requests.

Sans-IO but for the file store.
"""

import struct
import zlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from uav_firmware.cal.files import Entry, FileStore, OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.files.codec import (
    DATA_MAX,
    Fault,
    FileError,
    Opcode,
    Reply,
    Request,
    acknowledge,
    page,
    read_place,
    read_two_places,
    refuse,
    refuse_for,
)
from uav_firmware.modules.mavlink.files.reply_cache import ReplyCache
from uav_firmware.modules.mavlink.files.sessions import Burst, Session, SessionTable

PIECE_BYTES: Final = 256 * 1024
_ALL_ONES: Final = 0xFFFFFFFF
MAX_WAITING: Final = 32
"""Further requests are dropped."""
BURST_PACKETS: Final = 96
"""Packets per burst, which fit into the smallest usual receive buffer of a client."""
LISTING_LIFETIME_US: Final = 2_000_000
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


def checksum_of(data: bytes) -> int:
    """Checksum of bytes: CRC32 of IEEE 802.3, started at zero and not inverted.

    PX4, MAVSDK and pymavlink compute the same.
    """
    return zlib.crc32(data, _ALL_ONES) ^ _ALL_ONES


class Checksum:
    """Checksum of a file, computed in pieces so that it does not block the control loop."""

    def __init__(self, file: OpenFile) -> None:
        """Use an open file; it is closed at the end."""
        self._file = file
        self._offset = 0
        self._state = _ALL_ONES  # zlib inverts at both ends; starting inverted undoes the first

    def advance(self) -> int | None:
        """Read the next piece; return the checksum at the end of the file, else None.

        Raises:
            OSError: if the file cannot be read.
        """
        piece = self._file.read(self._offset, PIECE_BYTES)
        self._offset += len(piece)
        self._state = zlib.crc32(piece, self._state)
        if len(piece) == PIECE_BYTES:
            return None
        self._file.close()
        return self._state ^ _ALL_ONES

    def stop(self) -> None:
        """Cancel."""
        self._file.abandon()


class _Listing(NamedTuple):
    """Contents of a folder when its first page was requested."""

    place: Place
    entries: Sequence[Entry]
    until_us: int


class FileClient:
    """Serves one client."""

    def __init__(self, store: FileStore, now_us: int) -> None:
        self._store = store
        self._sessions = SessionTable()
        self._replies = ReplyCache()
        self._waiting: deque[Request] = deque()
        self._checksum: tuple[Place, Checksum, Request] | None = None
        self._listing: _Listing | None = None
        self._extra_cost = 0  # Additional cost of the current request
        self.received_us = now_us
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
        """Whether a request, burst or checksum is pending."""
        return bool(self._waiting or self._checksum) or any(s.burst for s in self._sessions)

    @property
    def is_idle(self) -> bool:
        """Whether the client has no session and no pending work."""
        return not self._sessions and not self.has_work

    def add_request(self, request: Request, now_us: int) -> None:
        """Queue a request."""
        self.received_us = now_us
        if len(self._waiting) < MAX_WAITING:
            self._waiting.append(request)

    def step(self, now_us: int) -> tuple[Reply | None, int]:
        """Do one piece of work; return the reply to send and the cost in tokens."""
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
        """Close the files without a request since a time [us]."""
        self._sessions.close_idle(since_us)

    def close(self) -> None:
        """Close all files of a client that is dropped."""
        self._sessions.abandon_all()
        if self._checksum is not None:
            self._checksum[1].stop()

    def _answer(self, request: Request, now_us: int) -> Reply | None:
        earlier = self._replies.find(request, now_us)
        if earlier is not None:
            return earlier
        reply = self._execute(request, now_us)
        if reply is not None:
            self._replies.store(request, reply, now_us)
        return reply

    def _execute(self, request: Request, now_us: int) -> Reply | None:
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
            listing = self._listing = _Listing(place, entries, now_us + LISTING_LIFETIME_US)
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
        session = self._sessions.reopened(place, mode, request.session)
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
        """Return a handler that applies an action to the path of the request."""

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
        """Start a checksum; a repeated request is answered by the one in progress."""
        place = read_place(request.data)
        if self._checksum is not None:
            previous, checksum, _ = self._checksum
            if previous == place:
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
        """Start a burst; it replaces the previous one."""
        session = self._sessions.get(request.session, now_us)
        session.used = True
        if request.offset >= session.file.size:
            session.burst = None
            raise FileError(_END)
        size = request.size or DATA_MAX
        session.burst = Burst(request.offset, BURST_PACKETS, size, (request.seq + 1) & 0xFFFF)
        return self._next_packet(session, session.burst)

    def _next_packet(self, session: Session, burst: Burst) -> Reply:
        """The next packet of a burst; the last one is marked complete, also at the end of the file.

        There is no NAK at the end: after a lost packet some clients take it for a failure of the
        whole transfer. They get it when they request beyond the end.
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
