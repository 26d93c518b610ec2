"""Downloads one file of the vehicle over MAVFTP and checks its CRC32.

    OPENING --> READING --> CHECKING --> CLOSING --> an outcome
    any but OPENING --NAK: invalid session--> OPENING; received data is kept

Bursts fill the large gaps, at first the whole file. One burst is outstanding at a time, and the
next one starts after a pause of a quarter of its duration, so that telemetry gets through
on a slow radio. Data that bursts have lost is read in pieces meanwhile, as many at once as the link
carries; a server without bursts is read in pieces from the start. After a restart
of the vehicle the file is opened again and the transfer continues, as does a later transfer that
gets the data of an earlier one. At the end the server's CRC32, if it computes one, must match.

Flow control. The window is as large as possible without lengthening the round trip, as in LEDBAT
(RFC 6817). Loss is no measure: a radio loses frames whether it is busy or idle. But a full link
queues, so that answers are delayed. While answers arrive about as fast as ever, each increases the
window by one; when they take twice as long, the window is halved. New reads are spaced, because
some servers queue five requests and drop the sixth.
"""

import struct
from enum import Enum, auto
from typing import Final

from mavlink_broker.mavlink.dialect import Message, Route, source_of
from mavlink_broker.microservices import ftp_requests
from mavlink_broker.microservices.ftp_requests import (
    DATA_MAX,
    NAK_REASONS,
    Fetched,
    FetchOutcome,
    NotFetched,
    Packet,
    PartialFile,
    PendingRequest,
    PendingRequests,
)

PAUSE_SHARE: Final = 0.25
"""Pause after a burst, as a share of its duration."""
MAX_PAUSE_S: Final = 1.0
MIN_SILENCE_S: Final = 0.25
"""Packets of a burst are sent closely: after such a silence the rest of it is lost."""
SILENCE_GAPS: Final = 3.0
"""Least silence as a multiple of the longest gap between packets so far."""
BURST_GAP_BYTES: Final = 16 * DATA_MAX
"""Smallest gap for a burst; smaller ones are read in pieces."""
MAX_EMPTY_BURSTS: Final = 3
"""Bursts in a row without new data, after which pieces are read."""
MAX_REOPENINGS: Final = 5
MAX_RESTARTS: Final = 3
BUSY_PAUSE_S: Final = 2.0
BUSY_ATTEMPTS: Final = 15
RESET_AT: Final = 10
"""Refusals for lack of sessions after which all sessions are reset: one may still be open."""
MAX_USELESS_ANSWERS: Final = 20
"""Answers in a row without data, after which the download fails."""
NO_ANSWER: Final = "the vehicle does not answer"
_WORD: Final = struct.Struct("<I")


class BurstTracker:
    """Tracks the bursts of one file."""

    def __init__(self) -> None:
        self._started_at: float | None = None
        self._received_at = 0.0
        self._longest_gap_s = 0.0
        self._new_packets = 0  # Packets of the current burst with new data
        self.position = 0  # [bytes] End of the newest packet, or start of the requested burst

    @property
    def is_active(self) -> bool:
        """Whether a burst is being received."""
        return self._started_at is not None

    def start(self, now: float) -> None:
        """Start a burst: its first packet was received."""
        self._started_at = self._received_at = now
        self._new_packets = 0

    def received(self, now: float, end: int, *, is_new: bool) -> None:
        """Handle a packet whose data ends at this offset."""
        if self.is_active:
            self._longest_gap_s = max(self._longest_gap_s, now - self._received_at)
        self._received_at = now
        self._new_packets += is_new
        self.position = max(self.position, end)

    def is_silent(self, now: float, timeout_s: float) -> bool:
        """Whether the rest of a burst is lost."""
        silence_s = min(timeout_s, max(MIN_SILENCE_S, SILENCE_GAPS * self._longest_gap_s))
        return self.is_active and now - self._received_at >= silence_s

    def end(self, now: float) -> tuple[float, bool]:
        """End the burst; returns how long to pause [s], and whether it had new data."""
        started_at = now if self._started_at is None else self._started_at
        self._started_at = None
        return min(PAUSE_SHARE * (now - started_at), MAX_PAUSE_S), self._new_packets > 0

    def stop(self) -> None:
        """Expect no further packets."""
        self._started_at = None


MIN_WINDOW: Final = 4
MAX_WINDOW: Final = 32
"""The servers of PX4, ArduPilot and this project's vehicle accept so many if they are spaced."""
SPACING_S: Final = 0.01
MAX_NEW_REQUESTS: Final = 4
ROUND_TRIP_TOLERANCE_S: Final = 0.1
"""Variation of round trips on an idle link."""


class ReadWindow:
    """Window of parallel reads of one transfer."""

    def __init__(self) -> None:
        self._size = float(MIN_WINDOW)
        self._shortest_s: float | None = None
        self._halved_at = 0.0
        self._sent_at = 0.0

    @property
    def size(self) -> int:
        """How many reads may be unanswered."""
        return int(self._size)

    def answered(self, round_trip_s: float, now: float) -> None:
        """Use the round trip of a read that was not repeated."""
        if self._shortest_s is None or round_trip_s < self._shortest_s:
            self._shortest_s = round_trip_s
        if round_trip_s <= 1.5 * self._shortest_s + ROUND_TRIP_TOLERANCE_S:
            self._size = min(float(MAX_WINDOW), self._size + 1.0)
        elif round_trip_s > 2.0 * self._shortest_s + ROUND_TRIP_TOLERANCE_S:
            self._halve(now, round_trip_s)

    def allowance(self, now: float, pending: int) -> int:
        """How many may be sent now, with `pending` unanswered."""
        spaced = min(MAX_NEW_REQUESTS, int((now - self._sent_at) / SPACING_S))
        count = max(0, min(self.size - pending, spaced))
        if count:
            self._sent_at = now
        return count

    def _halve(self, now: float, round_trip_s: float) -> None:
        """Halve it, at most once per round trip."""
        if now - self._halved_at >= round_trip_s:
            self._halved_at = now
            self._size = max(float(MIN_WINDOW), self._size / 2.0)


class _Phase(Enum):
    OPENING = auto()
    READING = auto()
    CHECKING = auto()
    CLOSING = auto()


class FileDownload:
    """Downloads one file of the component that `route` addresses."""

    def __init__(
        self,
        path: str,
        route: Route,
        *,
        limit_bytes: int,
        first_seq: int = 0,
        partial: PartialFile | None = None,
    ) -> None:
        """Prepare a download; `partial` is the data of an earlier one of the same file."""
        self._path = path.encode()
        self._route = route
        self._limit = limit_bytes
        self._requests = PendingRequests(route, first_seq)
        self._phase = _Phase.OPENING
        self._session: int | None = None
        self.partial = PartialFile(0) if partial is None else partial
        """The data received so far."""
        self._bursts = BurstTracker()
        self._window = ReadWindow()
        self._supports_bursts = True
        self._empty_bursts = 0
        self._has_burst = False  # The server has answered a burst
        self._not_before = 0.0
        self._must_reset = False
        self._refusals = 0
        self._reopened = 0
        self._restarts = 0
        self._useless_answers = 0
        self._final_outcome: FetchOutcome | None = None
        self.is_paused = False  # Sends no requests during something more urgent
        self.outcome: FetchOutcome | None = None

    @property
    def next_seq(self) -> int:
        """Sequence number after the last request, for the next transfer."""
        return self._requests.next_seq

    def start(self, now: float) -> list[Message]:
        """Send the first request."""
        return self._go_on(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle an answer of the component; other messages are ignored."""
        if self.outcome is not None or not self._is_ours(message):
            return []
        answer = ftp_requests.answer_of(message)
        if answer is None:
            return []
        request = self._requests.answered_by(answer, now)
        if request is not None and request.attempts == 1 and answer.requested == ftp_requests.READ:
            self._window.answered(now - request.sent_at, now)
        if answer.requested == ftp_requests.BURST:
            self._take_burst(answer, now, is_first=request is not None)
        elif request is not None:
            self._take_answer(answer, request, now)
        return self._go_on(now)

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue; to be called only while the vehicle is received."""
        messages: list[Message] = []
        if self.outcome is not None:
            return messages
        for request in self._requests.overdue(now):
            if request.is_spent:
                self._requests.drop(request)
                self._unanswered(request.packet.opcode)
            else:
                messages.append(self._requests.repeat(request, now))
        if self._bursts.is_silent(now, self._requests.round_trip.timeout_s):
            self._end_burst(now)
        return messages + self._go_on(now)

    def _is_ours(self, message: Message) -> bool:
        return (
            message.get_type() == "FILE_TRANSFER_PROTOCOL"
            and self._route.is_for_us(message)
            and source_of(message).component == self._route.target_component
        )

    def _go_on(self, now: float) -> list[Message]:
        if self.outcome is not None:
            return []
        if self._phase is _Phase.READING and not self.partial.missing:
            self._enter(_Phase.CHECKING)
        if self._phase is _Phase.READING:
            return [] if self.is_paused else self._read_on(now)
        return [] if self._requests or now < self._not_before else self._ask_next(now)

    def _ask_next(self, now: float) -> list[Message]:
        match self._phase:
            case _Phase.OPENING if self._must_reset:
                return [self._requests.new(ftp_requests.RESET, now)]
            case _Phase.OPENING:
                return [self._requests.new(ftp_requests.OPEN, now, data=self._path)]
            case _Phase.CHECKING:
                return [self._requests.new(ftp_requests.CHECKSUM, now, data=self._path)]
            case _Phase.CLOSING:
                session = self._session or 0
                return [self._requests.new(ftp_requests.TERMINATE, now, session=session)]
        return []

    def _read_on(self, now: float) -> list[Message]:
        """Request the next burst for a large gap, and missing pieces."""
        if self._bursts.is_active:
            return []
        tail = self.partial.size - self._bursts.position
        least = min(
            BURST_GAP_BYTES, max(tail, 2 * DATA_MAX)
        )  # The end of the file comes by burst too
        at = self.partial.missing.first_gap(least, self._bursts.position)
        if not self._supports_bursts or at is None:
            return self._read_pieces(now, self.partial.size)
        messages = []
        if not self._requests.count(ftp_requests.BURST) and now >= self._not_before:
            self._bursts.position = at
            messages.append(self._ask_for(ftp_requests.BURST, at, DATA_MAX, now))
        # Gaps after the burst's position are filled by it or by the next one.
        return [*messages, *self._read_pieces(now, self._bursts.position)]

    def _read_pieces(self, now: float, end: int) -> list[Message]:
        """Request missing pieces of the file before `end`, as far as the window allows."""
        requested = self._requests.offsets(ftp_requests.READ)
        allowed = self._window.allowance(now, len(requested))
        messages: list[Message] = []
        for offset, size in self.partial.missing.pieces(DATA_MAX) if allowed else ():
            if len(messages) >= allowed or offset >= end:
                break
            if offset not in requested:
                messages.append(self._ask_for(ftp_requests.READ, offset, size, now))
        return messages

    def _ask_for(self, opcode: int, offset: int, size: int, now: float) -> Message:
        session = self._session or 0
        return self._requests.new(opcode, now, session=session, offset=offset, size=size)

    def _enter(self, phase: _Phase) -> None:
        self._phase = phase
        self._requests.clear()
        self._bursts.stop()

    def _take_burst(self, answer: Packet, now: float, *, is_first: bool) -> None:
        """Handle a packet of a burst, also a late one: the file's data is the same."""
        if self._phase is not _Phase.READING or answer.session != self._session:
            return
        if answer.opcode == ftp_requests.NAK:
            self._burst_refused(answer, now)
            return
        self._has_burst = True
        if is_first:
            self._bursts.start(now)
        is_new = self.partial.write(answer.offset, answer.data)
        self._bursts.received(now, answer.offset + len(answer.data), is_new=is_new)
        if answer.is_complete and self._bursts.is_active:
            self._end_burst(now)

    def _burst_refused(self, answer: Packet, now: float) -> None:
        self._bursts.stop()
        if answer.error in {ftp_requests.END_OF_FILE, ftp_requests.UNKNOWN}:
            self._supports_bursts = False  # Reads show whether the file is shorter
        else:
            self._refused(answer, now)

    def _end_burst(self, now: float) -> None:
        """Pause; stop using bursts if they bring no new data."""
        pause_s, had_new_data = self._bursts.end(now)
        self._not_before = now + pause_s
        self._empty_bursts = 0 if had_new_data else self._empty_bursts + 1
        self._supports_bursts &= self._empty_bursts < MAX_EMPTY_BURSTS

    def _take_answer(self, answer: Packet, request: PendingRequest, now: float) -> None:
        if answer.opcode == ftp_requests.NAK:
            self._refused(answer, now)
            return
        match answer.requested:
            case ftp_requests.OPEN:
                self._opened(answer)
            case ftp_requests.READ if answer.offset == request.packet.offset:
                self._read(answer)
            case ftp_requests.CHECKSUM:
                self._check(answer)
            case ftp_requests.TERMINATE:
                self._closed()
            case ftp_requests.RESET:
                self._must_reset = False

    def _opened(self, answer: Packet) -> None:
        size = _WORD.unpack_from(answer.data)[0] if len(answer.data) >= _WORD.size else 0
        self._session = answer.session
        if size > self._limit:
            self._close(NotFetched(f"it has {size} bytes, and {self._limit} are the limit"))
        elif size == 0:
            self._close(NotFetched("it is empty"))
        else:
            if size != self.partial.size:
                self._restarts += 1
                self.partial = PartialFile(size)
            self._bursts = BurstTracker()
            self._enter(_Phase.READING)

    def _read(self, answer: Packet) -> None:
        self.partial.write(answer.offset, answer.data)
        is_served = answer.offset not in self.partial.missing  # Perhaps by a late packet
        self._useless_answers = 0 if is_served else self._useless_answers + 1
        if self._useless_answers >= MAX_USELESS_ANSWERS:
            self._close(NotFetched("the vehicle sends no data of it"))

    def _check(self, answer: Packet) -> None:
        expected = _WORD.unpack_from(answer.data)[0] if len(answer.data) >= _WORD.size else None
        if expected in {None, self.partial.checksum}:
            self._close(Fetched(self.partial.data))
        elif self._restarts >= MAX_RESTARTS:
            self._close(NotFetched("the checksum of the received file is wrong"))
        else:  # Perhaps the file was still being written: it is opened again
            self.partial = PartialFile(0)
            self._enter(_Phase.CLOSING)

    def _refused(self, answer: Packet, now: float) -> None:
        error, again = answer.error, {ftp_requests.INVALID_SESSION, ftp_requests.END_OF_FILE}
        match answer.requested:
            case ftp_requests.CHECKSUM:  # The server computes none: all bytes were received
                self._close(Fetched(self.partial.data))
            case ftp_requests.TERMINATE:
                self._closed()
            case ftp_requests.RESET:
                self._must_reset = False
            case ftp_requests.OPEN if error == ftp_requests.NO_SESSIONS:
                self._wait_for_a_session(now)
            case ftp_requests.READ | ftp_requests.BURST if error in again:
                self._open_again(error, now)
            case _:
                reason = NAK_REASONS.get(error, f"refusal {error}")
                self._close(NotFetched(f"the vehicle answers: {reason}"))

    def _wait_for_a_session(self, now: float) -> None:
        self._refusals += 1
        self._not_before = now + BUSY_PAUSE_S
        self._must_reset = self._refusals == RESET_AT
        if self._refusals >= BUSY_ATTEMPTS:
            self.outcome = NotFetched("the vehicle answers: too many files are open")

    def _open_again(self, error: int, now: float) -> None:
        """Open the file once more: the vehicle was restarted, or the file was still being written.

        A file that has another size then is downloaded from the start.
        """
        self._reopened += 1
        if self._reopened > MAX_REOPENINGS:
            self._close(NotFetched(f"the vehicle answers: {NAK_REASONS[error]}"))
        elif error == ftp_requests.INVALID_SESSION:
            self._session = None
            self._enter(_Phase.OPENING)
        else:
            self._not_before = now + BUSY_PAUSE_S
            self._enter(_Phase.CLOSING)

    def _close(self, outcome: FetchOutcome) -> None:
        self._final_outcome = outcome
        self._enter(_Phase.CLOSING)
        if self._session is None:
            self._closed()

    def _closed(self) -> None:
        self._session = None
        if self._final_outcome is None:
            self._enter(_Phase.OPENING)
        self.outcome = self._final_outcome

    def _unanswered(self, opcode: int) -> None:
        match opcode:
            case ftp_requests.TERMINATE:
                self._closed()
            case ftp_requests.CHECKSUM:
                self._close(Fetched(self.partial.data))
            case ftp_requests.BURST if not self._has_burst:
                self._supports_bursts = False
            case ftp_requests.RESET:
                self._must_reset = False
            case _:
                self.outcome = NotFetched(NO_ANSWER)
