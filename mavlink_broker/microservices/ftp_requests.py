"""Requests of a file transfer: their bytes, their repetition, and the match with their answers.

FILE_TRANSFER_PROTOCOL(110) has 12 bytes of header and up to 239 of data. Layout and numbers:
MAVLink's file transfer protocol, "Payload format", "OpCodes", "NAK errors".

A repetition keeps its number, so that a server repeats a lost answer instead of executing the
request twice. While answers to other requests arrive, a request is repeated after each timeout: the
link loses frames but is up. In a silence the timeouts double after a while.

`PartialFile` is a partly received file with the sorted ranges of its missing bytes.
"""

import math
import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.command import LONGEST_TIMEOUT_S, RoundTrip

DATA_MAX: Final = 239
_PAYLOAD_BYTES: Final = 251
_HEADER: Final = struct.Struct("<HBBBBBBI")
TERMINATE, RESET, OPEN, READ, CHECKSUM, BURST = 1, 2, 4, 5, 14, 15
ACK, NAK = 128, 129
FAIL_ERRNO, INVALID_SESSION, NO_SESSIONS, END_OF_FILE, UNKNOWN = 2, 4, 5, 6, 7
NAK_REASONS: Final = {
    1: "failure",
    FAIL_ERRNO: "failure of its storage",
    3: "invalid size",
    INVALID_SESSION: "invalid session",
    NO_SESSIONS: "too many files are open",
    END_OF_FILE: "end of file",
    UNKNOWN: "unknown command",
    8: "the file exists",
    9: "the file is protected",
    10: "file not found",
}
ATTEMPTS: Final = 20
"""Attempts of one request: at 20 % loss each way all are lost in one transfer in 10^9."""
_ATTEMPTS_OF: Final = {OPEN: 8, BURST: 8, CHECKSUM: 8, TERMINATE: 3}
SILENT_TIMEOUTS: Final = 2.0
"""Timeouts since the last answer to any request, after which the link counts as silent."""
CONSTANT_REPETITIONS: Final = 3
"""Repetitions in a silence before the timeouts double: three lost frames are no outage."""
CHECK_TIMEOUT_S: Final = 3.0
"""Time for a checksum: a slow card is read completely."""


class Packet(NamedTuple):
    """One payload in either direction."""

    seq: int
    session: int
    opcode: int
    size: int  # [bytes] Of the data, or requested
    requested: int  # In an answer: the opcode of the request
    is_complete: bool  # In an answer to a burst: it is the last packet
    offset: int
    data: bytes

    @property
    def error(self) -> int:
        """Error code of a NAK; 0 if it has none."""
        return self.data[0] if self.data else 0


def encode_request(route: Route, packet: Packet) -> Message:
    """FILE_TRANSFER_PROTOCOL to one component of the vehicle."""
    header = _HEADER.pack(
        packet.seq, packet.session, packet.opcode, packet.size, 0, 0, 0, packet.offset
    )
    return mavlink.MAVLink_file_transfer_protocol_message(
        0, *route.target, (header + packet.data).ljust(_PAYLOAD_BYTES, b"\x00")
    )


def answer_of(message: Message) -> Packet | None:
    """Decode an answer; None for other payloads, such as requests of other clients."""
    payload = bytes(message.payload)
    seq, session, opcode, size, requested, complete, _, offset = _HEADER.unpack_from(payload)
    if opcode not in {ACK, NAK}:
        return None
    size = min(size, DATA_MAX)
    data = payload[_HEADER.size : _HEADER.size + size]
    return Packet(seq, session, opcode, size, requested, bool(complete), offset, data)


@dataclass(slots=True)
class PendingRequest:
    """One request without an answer."""

    packet: Packet
    sent_at: float
    due_at: float
    attempts: int = 1

    @property
    def is_spent(self) -> bool:
        """Whether its attempts are used up."""
        return self.attempts >= _ATTEMPTS_OF.get(self.packet.opcode, ATTEMPTS)


class PendingRequests:
    """All pending requests of one transfer, with the round trip of the file server."""

    def __init__(self, route: Route, first_seq: int) -> None:
        self._route = route
        self._pending: dict[int, PendingRequest] = {}
        self._received_at = -math.inf
        self.round_trip = RoundTrip()
        self.next_seq = first_seq & 0xFFFF

    def __len__(self) -> int:
        return len(self._pending)

    def count(self, opcode: int) -> int:
        """Number of pending requests with an opcode."""
        return sum(request.packet.opcode == opcode for request in self._pending.values())

    def offsets(self, opcode: int) -> set[int]:
        """Offsets of pending requests with an opcode."""
        requests = self._pending.values()
        return {request.packet.offset for request in requests if request.packet.opcode == opcode}

    def new(
        self,
        opcode: int,
        now: float,
        *,
        session: int = 0,
        offset: int = 0,
        size: int = 0,
        data: bytes = b"",
    ) -> Message:
        """Make the next request; `size` is used if there is no data."""
        seq, self.next_seq = self.next_seq, (self.next_seq + 1) & 0xFFFF
        packet = Packet(
            seq=seq,
            session=session,
            opcode=opcode,
            size=len(data) or size,
            requested=0,
            is_complete=False,
            offset=offset,
            data=data,
        )
        self._pending[seq] = PendingRequest(packet, now, now + self._timeout_s(opcode))
        return encode_request(self._route, packet)

    def overdue(self, now: float) -> Iterator[PendingRequest]:
        """Overdue requests; the caller may drop requests meanwhile."""
        for request in list(self._pending.values()):
            if now >= request.due_at and request.packet.seq in self._pending:
                yield request

    def repeat(self, request: PendingRequest, now: float) -> Message:
        """Repeat a request, with a longer timeout each time."""
        timeout_s = self._timeout_s(request.packet.opcode)
        if now - self._received_at > SILENT_TIMEOUTS * timeout_s:
            timeout_s *= 2 ** min(max(0, request.attempts - CONSTANT_REPETITIONS), 3)
        request.due_at = now + min(timeout_s, LONGEST_TIMEOUT_S)
        request.attempts += 1
        return encode_request(self._route, request.packet)

    def drop(self, request: PendingRequest) -> None:
        """Remove a request."""
        self._pending.pop(request.packet.seq, None)

    def clear(self) -> None:
        """Remove all requests."""
        self._pending.clear()

    def answered_by(self, answer: Packet, now: float) -> PendingRequest | None:
        """Remove and return the request of an answer; None if there is none.

        A packet of a burst answers the requested burst, unless its data is before that: then it is
        a late packet of the burst before.
        """
        self._received_at = now
        if answer.requested == BURST:
            bursts = (a for a in self._pending.values() if a.packet.opcode == BURST)
            request = next(bursts, None)
            if (
                request is not None
                and answer.opcode == ACK
                and answer.offset < request.packet.offset
            ):
                request = None
        else:
            request = self._pending.get((answer.seq - 1) & 0xFFFF)
        if request is None or request.packet.opcode != answer.requested:
            return None
        if request.attempts == 1:  # Karn's rule
            self.round_trip.sample(now - request.sent_at)
        self.drop(request)
        return request

    def _timeout_s(self, opcode: int) -> float:
        timeout_s = self.round_trip.timeout_s
        return max(CHECK_TIMEOUT_S, timeout_s) if opcode == CHECKSUM else timeout_s


_ALL_ONES: Final = 0xFFFFFFFF


class Fetched(NamedTuple):
    """The whole file."""

    data: bytes


class NotFetched(NamedTuple):
    """Why the download has failed."""

    reason: str


FetchOutcome: TypeAlias = Fetched | NotFetched


class MissingRanges:
    """The missing part of a file of a known size."""

    def __init__(self, size: int) -> None:
        self._ranges: list[tuple[int, int]] = [(0, size)] if size else []

    def __bool__(self) -> bool:
        return bool(self._ranges)

    def __contains__(self, offset: int) -> bool:
        """Whether the byte at an offset is missing."""
        index = bisect_right(self._ranges, (offset, math.inf)) - 1
        return index >= 0 and self._ranges[index][0] <= offset < self._ranges[index][1]

    @property
    def count(self) -> int:
        """How many bytes are missing."""
        return sum(end - start for start, end in self._ranges)

    def pieces(self, largest: int) -> Iterator[tuple[int, int]]:
        """Iterate over the gaps in pieces (offset, size) of at most `largest` bytes."""
        for start, end in self._ranges:
            for offset in range(start, end, largest):
                yield offset, min(largest, end - offset)

    def first_gap(self, least: int, position: int) -> int | None:
        """Start of a gap of at least `least` bytes: after `position`, else the first one.

        A gap across the position is cut there.
        """
        wide = [(start, end) for start, end in self._ranges if end - start >= least]
        for start, end in wide:
            if end - max(start, position) >= least:
                return max(start, position)
        return wide[0][0] if wide else None

    def remove(self, start: int, end: int) -> bool:
        """Remove received bytes; true if any of them was missing."""
        if start >= end:
            return False
        index = max(0, bisect_right(self._ranges, (start, end)) - 1)
        kept: list[tuple[int, int]] = []
        touched = index
        while touched < len(self._ranges) and self._ranges[touched][0] < end:
            gap_begin, gap_end = self._ranges[touched]
            kept += [(gap_begin, min(gap_end, start))] if gap_begin < start else []
            kept += [(max(gap_begin, end), gap_end)] if gap_end > end else []
            touched += 1
        before = self._ranges[index:touched]
        self._ranges[index:touched] = kept
        return kept != before


class PartialFile:
    """The bytes of a file, and which of them are missing."""

    def __init__(self, size: int) -> None:
        self._data = bytearray(size)
        self.missing = MissingRanges(size)

    @property
    def size(self) -> int:
        """Size of the whole file."""
        return len(self._data)

    @property
    def received(self) -> int:
        """Number of received bytes."""
        return self.size - self.missing.count

    @property
    def data(self) -> bytes:
        """The bytes; missing ones are zero."""
        return bytes(self._data)

    def write(self, offset: int, data: bytes) -> bool:
        """Store bytes up to the end of the file; true if any of them was missing."""
        end = min(offset + len(data), self.size)
        is_new = offset < end and self.missing.remove(offset, end)
        if is_new:
            self._data[offset:end] = data[: end - offset]
        return is_new

    @property
    def checksum(self) -> int:
        """CRC32 as MAVFTP servers compute it: starts at zero, not inverted at the end."""
        return zlib.crc32(self._data, _ALL_ONES) ^ _ALL_ONES
