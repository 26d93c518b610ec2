"""What to send next: the relay's decisions, without clock, network or database.

Streams do not block each other; within a stream one record is in flight. A failure that is not
one stream's (no cloud, a captive portal, five failures in a row) blocks the whole uplink, and a
single probe at a time finds out whether the way is free again. While the cloud refuses our key
the uplink is paused, and probed at a fixed interval.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Final

from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.queue import PRIORITY, Parcel, Stream
from edge_server.outbox.retry import Backoff
from edge_server.outbox.states import Happening, State, follow

URGENT: Final = 1  # Alarms and mission reports: one worker is always free for them
FAIR_TURN: Final = 8  # Every so many free picks the oldest record goes, of any priority
BREAKER: Final = 5  # So many failures in a row, and it is not one stream's fault
PREFETCH: Final = 64
PREFETCH_IMAGES: Final = 2  # Up to 1.4 MB each


@dataclass(slots=True)
class _Lane:
    """One stream's records in memory."""

    waiting: deque[Parcel] = field(default_factory=deque)
    in_flight: Parcel | None = None
    not_before: float = 0.0
    failures: int = 0
    read_to: int = 0
    has_more: bool = True


class Schedule:
    """Which records are in flight, waiting or held back; times are monotonic seconds."""

    def __init__(
        self, *, backoff: Backoff, probe_interval_s: float, workers: int, random: Random
    ) -> None:
        self._backoff = backoff
        self._probe_interval_s = probe_interval_s
        self._workers = workers
        self._random = random
        self._lanes: dict[Stream, _Lane] = {}
        self._picks = 0
        self._flying = 0
        self._failures = 0  # In a row, over all streams
        self._blocks = 0  # Blocked probes in a row; 0 when the way is free
        self._not_before = 0.0
        self.paused = False

    @property
    def blocked(self) -> bool:
        """Whether only a probe may go."""
        return self._blocks > 0 or self.paused

    @property
    def flying(self) -> int:
        """How many records wait for an answer."""
        return self._flying

    def announce(self, streams: Iterable[Stream]) -> None:
        """Say that these streams have new rows."""
        for stream in streams:
            self._lanes.setdefault(stream, _Lane()).has_more = True

    def hungry(self) -> list[tuple[Stream, int, int]]:
        """Streams to read on: which, after which row, how many."""
        return [
            (stream, lane.read_to, PREFETCH_IMAGES if stream.kind == "image" else PREFETCH)
            for stream, lane in self._lanes.items()
            if lane.has_more and not lane.waiting
        ]

    def feed(self, stream: Stream, parcels: Sequence[Parcel], limit: int) -> None:
        """Take what was read of a stream."""
        lane = self._lanes[stream]
        flying = lane.in_flight.outbox_id if lane.in_flight else None
        lane.waiting.extend(p for p in parcels if p.outbox_id != flying)
        lane.has_more = len(parcels) == limit
        if parcels:
            lane.read_to = parcels[-1].outbox_id

    def rewind(self) -> None:
        """Forget what was read ahead: rows have been changed or deleted."""
        for lane in self._lanes.values():
            lane.waiting.clear()
            lane.read_to = 0
            lane.has_more = True

    def take(self, now: float) -> list[Parcel]:
        """Choose what goes out now; it is in flight from here on."""
        chosen = []
        while (stream := self._pick(now)) is not None:
            lane = self._lanes[stream]
            lane.in_flight = lane.waiting.popleft()
            self._flying += 1
            chosen.append(lane.in_flight)
        return chosen

    def _pick(self, now: float) -> Stream | None:
        if self.blocked and (self._flying or now < self._not_before):
            return None
        only_urgent = self._workers - self._flying == 1 and not self.blocked
        ready = [
            (PRIORITY[stream.kind], lane.waiting[0].outbox_id, stream)
            for stream, lane in self._lanes.items()
            if lane.waiting and lane.in_flight is None and lane.not_before <= now
        ]
        if only_urgent:
            ready = [entry for entry in ready if entry[0] <= URGENT]
        if not ready or self._flying >= self._workers:
            return None
        if not only_urgent and not self.blocked:
            self._picks += 1
            if self._picks % FAIR_TURN == 0:
                return min(ready, key=lambda entry: entry[1])[2]
        return min(ready)[2]

    def settle(self, parcel: Parcel, verdict: Verdict, now: float) -> Happening:
        """Take in what became of a record in flight."""
        lane = self._lanes[parcel.stream]
        lane.in_flight = None
        self._flying -= 1
        happening = _HAPPENING[verdict.meaning]
        if follow(State.IN_FLIGHT, happening) is State.QUEUED:
            lane.waiting.appendleft(parcel._replace(attempts=parcel.attempts + 1))
            self._put_off(lane, verdict, now)
        else:
            lane.failures = self._failures = self._blocks = 0
            self.paused = False
        return happening

    def _put_off(self, lane: _Lane, verdict: Verdict, now: float) -> None:
        if verdict.meaning is Meaning.NO_ACCESS:
            self.paused = True
            self._not_before = now + self._probe_interval_s
            return
        self.paused = False
        lane.failures += 1
        delay = self._backoff.delay_s(lane.failures, self._random, verdict.retry_after_s)
        lane.not_before = now + delay
        self._failures += 1
        if verdict.meaning is Meaning.NO_CLOUD or self._failures >= BREAKER:
            self._block(verdict, now)

    def _block(self, verdict: Verdict, now: float) -> None:
        if self._blocks and now < self._not_before:
            return  # An answer to a record that flew beside the one that found the way blocked
        self._blocks += 1
        self._not_before = now + self._backoff.delay_s(
            self._blocks, self._random, verdict.retry_after_s
        )

    def next_due(self, now: float) -> float | None:
        """When a record that is held back may go; None while none waits for a time.

        A record that could go now waits for a free worker, whose answer wakes us.
        """
        times = [
            lane.not_before
            for lane in self._lanes.values()
            if lane.waiting and lane.in_flight is None
        ]
        if not times or (self.blocked and self._flying):
            return None
        if self.blocked:
            return max(min(times), self._not_before)
        return min((moment for moment in times if moment > now), default=None)


_HAPPENING: Final = {
    Meaning.CONFIRMED: Happening.CONFIRMED,
    Meaning.TRY_LATER: Happening.PUT_OFF,
    Meaning.NO_CLOUD: Happening.PUT_OFF,
    Meaning.NO_ACCESS: Happening.REFUSED,
    Meaning.REJECTED: Happening.REJECTED,
}
