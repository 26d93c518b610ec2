"""Fetches one file of the vehicle over MAVFTP, whole and checked, however bad the link is.

    OPENING --> READING --> CHECKING --> CLOSING --> an outcome
    any but OPENING --NAK: invalid session--> OPENING, with what has come kept

Bursts bring the wide gaps, at first the whole file; one is outstanding at a time, and the next one
waits for a quarter of the time that the last one took, so that telemetry passes on a slow radio.
What bursts have lost is read piece by piece meanwhile, as many at once as the link takes
(`window`); a server that knows no bursts is read so from the beginning. A vehicle that was
restarted has forgotten the session, not the file: it is opened again and the transfer goes on; so
does a later transfer that is given what an earlier one has brought. In the end the server's CRC32
must be that of what has come, where the server computes one.
"""

import struct
from enum import Enum, auto
from typing import Final

from mavlink_broker.ftp import packets
from mavlink_broker.ftp.burst import Bursts
from mavlink_broker.ftp.packets import DATA_MAX, FAULTS, Packet
from mavlink_broker.ftp.partial_file import Fetched, FetchOutcome, NotFetched, PartialFile
from mavlink_broker.ftp.requests import Ask, Asks
from mavlink_broker.ftp.window import ReadWindow
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, source_of

WIDE_BYTES: Final = 16 * DATA_MAX
"""A gap that is worth a burst; narrower ones are read piece by piece."""
EMPTY_BURSTS: Final = 3
"""Bursts in a row that bring nothing new."""
REOPENINGS: Final = 5
BEGINNINGS: Final = 3
BUSY_PAUSE_S: Final = 2.0
BUSY_ATTEMPTS: Final = 15
RESET_AT: Final = 10
"""Refusal for lack of sessions at which all of ours are closed: one may have been lost open."""
FRUITLESS: Final = 20
"""Answers in a row that bring nothing."""
NO_ANSWER: Final = "the vehicle does not answer"
_WORD: Final = struct.Struct("<I")


class _Phase(Enum):
    OPENING = auto()
    READING = auto()
    CHECKING = auto()
    CLOSING = auto()


class FileDownload:
    """One file of one component; `route` leads there."""

    def __init__(
        self,
        path: str,
        route: Route,
        *,
        limit_bytes: int,
        first_seq: int = 0,
        partial: PartialFile | None = None,
    ) -> None:
        """Take what an earlier transfer of the same file has brought as `partial`."""
        self._path = path.encode()
        self._route = route
        self._limit = limit_bytes
        self._asks = Asks(route, first_seq)
        self._phase = _Phase.OPENING
        self._session: int | None = None
        self._file = PartialFile(0) if partial is None else partial
        self._bursts = Bursts()
        self._window = ReadWindow()
        self._knows_bursts = True
        self._empty_bursts = 0
        self._has_burst = False  # The server has answered a burst
        self._not_before = 0.0
        self._wants_reset = False
        self._refusals = 0
        self._reopened = 0
        self._begun = 0
        self._fruitless = 0
        self._verdict: FetchOutcome | None = None
        self.is_held = False  # Nothing is asked for while something more urgent goes on
        self.outcome: FetchOutcome | None = None

    @property
    def next_seq(self) -> int:
        """The number after the last request's: the next transfer goes on with it."""
        return self._asks.next_seq

    @property
    def partial(self) -> PartialFile:
        """What has come of the file so far."""
        return self._file

    def start(self, now: float) -> list[Message]:
        """Ask for the file."""
        return self._go_on(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take an answer of the component; everything else is ignored."""
        if self.outcome is not None or not self._is_ours(message):
            return []
        answer = packets.answer_of(message)
        if answer is None:
            return []
        ask = self._asks.answered_by(answer, now)
        if ask is not None and ask.attempts == 1 and answer.asked == packets.READ:
            self._window.answered(now - ask.sent_at, now)
        if answer.asked == packets.BURST:
            self._take_burst(answer, now, is_first=ask is not None)
        elif ask is not None:
            self._take_answer(answer, ask, now)
        return self._go_on(now)

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue; to be called only while the vehicle is heard."""
        messages: list[Message] = []
        if self.outcome is not None:
            return messages
        for ask in self._asks.overdue(now):
            if ask.is_spent:
                self._asks.drop(ask)
                self._unanswered(ask.packet.opcode)
            else:
                messages.append(self._asks.repeat(ask, now))
        if self._bursts.is_silent(now, self._asks.round_trip.timeout_s):
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
        if self._phase is _Phase.READING and not self._file.missing:
            self._enter(_Phase.CHECKING)
        if self._phase is _Phase.READING:
            return [] if self.is_held else self._read_on(now)
        return [] if self._asks or now < self._not_before else self._ask_next(now)

    def _ask_next(self, now: float) -> list[Message]:
        match self._phase:
            case _Phase.OPENING if self._wants_reset:
                return [self._asks.new(packets.RESET, now)]
            case _Phase.OPENING:
                return [self._asks.new(packets.OPEN, now, data=self._path)]
            case _Phase.CHECKING:
                return [self._asks.new(packets.CHECKSUM, now, data=self._path)]
            case _Phase.CLOSING:
                session = self._session or 0
                return [self._asks.new(packets.TERMINATE, now, session=session)]
        return []

    def _read_on(self, now: float) -> list[Message]:
        """Ask for the next burst where a gap is wide, and for the pieces that are missing."""
        if self._bursts.is_on:
            return []
        tail = self._file.size - self._bursts.position
        least = min(WIDE_BYTES, max(tail, 2 * DATA_MAX))  # The end of the file comes by burst too
        at = self._file.missing.first_wide(least, self._bursts.position)
        if not self._knows_bursts or at is None:
            return self._read_pieces(now, 0, self._file.size)
        messages = []
        if not self._asks.count(packets.BURST) and now >= self._not_before:
            self._bursts.position = at
            messages.append(self._ask_for(packets.BURST, at, DATA_MAX, now))
        # What lies in front of the burst comes with it, or with the next one.
        return [*messages, *self._read_pieces(now, 0, self._bursts.position)]

    def _read_pieces(self, now: float, begin: int, end: int) -> list[Message]:
        """Ask for missing pieces of a part of the file, as far as the window allows."""
        asked = self._asks.offsets(packets.READ)
        allowed = self._window.allowance(now, len(asked))
        messages: list[Message] = []
        for offset, size in self._file.missing.pieces(DATA_MAX) if allowed else ():
            if len(messages) >= allowed or offset >= end:
                break
            if begin <= offset and offset not in asked:
                messages.append(self._ask_for(packets.READ, offset, size, now))
        return messages

    def _ask_for(self, opcode: int, offset: int, size: int, now: float) -> Message:
        session = self._session or 0
        return self._asks.new(opcode, now, session=session, offset=offset, size=size)

    def _enter(self, phase: _Phase) -> None:
        self._phase = phase
        self._asks.clear()
        self._bursts.stop()

    def _take_burst(self, answer: Packet, now: float, *, is_first: bool) -> None:
        """Take a packet of a burst, a late one too: the bytes of the file are the same."""
        if self._phase is not _Phase.READING or answer.session != self._session:
            return
        if answer.opcode == packets.NAK:
            self._burst_refused(answer, now)
            return
        self._has_burst = True
        if is_first:
            self._bursts.begin(now)
        is_news = self._file.keep(answer.offset, answer.data)
        self._bursts.heard(now, answer.offset + len(answer.data), is_news=is_news)
        if answer.is_complete and self._bursts.is_on:
            self._end_burst(now)

    def _burst_refused(self, answer: Packet, now: float) -> None:
        self._bursts.stop()
        if answer.fault in {packets.END_OF_FILE, packets.UNKNOWN}:
            self._knows_bursts = False  # What is missing is read, which shows a short file
        else:
            self._refused(answer, now)

    def _end_burst(self, now: float) -> None:
        """Let others speak for a while; bursts that bring nothing are given up."""
        pause_s, has_brought = self._bursts.end(now)
        self._not_before = now + pause_s
        self._empty_bursts = 0 if has_brought else self._empty_bursts + 1
        self._knows_bursts &= self._empty_bursts < EMPTY_BURSTS

    def _take_answer(self, answer: Packet, ask: Ask, now: float) -> None:
        if answer.opcode == packets.NAK:
            self._refused(answer, now)
            return
        match answer.asked:
            case packets.OPEN:
                self._opened(answer)
            case packets.READ if answer.offset == ask.packet.offset:
                self._read(answer)
            case packets.CHECKSUM:
                self._check(answer)
            case packets.TERMINATE:
                self._closed()
            case packets.RESET:
                self._wants_reset = False

    def _opened(self, answer: Packet) -> None:
        size = _WORD.unpack_from(answer.data)[0] if len(answer.data) >= _WORD.size else 0
        self._session = answer.session
        if size > self._limit:
            self._close(NotFetched(f"it has {size} bytes, and {self._limit} are the limit"))
        elif size == 0:
            self._close(NotFetched("it is empty"))
        else:
            if size != self._file.size:
                self._begun += 1
                self._file = PartialFile(size)
            self._bursts = Bursts()
            self._enter(_Phase.READING)

    def _read(self, answer: Packet) -> None:
        self._file.keep(answer.offset, answer.data)
        is_served = answer.offset not in self._file.missing  # A late packet may have brought it
        self._fruitless = 0 if is_served else self._fruitless + 1
        if self._fruitless >= FRUITLESS:
            self._close(NotFetched("the vehicle sends nothing of it"))

    def _check(self, answer: Packet) -> None:
        told = _WORD.unpack_from(answer.data)[0] if len(answer.data) >= _WORD.size else None
        if told in {None, self._file.checksum}:
            self._close(Fetched(self._file.data))
        elif self._begun >= BEGINNINGS:
            self._close(NotFetched("what arrives is not what the vehicle has"))
        else:  # Perhaps the file was still being written: it is opened anew
            self._file = PartialFile(0)
            self._enter(_Phase.CLOSING)

    def _refused(self, answer: Packet, now: float) -> None:
        fault, again = answer.fault, {packets.INVALID_SESSION, packets.END_OF_FILE}
        match answer.asked:
            case packets.CHECKSUM:  # It computes none: all bytes are there, which must do
                self._close(Fetched(self._file.data))
            case packets.TERMINATE:
                self._closed()
            case packets.RESET:
                self._wants_reset = False
            case packets.OPEN if fault == packets.NO_SESSIONS:
                self._wait_for_a_session(now)
            case packets.READ | packets.BURST if fault in again:
                self._open_again(fault, now)
            case _:
                reason = FAULTS.get(fault, f"refusal {fault}")
                self._close(NotFetched(f"the vehicle answers: {reason}"))

    def _wait_for_a_session(self, now: float) -> None:
        self._refusals += 1
        self._not_before = now + BUSY_PAUSE_S
        self._wants_reset = self._refusals == RESET_AT
        if self._refusals >= BUSY_ATTEMPTS:
            self.outcome = NotFetched("the vehicle answers: too many files are open")

    def _open_again(self, fault: int, now: float) -> None:
        """Open the file once more: the vehicle was restarted, or the file was still being written.

        One that has another size then is begun anew.
        """
        self._reopened += 1
        if self._reopened > REOPENINGS:
            self._close(NotFetched(f"the vehicle answers: {FAULTS[fault]}"))
        elif fault == packets.INVALID_SESSION:
            self._session = None
            self._enter(_Phase.OPENING)
        else:
            self._not_before = now + BUSY_PAUSE_S
            self._enter(_Phase.CLOSING)

    def _close(self, verdict: FetchOutcome) -> None:
        self._verdict = verdict
        self._enter(_Phase.CLOSING)
        if self._session is None:
            self._closed()

    def _closed(self) -> None:
        self._session = None
        if self._verdict is None:
            self._enter(_Phase.OPENING)
        self.outcome = self._verdict

    def _unanswered(self, opcode: int) -> None:
        match opcode:
            case packets.TERMINATE:
                self._closed()
            case packets.CHECKSUM:
                self._close(Fetched(self._file.data))
            case packets.BURST if not self._has_burst:
                self._knows_bursts = False
            case packets.RESET:
                self._wants_reset = False
            case _:
                self.outcome = NotFetched(NO_ANSWER)
