"""What to send next: the relay's decisions, without clock, network or database.

Streams do not block each other; within a stream one shipment is under way, its records in order.
A failure that is not one stream's (no cloud, a captive portal, five failures in a row) opens the
circuit of the whole uplink: a single probe at a time finds out whether the way is free again, the
oldest alarm first. A kind that the cloud has no place for has a circuit of its own. While the
cloud refuses our key the uplink is paused, and probed at a fixed interval.
"""

from collections.abc import Iterable, Sequence
from random import Random
from typing import Final, NamedTuple

from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.lanes import Circuit, Lane, happening_of
from edge_server.outbox.queue import PRIORITY, Parcel, Stream
from edge_server.outbox.retry import Backoff
from edge_server.outbox.states import Happening, State, follow
from edge_server.outbox.uplink import ONE_BY_ONE, Offer

URGENT: Final = 1  # Alarms and mission reports: one worker is always free for them
FAIR_TURN: Final = 8  # Every so many free picks the oldest record goes, of any priority
BREAKER: Final = 5  # So many failures in a row, and it is not one stream's fault
PREFETCH: Final = 128
PREFETCH_IMAGES: Final = 2  # Up to 1.4 MB each

_FREE: Final = Circuit()
_ALIVE: Final = frozenset({Meaning.CONFIRMED, Meaning.REJECTED, Meaning.NO_PLACE})
"""The cloud has understood us, whatever it says of the record."""


class Shipment(NamedTuple):
    """Records that go together; of each stream the next ones in order."""

    parcels: list[Parcel]


class Schedule:
    """Which records are in flight, waiting or held back; times are monotonic seconds."""

    def __init__(
        self, *, backoff: Backoff, probe_interval_s: float, workers: int, random: Random
    ) -> None:
        self._backoff = backoff
        self._probe_interval_s = probe_interval_s
        self._workers = workers
        self._random = random
        self._lanes: dict[Stream, Lane] = {}
        self._kinds: dict[str, Circuit] = {}  # Those without a place, by kind
        self._uplink = Circuit()
        self._picks = 0
        self._flying = 0
        self._failures = 0  # Shipments in a row, over all streams
        self.paused = False

    @property
    def blocked(self) -> bool:
        """Whether only a probe may go."""
        return self._uplink.failures > 0 or self.paused

    @property
    def flying(self) -> int:
        """How many shipments wait for an answer."""
        return self._flying

    def announce(self, streams: Iterable[Stream]) -> None:
        """Say that these streams have new rows."""
        for stream in streams:
            self._lanes.setdefault(stream, Lane()).has_more = True

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
        lane.waiting.extend(p for p in parcels if p.outbox_id not in lane.flying)
        lane.has_more = len(parcels) == limit
        if parcels:
            lane.read_to = parcels[-1].outbox_id

    def rewind(self) -> None:
        """Forget what was read ahead: rows have been changed or deleted."""
        for lane in self._lanes.values():
            lane.waiting.clear()
            lane.read_to = 0
            lane.has_more = True

    def busy(self) -> set[Stream]:
        """Streams of which something is read or under way."""
        return {stream for stream, lane in self._lanes.items() if lane.waiting or lane.flying}

    def in_flight(self) -> set[Stream]:
        """Streams of which something is under way."""
        return {stream for stream, lane in self._lanes.items() if lane.flying}

    def forget(self, streams: Iterable[Stream]) -> None:
        """Send no more of these: another relay does."""
        for stream in streams:
            lane = self._lanes.get(stream)
            if lane is not None and lane.flying:
                lane.waiting.clear()
                lane.has_more = False
            else:
                self._lanes.pop(stream, None)

    def take(self, now: float, offer: Offer = ONE_BY_ONE) -> list[Shipment]:
        """Choose what goes out now, filled up to what is offered; it is in flight from here on."""
        chosen = []
        while ready := self._ready(now):
            first = self._choose(ready)
            shipment = Shipment([self._pop(first)])
            if offer.records > 1 and not self._travels_alone(first):
                self._fill(shipment, first, ready, offer)
            self._flying += 1
            chosen.append(shipment)
        return chosen

    def _ready(self, now: float) -> list[Stream]:
        """Streams whose next record may go now."""
        if self._flying >= self._workers:
            return []
        if self.blocked and (self._flying or now < self._uplink.not_before):
            return []
        only_urgent = self._only_urgent()
        return [
            stream
            for stream, lane in self._lanes.items()
            if lane.waiting
            and not lane.flying
            and lane.circuit.not_before <= now
            and not (only_urgent and PRIORITY[stream.kind] > URGENT)
            and self._kind_may_go(stream.kind, now)
        ]

    def _only_urgent(self) -> bool:
        return self._workers - self._flying == 1 and not self.blocked

    def _kind_may_go(self, kind: str, now: float) -> bool:
        circuit = self._kinds.get(kind)
        if circuit is None:
            return True
        probing = any(lane.flying for stream, lane in self._lanes.items() if stream.kind == kind)
        return now >= circuit.not_before and not probing

    def _choose(self, ready: Iterable[Stream]) -> Stream:
        if self.blocked:
            return min(ready, key=self._worth_as_probe)
        if not self._only_urgent():
            self._picks += 1
            if self._picks % FAIR_TURN == 0:
                return min(ready, key=self._head)
        return min(ready, key=self._rank)

    def _head(self, stream: Stream) -> int:
        return self._lanes[stream].waiting[0].outbox_id

    def _rank(self, stream: Stream) -> tuple[int, int]:
        return PRIORITY[stream.kind], self._head(stream)

    def _worth_as_probe(self, stream: Stream) -> tuple[int, bool, int]:
        """The oldest alarm, else the oldest record, but none that the cloud itself fails on."""
        failures = self._lanes[stream].circuit.failures
        return failures, PRIORITY[stream.kind] > 0, self._head(stream)

    def _travels_alone(self, stream: Stream) -> bool:
        return self.blocked or stream.kind == "image" or stream.kind in self._kinds

    def _pop(self, stream: Stream) -> Parcel:
        lane = self._lanes[stream]
        parcel = lane.waiting.popleft()
        lane.flying.append(parcel.outbox_id)
        return parcel

    def _fill(self, shipment: Shipment, first: Stream, ready: list[Stream], offer: Offer) -> None:
        """Add more of the same stream, then of the others by rank, while there is room."""
        room = offer.size_bytes - shipment.parcels[0].size_bytes
        for stream in [first, *sorted((s for s in ready if s != first), key=self._rank)]:
            lane = self._lanes[stream]
            if stream != first and self._travels_alone(stream):
                continue
            while lane.waiting and len(shipment.parcels) < offer.records:
                room -= lane.waiting[0].size_bytes
                if room < 0:
                    return
                shipment.parcels.append(self._pop(stream))

    def settle(
        self, shipment: Shipment, verdicts: Sequence[Verdict], now: float
    ) -> list[Happening]:
        """Take in what became of a shipment, a verdict for each of its records."""
        self._flying -= 1
        happenings = []
        for parcel, verdict in zip(shipment.parcels, verdicts, strict=True):
            self._lanes[parcel.stream].flying.remove(parcel.outbox_id)
            happenings.append(happening_of(parcel, verdict))
        for parcel, verdict, happening in reversed(
            list(zip(shipment.parcels, verdicts, happenings, strict=True))
        ):
            if follow(State.IN_FLIGHT, happening) is State.QUEUED:
                tried = verdict.meaning is not Meaning.HELD_BACK
                again = parcel._replace(attempts=parcel.attempts + tried)
                self._lanes[parcel.stream].waiting.appendleft(again)
        self._learn(shipment, verdicts, now)
        return happenings

    def _learn(self, shipment: Shipment, verdicts: Sequence[Verdict], now: float) -> None:
        """Open and close circuits after a shipment."""
        said = {verdict.meaning: verdict for verdict in reversed(verdicts)}
        if said.keys() & _ALIVE:
            self._failures = self._uplink.failures = 0
            self.paused = False
        elif Meaning.TRY_LATER in said:
            self._failures += 1
        self._learn_of_streams(shipment, verdicts, now)
        if Meaning.NO_ACCESS in said:
            self.paused = True
            self._uplink.not_before = now + self._probe_interval_s
            return
        if (silent := said.get(Meaning.NO_CLOUD)) is not None:
            self._block(silent, now)
        elif self._failures >= BREAKER and (failed := said.get(Meaning.TRY_LATER)) is not None:
            self._block(failed, now)
        if said.keys() - {Meaning.HELD_BACK}:
            self.paused = False

    def _learn_of_streams(
        self, shipment: Shipment, verdicts: Sequence[Verdict], now: float
    ) -> None:
        """Count one failure per stream and kind, however many records have met it."""
        failed: dict[int, tuple[Circuit, Verdict]] = {}
        for parcel, verdict in zip(shipment.parcels, verdicts, strict=True):
            lane, kind = self._lanes[parcel.stream], parcel.stream.kind
            if verdict.meaning in {Meaning.CONFIRMED, Meaning.REJECTED}:
                lane.circuit.failures = 0
                self._kinds.pop(kind, None)
            elif verdict.meaning is Meaning.TRY_LATER:
                failed.setdefault(id(lane.circuit), (lane.circuit, verdict))
            elif verdict.meaning is Meaning.NO_PLACE:
                circuit = self._kinds.setdefault(kind, Circuit())
                failed.setdefault(id(circuit), (circuit, verdict))
        for circuit, verdict in failed.values():
            self._open(circuit, verdict, now)

    def _block(self, verdict: Verdict, now: float) -> None:
        if self._uplink.failures and now < self._uplink.not_before:
            return  # An answer to a record that flew beside the one that found the way blocked
        self._open(self._uplink, verdict, now)

    def _open(self, circuit: Circuit, verdict: Verdict, now: float) -> None:
        circuit.failures += 1
        circuit.not_before = now + self._backoff.delay_s(
            circuit.failures, self._random, verdict.retry_after_s
        )

    def next_due(self, now: float) -> float | None:
        """When a record that is held back may go; None while none waits for a time.

        A record that could go now waits for a free worker, whose answer wakes us.
        """
        if self.blocked and self._flying:
            return None
        times = [
            self._due(stream, lane)
            for stream, lane in self._lanes.items()
            if lane.waiting and not lane.flying
        ]
        return min((moment for moment in times if moment > now), default=None)

    def _due(self, stream: Stream, lane: Lane) -> float:
        kind = self._kinds.get(stream.kind, _FREE).not_before
        uplink = self._uplink.not_before if self.blocked else 0.0
        return max(kind, uplink, lane.circuit.not_before)
