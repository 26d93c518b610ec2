"""MAVLink's log protocol, client's side: the list of a vehicle's logs, and a log in parts.

    LOG_REQUEST_LIST(117) --> LOG_ENTRY(118), one per log
    LOG_REQUEST_DATA(119) --> LOG_DATA(120), 90 bytes each; an empty one at the end of the log
    LOG_REQUEST_END(122)  the vehicle may write its next log; some write none before

PX4, ArduPilot and the project's vehicle serve it. The messages of a vehicle have no addressee, so
those that answer another client, or an earlier request, are taken too: the bytes are the same.

A log is received in parts of 256 KiB, so that a log of any size takes little memory: the caller
takes a part away before it asks for the next one. One request is outstanding at a time, since a
second one replaces the first in PX4 and ArduPilot. It asks for as much as arrives in half a second,
from the first missing byte on, and includes received bytes between gaps if they cost less than
another round trip. A pause after each request leaves the link to telemetry, and
a limit of the rate leaves the broker's processor to the other vehicles.

What a vehicle states is not relied upon: every wait has an end, and so have answers without new
data, wherever they are.
"""

from typing import Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.command import LONGEST_TIMEOUT_S, RoundTrip
from mavlink_broker.microservices.ftp_download import PAUSE_SHARE, BurstTracker
from mavlink_broker.microservices.ftp_requests import PartialFile

LOG_MESSAGES: Final = frozenset({"LOG_ENTRY", "LOG_DATA"})
LIST_ATTEMPTS: Final = 8
LIST_WITHIN_S: Final = 60.0
"""A list that is not complete by then is used as it is."""
LIST_SILENCE_S: Final = 1.0
"""Entries are sent closely: after such a silence the rest of them is lost."""
ALL_LOGS: Final = 0xFFFF
PACKET_BYTES: Final = 90
PART_BYTES: Final = 256 * 1024
FIRST_WINDOW: Final = 32 * PACKET_BYTES
LEAST_WINDOW: Final = 8 * PACKET_BYTES
LARGEST_WINDOW: Final = 256 * PACKET_BYTES
"""What the system's sockets buffer while the broker is late."""
NEAR_WINDOW: Final = 64 * PACKET_BYTES
"""The largest window while the round trip is below `NEAR_S`: an order to another vehicle waits
until the frames that have arrived together are read, some 0.1 ms each."""
NEAR_S: Final = 0.05
WINDOW_S: Final = 0.5
MOST_BYTES_PER_S: Final = 128 * 1024
"""Uses a tenth of a processor."""
CLOSE_GAPS: Final = 4 * PACKET_BYTES
"""Gaps so close are requested together on any link."""
ATTEMPTS: Final = 20
"""Requests in a row without new data, after which the download fails."""
CONSTANT_REPETITIONS: Final = 3
"""Requests without an answer before the timeouts double."""
NO_DATA: Final = "it sends no further data"
END_CONFIRMATIONS: Final = 2
"""Empty packets that end a log before its stated size."""


class LogEntry(NamedTuple):
    """A log as its vehicle lists it: number, time [s since 1970, 0 unknown], size [bytes]."""

    number: int
    time_s: int
    size: int


class LogList:
    """One list; `entries` is None until it has ended, and empty if there is no log or no answer.

    `num_logs` is their number. `last_log_num` does not show which number is the last one: a
    vehicle that numbers its logs from 0 gives that number or, since PX4 1.16, the number of logs;
    after a request for a few of them, PX4 and ArduPilot give the last one of that request.
    """

    def __init__(self, route: Route, round_trip: RoundTrip) -> None:
        self._route = route
        self._round_trip = round_trip
        self._found: dict[int, LogEntry] = {}
        self._count = 0  # Of the logs, as the vehicle states it
        self._last = 0  # The greatest `last_log_num` of them
        self._attempts = 0
        self._due_at = 0.0
        self._ends_at = 0.0
        self.is_answered = False  # By any entry
        self.entries: tuple[LogEntry, ...] | None = None

    def start(self, now: float) -> list[Message]:
        """Request the list."""
        self._ends_at = now + LIST_WITHIN_S
        return self._request(0, ALL_LOGS, now)

    def receive(self, message: Message, now: float) -> None:
        """Handle an entry; other messages are ignored."""
        if self.entries is not None or message.get_type() != "LOG_ENTRY":
            return
        self.is_answered = True
        if message.num_logs == 0:
            self.entries = ()
            return
        if message.num_logs != self._count:  # They were numbered again meanwhile
            self._count, self._last = message.num_logs, 0
            self._found.clear()
        self._last = max(self._last, message.last_log_num)
        entry = LogEntry(message.id, message.time_utc, message.size)
        if entry.number in self._candidates() and self._found.get(entry.number) != entry:
            self._found[entry.number] = entry
            self._attempts = 0
        self._due_at = now + max(LIST_SILENCE_S, self._round_trip.timeout_s)
        if len(self._found) >= self._count:
            self._end()

    def tick(self, now: float) -> list[Message]:
        """Request again what is missing."""
        if self.entries is not None or now < min(self._due_at, self._ends_at):
            return []
        if self._attempts >= LIST_ATTEMPTS or now >= self._ends_at:
            self._end()
            return []
        missing = [number for number in self._candidates() if number not in self._found]
        if not missing or len(missing) > len(self._found):
            return self._request(0, ALL_LOGS, now)
        return self._request(missing[0], missing[-1], now)

    def _request(self, first: int, last: int, now: float) -> list[Message]:
        self._attempts += 1
        self._due_at = now + max(LIST_SILENCE_S, self._round_trip.timeout_s)
        return [mavlink.MAVLink_log_request_list_message(*self._route.target, first, last)]

    def _candidates(self) -> range:
        """The numbers that the logs may have: one more than there are, as long as both ends may."""
        first, last = max(0, self._last - self._count), self._last
        if first in self._found:
            last = first + self._count - 1
        elif last in self._found:
            first = max(0, last - self._count + 1)
        return range(first, last + 1)

    def _end(self) -> None:
        self.entries = tuple(self._found[number] for number in sorted(self._found))


def first_byte_request(entry: LogEntry, route: Route) -> Message:
    """Read a byte of a log: ArduPilot closes the log that it writes only when one is read.

    Until then it lists that log with the present time.
    """
    return mavlink.MAVLink_log_request_data_message(*route.target, entry.number, 0, 1)


class LogPart(NamedTuple):
    """Bytes of a log from an offset; the last part may be empty."""

    offset: int
    data: bytes
    is_last: bool


class LogDownload:
    """The download of one log, part by part, from an offset on."""

    def __init__(
        self, entry: LogEntry, route: Route, *, offset: int = 0, reopens: bool = False
    ) -> None:
        """`reopens`: have the vehicle open the log anew.

        PX4 keeps an interrupted log open by its number, since 1.16 also while it lists its logs
        again and gives that number to another one.
        """
        self._entry = entry
        self._reopens = reopens
        self._route = route
        self._round_trip = RoundTrip()
        self._size = entry.size
        self._offset = min(offset, entry.size)
        self._part = self._new_part()
        self._bursts = BurstTracker()
        self._requested: tuple[int, int] | None = None  # In the part: from, and up to
        self._sent_at = 0.0
        self._due_at = 0.0
        self._first_at = 0.0  # Of the packets that answer the request
        self._last_at = 0.0
        self._not_before = 0.0
        self._window = FIRST_WINDOW
        self._bytes_per_s = 0.0  # While packets arrive
        self._travel_s = 0.0  # From a request to its first packet, smoothed
        self._received_before = 0  # [bytes] Of the part, when the request was sent
        self._useless = 0  # Requests in a row without new data
        self._unanswered = 0  # Requests in a row without any answer
        self._ends = 0  # Empty packets at the first missing byte
        self.received = 0  # [bytes] Since the beginning of this download
        self.failure: str | None = None

    @property
    def part(self) -> LogPart | None:
        """The part that is complete; `proceed` goes on behind it."""
        if self._part.missing:
            return None
        end = self._offset + self._part.size
        return LogPart(self._offset, self._part.data, is_last=end >= self._size)

    @property
    def left_bytes(self) -> int:
        """How much is missing to the end of the log [bytes]."""
        return self._size - self._offset - self._part.received

    def proceed(self, now: float) -> list[Message]:
        """Go on with the next part."""
        self._offset += self._part.size
        self._part = self._new_part()
        self._requested = None
        self._ends = 0
        return self.tick(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle data of the log; other messages are ignored."""
        is_ours = message.get_type() == "LOG_DATA" and message.id == self._entry.number
        if not is_ours or self.failure is not None or not self._part.missing:
            return []
        data = bytes(message.data[: min(message.count, PACKET_BYTES)])
        at = message.ofs - self._offset
        start, end = self._requested or (0, 0)
        if start <= at < end:
            self._note_answer(now)
        if not data:
            self._take_end(at)
        elif at >= 0:
            before = self._part.received
            is_new = self._part.write(at, data)
            self.received += self._part.received - before
            self._ends = 0 if is_new else self._ends
            if is_new and start <= at < end:  # Repeated bytes keep no request open
                self._bursts.received(now, at + len(data), is_new=True)
        if self._requested is not None and self._has_all_requested():
            self._end_request(now)
        return self.tick(now)

    def tick(self, now: float) -> list[Message]:
        """Do what is due; to be called only while the vehicle is received."""
        if self.failure is not None or not self._part.missing:
            return []
        if self._requested is not None:
            is_silent = self._bursts.is_silent(now, self._round_trip.timeout_s)
            if not is_silent and (self._bursts.is_active or now < self._due_at):
                return []
            self._end_request(now)
        if self.failure is not None or now < self._not_before:
            return []
        return self._request(now)

    def _new_part(self) -> PartialFile:
        return PartialFile(min(PART_BYTES, self._size - self._offset))

    def _request(self, now: float) -> list[Message]:
        start, end = self._next_range()
        self._requested = start, end
        self._received_before = self._part.received
        self._bursts.position = start
        self._sent_at = now
        self._due_at = now + self._timeout_s()
        wanted = self._data_request(self._entry.number, self._offset + start, end - start)
        if not self._reopens or self.received:
            return [wanted]
        another = 0 if self._entry.number else 1
        return [self._data_request(another, 0, 1), wanted]

    def _data_request(self, log: int, offset: int, count: int) -> Message:
        return mavlink.MAVLink_log_request_data_message(*self._route.target, log, offset, count)

    def _timeout_s(self) -> float:
        doublings = min(max(0, self._unanswered - CONSTANT_REPETITIONS), 4)
        return min(self._round_trip.timeout_s * float(1 << doublings), LONGEST_TIMEOUT_S)

    def _next_range(self) -> tuple[int, int]:
        """Choose the next bytes: the first gap, and those that follow it closely."""
        first = last = None
        close = max(CLOSE_GAPS, int(self._bytes_per_s * self._travel_s))
        for offset, size in self._part.missing.pieces(self._window):
            if first is None:
                first = offset
            elif last is not None and offset - last > close:
                break
            last = min(offset + size, first + self._window)
            if last >= first + self._window:
                break
        return first or 0, last or 0

    def _note_answer(self, now: float) -> None:
        self._last_at = now
        if self._requested is None or self._bursts.is_active:
            return
        self._first_at = now
        self._travel_s += (now - self._sent_at - self._travel_s) / 4.0
        if self._unanswered == 0:
            self._round_trip.sample(now - self._sent_at)
        else:
            self._round_trip.sample_repeated(now - self._sent_at)
        self._unanswered = 0
        self._bursts.start(now)

    def _take_end(self, at: int) -> None:
        """Handle an empty packet: the log ends at this place, perhaps before its stated size."""
        if self._requested is None or at != self._first_missing():
            return
        self._ends += 1
        if self._ends >= END_CONFIRMATIONS:
            self._size = self._offset + at
            whole, self._part = self._part.data, self._new_part()
            self._part.write(0, whole[:at])
        else:
            self._due_at = self._sent_at  # Ask once more, at once
            self._bursts.stop()

    def _has_all_requested(self) -> bool:
        _, end = self._requested or (0, 0)
        return self._bursts.position >= end or self._first_missing() >= end

    def _first_missing(self) -> int:
        """The first missing byte of the part, or its end."""
        return next(self._part.missing.pieces(1), (self._part.size, 0))[0]

    def _end_request(self, now: float) -> None:
        """Adapt the window to the rate, and pause."""
        was_answered = self._bursts.is_active
        self._bursts.stop()
        start, end = self._requested or (0, 0)
        self._requested = None
        gained = self._part.received - self._received_before
        self._useless = 0 if gained else self._useless + 1
        self._unanswered = 0 if was_answered or gained else self._unanswered + 1
        if self._useless >= ATTEMPTS:
            self.failure = NO_DATA
        if not was_answered:
            self._not_before = now
            return
        duration_s = max(self._last_at - self._first_at, 1e-3)
        if 2 * (end - start) >= self._window:  # A single late packet shows no rate
            self._bytes_per_s = (end - start) / duration_s
            wanted = int(self._bytes_per_s * WINDOW_S) // PACKET_BYTES * PACKET_BYTES
            largest = NEAR_WINDOW if self._travel_s < NEAR_S else LARGEST_WINDOW
            self._window = max(LEAST_WINDOW, min(wanted, 2 * self._window, largest))
        least_s = (end - start) / MOST_BYTES_PER_S
        self._not_before = max(now + PAUSE_SHARE * duration_s, self._sent_at + least_s)
