"""Requests of a file transfer that wait for their answers: numbered, repeated, told apart.

A repetition keeps its number, so that a server gives the answer that was lost instead of doing
the thing twice. While answers to other requests come, it is repeated after one timeout each time:
the link loses, it is not away. In a silence the pauses double after a while.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from mavlink_broker.ftp.packets import (
    ACK,
    BURST,
    CHECKSUM,
    OPEN,
    TERMINATE,
    Packet,
    request,
)
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.round_trip import LONGEST_TIMEOUT_S, RoundTrip

ATTEMPTS: Final = 20
"""Requests in a row without an answer: at 20 % loss each way, one transfer in 10^9."""
_ATTEMPTS_OF: Final = {OPEN: 8, BURST: 8, CHECKSUM: 8, TERMINATE: 3}
HEARD_WITHIN: Final = 2.0
"""Timeouts since the last answer to any request, after which the link is taken for silent."""
SAME_PATIENCE: Final = 3
"""Repetitions in a silence before the pauses double: three lost frames are no outage."""
CHECK_TIMEOUT_S: Final = 3.0
"""A slow card takes that long to be read through."""


@dataclass(slots=True)
class Ask:
    """One request on its way."""

    packet: Packet
    sent_at: float
    due_at: float
    attempts: int = 1

    @property
    def is_spent(self) -> bool:
        """Whether it is not worth another repetition."""
        return self.attempts >= _ATTEMPTS_OF.get(self.packet.opcode, ATTEMPTS)


class Asks:
    """All requests of one transfer; the round trip is the file server's own."""

    def __init__(self, route: Route, first_seq: int) -> None:
        self._route = route
        self._pending: dict[int, Ask] = {}
        self._heard_at = -math.inf
        self.round_trip = RoundTrip()
        self.next_seq = first_seq & 0xFFFF

    def __len__(self) -> int:
        return len(self._pending)

    def count(self, opcode: int) -> int:
        """How many requests of a kind wait for their answers."""
        return sum(ask.packet.opcode == opcode for ask in self._pending.values())

    def offsets(self, opcode: int) -> set[int]:
        """Where the data begin that requests of a kind ask for."""
        asks = self._pending.values()
        return {ask.packet.offset for ask in asks if ask.packet.opcode == opcode}

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
        """Make the next request; `size` counts where there are no data to send along."""
        seq, self.next_seq = self.next_seq, (self.next_seq + 1) & 0xFFFF
        packet = Packet(
            seq=seq,
            session=session,
            opcode=opcode,
            size=len(data) or size,
            asked=0,
            is_complete=False,
            offset=offset,
            data=data,
        )
        self._pending[seq] = Ask(packet, now, now + self._patience_s(opcode))
        return request(self._route, packet)

    def overdue(self, now: float) -> Iterator[Ask]:
        """Those whose answer ought to have come; they may be dropped meanwhile."""
        for ask in list(self._pending.values()):
            if now >= ask.due_at and ask.packet.seq in self._pending:
                yield ask

    def repeat(self, ask: Ask, now: float) -> Message:
        """Send one again, and wait longer each time."""
        patience_s = self._patience_s(ask.packet.opcode)
        if now - self._heard_at > HEARD_WITHIN * patience_s:
            patience_s *= 2 ** min(max(0, ask.attempts - SAME_PATIENCE), 3)
        ask.due_at = now + min(patience_s, LONGEST_TIMEOUT_S)
        ask.attempts += 1
        return request(self._route, ask.packet)

    def drop(self, ask: Ask) -> None:
        """Wait for it no longer."""
        self._pending.pop(ask.packet.seq, None)

    def clear(self) -> None:
        """Wait for nothing."""
        self._pending.clear()

    def drop_all(self, opcode: int) -> None:
        """Wait for no request of a kind any longer."""
        for ask in [ask for ask in self._pending.values() if ask.packet.opcode == opcode]:
            self.drop(ask)

    def answered_by(self, answer: Packet, now: float) -> Ask | None:
        """The request that an answer is for; None if there is none.

        A packet of a burst answers the burst that is asked for, unless its data lie before that:
        then it is a late one of the burst before.
        """
        self._heard_at = now
        if answer.asked == BURST:
            bursts = (a for a in self._pending.values() if a.packet.opcode == BURST)
            ask = next(bursts, None)
            if ask is not None and answer.opcode == ACK and answer.offset < ask.packet.offset:
                ask = None
        else:
            ask = self._pending.get((answer.seq - 1) & 0xFFFF)
        if ask is None or ask.packet.opcode != answer.asked:
            return None
        if ask.attempts == 1:  # Karn's rule
            self.round_trip.sample(now - ask.sent_at)
        self.drop(ask)
        return ask

    def _patience_s(self, opcode: int) -> float:
        timeout_s = self.round_trip.timeout_s
        return max(CHECK_TIMEOUT_S, timeout_s) if opcode == CHECKSUM else timeout_s
