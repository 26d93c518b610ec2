"""Records on their way: which may go, which wait for an answer, which have theirs; sans-IO.

A record's answer is the cloud's (request and response of MQTT 5.0 section 4.10), told apart by
the message_id; the broker's acknowledgement settles a record only when it refuses it, or when it
was agreed that its word is enough. Of each lane, which is one stream, one record is under way:
the next one goes when the one before it has arrived or will never be taken.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from edge_server.outbox.answers import Answer, Meaning, Reply, Unreachable, judge
from edge_server.outbox.uplink import HELD_BACK
from edge_server.uplinks import mqtt_reasons
from edge_server.uplinks.mqtt_answers import read_answer
from edge_server.uplinks.mqtt_messages import Limits, RecordPacket

_THE_NEXT_GOES_ON: Final = frozenset({Meaning.CONFIRMED, Meaning.REJECTED})


class Settled(NamedTuple):
    """A record and what became of it."""

    key: str
    reply: Reply


@dataclass(slots=True)
class _Pending:
    """A record whose turn it is; times are monotonic seconds."""

    packet: RecordPacket
    deadline: float
    packet_id: int | None = None  # Once it is sent


class Exchange:
    """All records that were offered and are not settled."""

    def __init__(self, *, patience_s: float) -> None:
        self._patience_s = patience_s
        self._limits = Limits()
        self._behind: dict[str, deque[RecordPacket]] = {}  # By lane: not their turn yet
        self._waiting: deque[str] = deque()  # Their turn, not sent yet
        self._pending: dict[str, _Pending] = {}  # Their turn, in the order of their deadlines
        self._unacknowledged: dict[int, str | None] = {}  # What counts against the receive maximum
        self._settled: list[Settled] = []
        self._sent_at = 0.0  # When the last one went out

    @property
    def idle(self) -> bool:
        """Whether nothing waits for anything."""
        return not self._pending

    def offer(self, packet: RecordPacket, now: float) -> None:
        """Take a record; it is settled in one way or another.

        Our patience is for its answer once it is sent, and before that as long as others are sent.
        """
        behind = self._behind.get(packet.lane)
        if behind is not None:
            behind.append(packet)
        else:
            self._behind[packet.lane] = deque()
            self._call_up(packet, now)

    def _call_up(self, packet: RecordPacket, now: float) -> None:
        self._pending[packet.key] = _Pending(packet, now + self._patience_s)
        self._waiting.append(packet.key)

    def begin(self, limits: Limits) -> None:
        """Start on a new connection, which knows nothing of earlier ones."""
        self._limits = limits
        self._unacknowledged.clear()

    def take(self, now: float) -> list[RecordPacket]:
        """Choose what is sent now, in the order of the offers."""
        chosen: list[RecordPacket] = []
        while self._waiting and self._has_room(len(chosen)):
            packet = self._pending[self._waiting.popleft()].packet
            if packet.size_bytes() > self._limits.packet_bytes:
                self._settle(packet.key, Answer(413), now)
            else:
                chosen.append(packet)
        return chosen

    def _has_room(self, chosen: int) -> bool:
        return len(self._unacknowledged) + chosen < self._limits.receive_maximum

    def sent(self, key: str, packet_id: int, now: float) -> None:
        """Note under which packet identifier a record went out."""
        self._unacknowledged[packet_id] = key
        self._sent_at = now
        self._pending[key].packet_id = packet_id
        self._extend(key, now)

    def _extend(self, key: str, since: float) -> None:
        pending = self._pending.pop(key)
        pending.deadline = since + self._patience_s
        self._pending[key] = pending

    def occupied(self, packet_id: int) -> None:
        """Note a packet that is no record; the broker's room is less by it."""
        self._unacknowledged[packet_id] = None

    def acknowledged(self, packet_id: int, code: int, now: float) -> None:
        """Take in the broker's acknowledgement."""
        key = self._unacknowledged.pop(packet_id, None)
        pending = self._pending.get(key) if key is not None else None
        if pending is None or pending.packet_id != packet_id:
            return  # Settled already, or an earlier try of a record that is under way again
        if code != mqtt_reasons.SUCCESS or pending.packet.answers_topic is None:
            self._settle(pending.packet.key, mqtt_reasons.of_record(code), now)

    def answered(self, correlation: bytes, payload: bytes, now: float) -> None:
        """Take in an answer of the cloud; a second one, or one to nobody, changes nothing."""
        key = correlation.decode("ascii", "replace")
        pending = self._pending.get(key)
        if pending is not None and pending.packet_id is not None:
            self._settle(key, read_answer(key, payload), now)

    def tick(self, now: float) -> None:
        """Give up what has waited too long: no answer in time."""
        late = []
        for key, pending in list(self._pending.items()):
            if pending.deadline > now:
                break
            if pending.packet_id is None and self._sent_at + self._patience_s > now:
                self._extend(key, self._sent_at)  # The broker takes few at a time, but it does
            else:
                late.append(key)
        if late:
            self._waiting = deque(key for key in self._waiting if key not in late)
            self._settle_all(late, Unreachable("no answer in time"), now)

    def next_deadline(self) -> float | None:
        """When the oldest record's patience ends."""
        return next((pending.deadline for pending in self._pending.values()), None)

    def lost(self, reply: Reply, now: float, *, too_large: bool = False) -> None:
        """End with a connection: everything that was under way gets the same answer.

        A broker that closes over a packet that is too large does not say which; if any was, the
        largest one was.
        """
        largest = self.largest_sent() if too_large else None
        self._waiting.clear()
        self._unacknowledged.clear()
        under_way = list(self._pending)
        for key in under_way:
            self._settle(key, Answer(413) if key == largest else reply, now)
        if largest is not None:  # Those behind it were called up, and have not been sent
            self._waiting.clear()
            self._settle_all(list(self._pending), reply, now)

    def largest_sent(self, least_bytes: int = 0) -> str | None:
        """Key of the largest packet that is under way, if it has so many bytes."""
        sent = [
            pending.packet
            for pending in self._pending.values()
            if pending.packet_id is not None and pending.packet.size_bytes() >= least_bytes
        ]
        return max(sent, key=RecordPacket.size_bytes).key if sent else None

    def settled(self) -> list[Settled]:
        """Hand over what has been settled since the last call."""
        done, self._settled = self._settled, []
        return done

    def _settle_all(self, keys: Iterable[str], reply: Reply, now: float) -> None:
        for key in keys:
            self._settle(key, reply, now)

    def _settle(self, key: str, reply: Reply, now: float) -> None:
        """Settle a record, and with it those behind it: the next one's turn, or all held back."""
        lane = self._pending.pop(key).packet.lane
        self._settled.append(Settled(key, reply))
        behind = self._behind[lane]
        if behind and judge(reply).meaning in _THE_NEXT_GOES_ON:
            self._call_up(behind.popleft(), now)
            return
        del self._behind[lane]
        self._settled += [Settled(packet.key, HELD_BACK) for packet in behind]
