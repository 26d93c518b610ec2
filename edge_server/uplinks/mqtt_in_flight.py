"""Records between `submit` and their reply: queued, sent, answered; sans-IO.

A record's reply is the cloud's answer (request and response of MQTT 5.0 section 4.10), identified
by the message_id. The broker's acknowledgement settles a record only if it refuses the record, or
if the configuration makes the acknowledgement the confirmation. Of the packets with the same order
key, which are those of one stream, one is in flight: the next one is sent when it has been
delivered or will never be accepted.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from edge_server.outbox.answers import Answer, Outcome, Reply, Unreachable, classify
from edge_server.outbox.uplink import HELD_BACK
from edge_server.uplinks import mqtt_protocol
from edge_server.uplinks.mqtt_protocol import Limits, RecordPacket

_NEXT_IS_SENT: Final = frozenset({Outcome.CONFIRMED, Outcome.REJECTED})


class SettledRecord(NamedTuple):
    """A record's key and its reply."""

    key: str
    reply: Reply


@dataclass(slots=True)
class _Pending:
    """The first record of its order key; times are monotonic seconds."""

    packet: RecordPacket
    deadline: float
    packet_id: int | None = None  # Once it is sent


class InFlight:
    """All records that were submitted and are not settled."""

    def __init__(self, *, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._limits = Limits()
        self._behind: dict[str, deque[RecordPacket]] = {}  # By order key: behind a pending one
        self._to_send: deque[str] = deque()  # Pending, not sent yet
        self._pending: dict[str, _Pending] = {}  # In the order of their deadlines
        self._unacknowledged: dict[int, str | None] = {}  # Packets that count as received
        self._settled: list[SettledRecord] = []
        self._sent_at = 0.0  # When the last one was sent

    @property
    def idle(self) -> bool:
        """Whether no record is pending."""
        return not self._pending

    def submit(self, packet: RecordPacket, now: float) -> None:
        """Add a record, which is settled in any case.

        It times out when it has had no answer for `timeout_s` since it was sent, or when nothing
        has been sent for so long while it waited.
        """
        behind = self._behind.get(packet.order_key)
        if behind is not None:
            behind.append(packet)
        else:
            self._behind[packet.order_key] = deque()
            self._make_pending(packet, now)

    def _make_pending(self, packet: RecordPacket, now: float) -> None:
        self._pending[packet.key] = _Pending(packet, now + self._timeout_s)
        self._to_send.append(packet.key)

    def begin(self, limits: Limits) -> None:
        """Start on a new connection, which has no state of earlier ones."""
        self._limits = limits
        self._unacknowledged.clear()

    def take(self, now: float) -> list[RecordPacket]:
        """Choose what is sent now, in the order of submission."""
        chosen: list[RecordPacket] = []
        while self._to_send and self._has_room(len(chosen)):
            packet = self._pending[self._to_send.popleft()].packet
            if packet.size_bytes() > self._limits.packet_bytes:
                self._settle(packet.key, Answer(413), now)
            else:
                chosen.append(packet)
        return chosen

    def _has_room(self, chosen: int) -> bool:
        return len(self._unacknowledged) + chosen < self._limits.receive_maximum

    def sent(self, key: str, packet_id: int, now: float) -> None:
        """Note the packet identifier under which a record was sent."""
        self._unacknowledged[packet_id] = key
        self._sent_at = now
        self._pending[key].packet_id = packet_id
        self._extend(key, now)

    def _extend(self, key: str, since: float) -> None:
        pending = self._pending.pop(key)
        pending.deadline = since + self._timeout_s
        self._pending[key] = pending

    def sent_other(self, packet_id: int) -> None:
        """Note a packet that is no record; it counts against the receive maximum too."""
        self._unacknowledged[packet_id] = None

    def acknowledged(self, packet_id: int, code: int, now: float) -> None:
        """Handle the broker's acknowledgement."""
        key = self._unacknowledged.pop(packet_id, None)
        pending = self._pending.get(key) if key is not None else None
        if pending is None or pending.packet_id != packet_id:
            return  # Settled already, or an earlier attempt of a record that is in flight again
        if code != mqtt_protocol.SUCCESS or pending.packet.answers_topic is None:
            self._settle(pending.packet.key, mqtt_protocol.reply_to_record(code), now)

    def answered(self, correlation: bytes, payload: bytes, now: float) -> None:
        """Handle an answer of the cloud; a second one, or one for no record here, is ignored."""
        key = correlation.decode("ascii", "replace")
        pending = self._pending.get(key)
        if pending is not None and pending.packet_id is not None:
            self._settle(key, mqtt_protocol.read_answer(key, payload), now)

    def tick(self, now: float) -> None:
        """Settle what has timed out."""
        late = []
        for key, pending in list(self._pending.items()):
            if pending.deadline > now:
                break
            if pending.packet_id is None and self._sent_at + self._timeout_s > now:
                self._extend(key, self._sent_at)  # The broker accepts few at a time, but it does
            else:
                late.append(key)
        if late:
            self._to_send = deque(key for key in self._to_send if key not in late)
            self._settle_all(late, Unreachable("no answer in time"), now)

    def next_deadline(self) -> float | None:
        """When the oldest pending record times out."""
        return next((pending.deadline for pending in self._pending.values()), None)

    def connection_lost(self, reply: Reply, now: float, *, too_large: bool = False) -> None:
        """Settle everything with the same reply.

        A broker that closes the connection because a packet is too large does not say which; the
        largest one is taken for it.
        """
        largest = self.largest_sent() if too_large else None
        self._to_send.clear()
        self._unacknowledged.clear()
        for key in list(self._pending):
            self._settle(key, Answer(413) if key == largest else reply, now)
        if largest is not None:  # Those behind it have become pending, and have not been sent
            self._to_send.clear()
            self._settle_all(list(self._pending), reply, now)

    def largest_sent(self, minimum_bytes: int = 0) -> str | None:
        """Key of the largest packet in flight, if it has at least so many bytes."""
        sent = [
            pending.packet
            for pending in self._pending.values()
            if pending.packet_id is not None and pending.packet.size_bytes() >= minimum_bytes
        ]
        return max(sent, key=RecordPacket.size_bytes).key if sent else None

    def take_settled(self) -> list[SettledRecord]:
        """Return what has been settled since the last call."""
        done, self._settled = self._settled, []
        return done

    def _settle_all(self, keys: Iterable[str], reply: Reply, now: float) -> None:
        for key in keys:
            self._settle(key, reply, now)

    def _settle(self, key: str, reply: Reply, now: float) -> None:
        """Settle a record; of those behind it the next becomes pending, or all are held back."""
        order_key = self._pending.pop(key).packet.order_key
        self._settled.append(SettledRecord(key, reply))
        behind = self._behind[order_key]
        if behind and classify(reply).outcome in _NEXT_IS_SENT:
            self._make_pending(behind.popleft(), now)
            return
        del self._behind[order_key]
        self._settled += [SettledRecord(packet.key, HELD_BACK) for packet in behind]
