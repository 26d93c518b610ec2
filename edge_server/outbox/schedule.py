"""What to send next: the relay's decisions, without clock, network or database.

Streams do not block each other; within a stream one batch is in flight, its records in order. A
failure that is not due to one stream (no cloud, a captive portal, five failures in a row) opens the
circuit of the whole uplink: one probe at a time tests whether the cloud is reachable again, the
oldest alarm first. A kind for which the cloud has no endpoint has a circuit of its own. While the
cloud refuses our key the uplink is paused, and probed at a fixed interval.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Final, NamedTuple

from edge_server.outbox.answers import Outcome, Result
from edge_server.outbox.queue import PRIORITY, ROW_STATES, OutboxRecord, State, Stream, Trigger
from edge_server.outbox.retry import Backoff
from edge_server.outbox.uplink import ONE_BY_ONE, BatchLimit

URGENT: Final = 1  # Priority of alarms and mission reports: one worker is always free for them
FAIR_TURN: Final = 8  # Every so many free picks the oldest record is sent, of any priority
BREAKER: Final = 5  # After so many failures in a row the uplink is blocked, not only the stream
ENDPOINT_TRIES: Final = 10  # A record is tried so often while the cloud has no endpoint for it
PREFETCH: Final = 128
PREFETCH_IMAGES: Final = 2  # Up to 1.4 MB each

_CLOUD_ANSWERS: Final = frozenset({Outcome.CONFIRMED, Outcome.REJECTED, Outcome.NO_ENDPOINT})
"""The cloud has read our request, whatever it decided about the record."""
_TRIGGERS: Final = {
    Outcome.CONFIRMED: Trigger.CONFIRMED,
    Outcome.TRY_LATER: Trigger.PUT_OFF,
    Outcome.NO_CLOUD: Trigger.PUT_OFF,
    Outcome.NO_ACCESS: Trigger.REFUSED,
    Outcome.REJECTED: Trigger.REJECTED,
    Outcome.NO_ENDPOINT: Trigger.PUT_OFF,
    Outcome.HELD_BACK: Trigger.PUT_OFF,
}


class Batch(NamedTuple):
    """Records that are sent together; of each stream the next ones in order."""

    records: list[OutboxRecord]


@dataclass(slots=True)
class Circuit:
    """Failures in a row, and until when nothing is sent; then one probe at a time."""

    failures: int = 0
    not_before: float = 0.0


@dataclass(slots=True)
class StreamQueue:
    """The records of one stream that are in memory."""

    waiting: deque[OutboxRecord] = field(default_factory=deque)
    in_flight: dict[int, str] = field(default_factory=dict)  # message_id by row id
    settled_to: int = 0  # The newest row that was confirmed or rejected
    circuit: Circuit = field(default_factory=Circuit)
    read_to: int = 0
    has_more: bool = True


_CLOSED: Final = Circuit()


def only_behind_others(records: Sequence[OutboxRecord], results: Sequence[Result]) -> list[Result]:
    """Accept "held back" only for a record behind another one of its stream.

    The first record of a stream has none to wait for: a cloud that answers 424 to it does not
    accept it now, and it is retried later.
    """
    seen: set[Stream] = set()
    accepted = []
    for record, result in zip(records, results, strict=True):
        is_first = record.stream not in seen
        seen.add(record.stream)
        if is_first and result.outcome is Outcome.HELD_BACK:
            reason = "424 to a record with none before it"
            accepted.append(result._replace(outcome=Outcome.TRY_LATER, reason=reason))
        else:
            accepted.append(result)
    return accepted


def trigger_of(record: OutboxRecord, result: Result) -> Trigger:
    """Return what a result does to the row of a record that is in flight."""
    if result.outcome is Outcome.NO_ENDPOINT and record.attempts + 1 >= ENDPOINT_TRIES:
        return Trigger.REJECTED
    return _TRIGGERS[result.outcome]


class Schedule:
    """Which records are in flight, waiting or held back; times are monotonic seconds."""

    def __init__(
        self, *, backoff: Backoff, probe_interval_s: float, workers: int, random: Random
    ) -> None:
        self._backoff = backoff
        self._probe_interval_s = probe_interval_s
        self._workers = workers
        self._random = random
        self._queues: dict[Stream, StreamQueue] = {}
        self._kinds: dict[str, Circuit] = {}  # Kinds without an endpoint
        self._uplink = Circuit()
        self._picks = 0
        self._batches_in_flight = 0
        self._failures = 0  # Batches in a row, over all streams
        self.paused = False

    @property
    def blocked(self) -> bool:
        """Whether only a probe may be sent."""
        return self._uplink.failures > 0 or self.paused

    @property
    def batches_in_flight(self) -> int:
        """How many batches wait for an answer."""
        return self._batches_in_flight

    def announce(self, streams: Iterable[Stream]) -> None:
        """Note that these streams have new rows."""
        for stream in streams:
            self._queues.setdefault(stream, StreamQueue()).has_more = True

    def to_read(self) -> list[tuple[Stream, int, int]]:
        """Return the streams to read from the database: which, after which row, how many rows."""
        return [
            (stream, queue.read_to, PREFETCH_IMAGES if stream.kind == "image" else PREFETCH)
            for stream, queue in self._queues.items()
            if queue.has_more and not queue.waiting
        ]

    def feed(self, stream: Stream, records: Sequence[OutboxRecord], limit: int) -> None:
        """Add the records that were read of a stream; `limit` is how many were requested."""
        queue = self._queues[stream]
        in_flight = queue.in_flight.items()
        # A record that was corrected while it is in flight is sent again, as a new message
        queue.waiting.extend(
            one for one in records if (one.outbox_id, one.message_id) not in in_flight
        )
        queue.has_more = len(records) == limit
        if records:
            queue.read_to = records[-1].outbox_id

    def rewind(self) -> None:
        """Drop what was read ahead: rows have been changed or deleted."""
        for queue in self._queues.values():
            queue.waiting.clear()
            queue.read_to = 0
            queue.has_more = True

    def busy(self) -> set[Stream]:
        """Streams with records that are read or in flight."""
        return {stream for stream, one in self._queues.items() if one.waiting or one.in_flight}

    def in_flight(self) -> set[Stream]:
        """Streams with records in flight."""
        return {stream for stream, one in self._queues.items() if one.in_flight}

    def drop(self, streams: Iterable[Stream]) -> None:
        """Send no more of these streams: another relay does."""
        for stream in streams:
            queue = self._queues.get(stream)
            if queue is not None and queue.in_flight:
                queue.waiting.clear()
                queue.has_more = False
            else:
                self._queues.pop(stream, None)

    def take(self, now: float, limit: BatchLimit = ONE_BY_ONE) -> list[Batch]:
        """Choose what to send now, filled up to the limit; it is in flight from here on."""
        chosen = []
        while ready := self._ready(now):
            first = self._choose(ready)
            batch = Batch([self._pop(first)])
            if limit.records > 1 and not self._is_sent_alone(first):
                self._fill(batch, first, ready, limit)
            self._batches_in_flight += 1
            chosen.append(batch)
        return chosen

    def _ready(self, now: float) -> list[Stream]:
        """Streams whose next record may be sent now."""
        if self._batches_in_flight >= self._workers:
            return []
        if self.blocked and (self._batches_in_flight or now < self._uplink.not_before):
            return []
        only_urgent = self._only_urgent()
        return [
            stream
            for stream, queue in self._queues.items()
            if queue.waiting
            and not queue.in_flight
            and queue.circuit.not_before <= now
            and not (only_urgent and PRIORITY[stream.kind] > URGENT)
            and self._kind_may_be_sent(stream.kind, now)
        ]

    def _only_urgent(self) -> bool:
        return self._workers - self._batches_in_flight == 1 and not self.blocked

    def _kind_may_be_sent(self, kind: str, now: float) -> bool:
        circuit = self._kinds.get(kind)
        if circuit is None:
            return True
        probing = any(one.in_flight for stream, one in self._queues.items() if stream.kind == kind)
        return now >= circuit.not_before and not probing

    def _choose(self, ready: Iterable[Stream]) -> Stream:
        if self.blocked:
            return min(ready, key=self._probe_rank)
        if not self._only_urgent():
            self._picks += 1
            if self._picks % FAIR_TURN == 0:
                return min(ready, key=self._head)
        return min(ready, key=self._rank)

    def _head(self, stream: Stream) -> int:
        return self._queues[stream].waiting[0].outbox_id

    def _rank(self, stream: Stream) -> tuple[int, int]:
        return PRIORITY[stream.kind], self._head(stream)

    def _probe_rank(self, stream: Stream) -> tuple[int, bool, int]:
        """Rank of a stream as a probe: the oldest alarm, else the oldest record.

        A stream with a record on which the cloud fails comes last.
        """
        failures = self._queues[stream].circuit.failures
        return failures, PRIORITY[stream.kind] > 0, self._head(stream)

    def _is_sent_alone(self, stream: Stream) -> bool:
        return self.blocked or stream.kind == "image" or stream.kind in self._kinds

    def _pop(self, stream: Stream) -> OutboxRecord:
        queue = self._queues[stream]
        record = queue.waiting.popleft()
        queue.in_flight[record.outbox_id] = record.message_id
        return record

    def _fill(self, batch: Batch, first: Stream, ready: list[Stream], limit: BatchLimit) -> None:
        """Add more of the same stream, then of the others by rank, while there is room."""
        room = limit.size_bytes - batch.records[0].size_bytes
        for stream in [first, *sorted((s for s in ready if s != first), key=self._rank)]:
            queue = self._queues[stream]
            if stream != first and self._is_sent_alone(stream):
                continue
            while queue.waiting and len(batch.records) < limit.records:
                room -= queue.waiting[0].size_bytes
                if room < 0:
                    return
                batch.records.append(self._pop(stream))

    def settle(self, batch: Batch, results: Sequence[Result], now: float) -> list[Trigger]:
        """Handle the results of a batch, one for each of its records; returns what they trigger."""
        self._batches_in_flight -= 1
        triggers = []
        for record, result in zip(batch.records, results, strict=True):
            del self._queues[record.stream].in_flight[record.outbox_id]
            triggers.append(trigger_of(record, result))
        for record, result, trigger in reversed(
            list(zip(batch.records, results, triggers, strict=True))
        ):
            queue = self._queues[record.stream]
            if ROW_STATES.follow(State.IN_FLIGHT, trigger) is not State.QUEUED:
                queue.settled_to = max(queue.settled_to, record.outbox_id)
            elif all(one.outbox_id != record.outbox_id for one in queue.waiting):
                tried = result.outcome is not Outcome.HELD_BACK
                again = record._replace(attempts=record.attempts + tried)
                queue.waiting.appendleft(again)
        self._update_circuits(batch, results, now)
        return triggers

    def is_overtaken(self, record: OutboxRecord) -> bool:
        """Whether a later record of its stream is in flight, or was confirmed or rejected."""
        queue = self._queues.get(record.stream)
        if queue is None:
            return False
        return max(queue.in_flight, default=0) > record.outbox_id or (
            queue.settled_to > record.outbox_id
        )

    def _update_circuits(self, batch: Batch, results: Sequence[Result], now: float) -> None:
        """Open and close circuits after a batch."""
        by_outcome = {result.outcome: result for result in reversed(results)}
        if by_outcome.keys() & _CLOUD_ANSWERS:
            self._failures = self._uplink.failures = 0
            self.paused = False
        elif Outcome.TRY_LATER in by_outcome:
            self._failures += 1
        self._update_stream_circuits(batch, results, now)
        if Outcome.NO_ACCESS in by_outcome:
            self.paused = True
            self._uplink.not_before = now + self._probe_interval_s
            return
        failed = by_outcome.get(Outcome.NO_CLOUD)
        if failed is None and self._failures >= BREAKER:
            failed = by_outcome.get(Outcome.TRY_LATER)
        if failed is not None:
            self._block(failed, now)
        if by_outcome.keys() - {Outcome.HELD_BACK}:
            self.paused = False

    def _update_stream_circuits(self, batch: Batch, results: Sequence[Result], now: float) -> None:
        """Count one failure per stream and kind, however many records of them failed."""
        failed: dict[int, tuple[Circuit, Result]] = {}
        for record, result in zip(batch.records, results, strict=True):
            queue, kind = self._queues[record.stream], record.stream.kind
            if result.outcome in {Outcome.CONFIRMED, Outcome.REJECTED}:
                queue.circuit.failures = 0
                self._kinds.pop(kind, None)
            elif result.outcome is Outcome.TRY_LATER:
                failed.setdefault(id(queue.circuit), (queue.circuit, result))
            elif result.outcome is Outcome.NO_ENDPOINT:
                circuit = self._kinds.setdefault(kind, Circuit())
                failed.setdefault(id(circuit), (circuit, result))
        for circuit, result in failed.values():
            self._open(circuit, result, now)

    def _block(self, result: Result, now: float) -> None:
        if self._uplink.failures and now < self._uplink.not_before:
            return  # The batch was in flight beside the one that found the uplink blocked
        self._open(self._uplink, result, now)

    def _open(self, circuit: Circuit, result: Result, now: float) -> None:
        circuit.failures += 1
        circuit.not_before = now + self._backoff.delay_s(
            circuit.failures, self._random, result.retry_after_s
        )

    def next_due(self, now: float) -> float | None:
        """When a record that is held back may be sent; None while none waits for a time.

        A record that could be sent now waits for a free worker, whose answer wakes the relay.
        """
        if self.blocked and self._batches_in_flight:
            return None
        times = [
            self._due(stream, queue)
            for stream, queue in self._queues.items()
            if queue.waiting and not queue.in_flight
        ]
        return min((moment for moment in times if moment > now), default=None)

    def _due(self, stream: Stream, queue: StreamQueue) -> float:
        kind = self._kinds.get(stream.kind, _CLOSED).not_before
        uplink = self._uplink.not_before if self.blocked else 0.0
        return max(kind, uplink, queue.circuit.not_before)
