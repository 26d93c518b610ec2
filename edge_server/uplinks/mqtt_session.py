"""One gateway's dealings with its broker: (event or tick, now) -> actions; sans-IO.

It connects at once and again, by itself with full-jitter back-off, or at once when a record is to
be sent: the relay has a back-off of its own, and its probe should find out how things are now.
What goes wrong settles every record under way; the relay keeps them and offers them again.
"""

from random import Random
from typing import Final

from edge_server.outbox.answers import Reply, Unreachable
from edge_server.outbox.retry import Backoff
from edge_server.uplinks import mqtt_reasons
from edge_server.uplinks.mqtt_exchange import Exchange, Settled
from edge_server.uplinks.mqtt_messages import (
    Accepted,
    Acknowledged,
    Action,
    Announce,
    Answered,
    Cut,
    Event,
    Limits,
    Lost,
    Open,
    Publish,
    RecordPacket,
    Refused,
    Subscribe,
    Subscribed,
)
from edge_server.uplinks.mqtt_states import LinkHappening, LinkState, follow_link

STRIKES: Final = 3
"""So many protocol errors in a row over the same packet, and it is the packet's fault."""
LEAST_SUSPECT_BYTES: Final = 4096
"""A smaller packet is too large for no broker: it is put off, however often a connection breaks."""
_SILENT: Final = "the broker did not answer in time"


class Session:
    """Decides; times are monotonic seconds."""

    def __init__(
        self,
        *,
        backoff: Backoff,
        refused_wait_s: float,
        connect_patience_s: float,
        answer_patience_s: float,
        random: Random,
    ) -> None:
        self._backoff = backoff
        self._refused_wait_s = refused_wait_s
        self._connect_patience_s = connect_patience_s
        self._random = random
        self._exchange = Exchange(patience_s=answer_patience_s)
        self._state = LinkState.DOWN
        self._failures = 0
        self._not_before = 0.0
        self._deadline: float | None = None  # Of the broker's welcome
        self._up_since = 0.0
        self._suspect: str | None = None
        self._strikes = 0
        self.trouble: str | None = "not connected yet"
        self.accept_batch = 0  # [-] Records that the cloud takes in one packet
        self.limits = Limits()

    @property
    def state(self) -> LinkState:
        """How far the connection is."""
        return self._state

    def offer(self, packet: RecordPacket, now: float) -> None:
        """Take a record that should go out."""
        self._exchange.offer(packet, now)

    def sent(self, key: str, packet_id: int, now: float) -> None:
        """Note that a record is on the wire."""
        self._exchange.sent(key, packet_id, now)

    def announced(self, packet_id: int) -> None:
        """Note that our presence is on the wire; it counts against the receive maximum too."""
        self._exchange.occupied(packet_id)

    def opened(self, now: float) -> None:
        """Note that the broker has been greeted: from now on it has time to answer."""
        self._deadline = now + self._connect_patience_s

    def close(self, now: float) -> None:
        """End for good: what is under way gets a reason."""
        reason = "the relay stops"
        self._go_down(Unreachable(reason), reason, now)
        self._exchange.lost(Unreachable(reason), now)  # What was offered while we were down

    def settled(self) -> list[Settled]:
        """Hand over what has been settled."""
        return self._exchange.settled()

    def turn(self, now: float) -> list[Action]:
        """Do what time brings: connect, give up, send."""
        self._exchange.tick(now)
        if self._state is LinkState.DOWN and (now >= self._not_before or not self._exchange.idle):
            self._state = LinkState.CONNECTING
            return [Open()]
        if self._deadline is not None and now >= self._deadline:
            self._go_down(Unreachable(_SILENT), _SILENT, now)
            return [Cut()]
        if self._state is LinkState.UP:
            return [Publish(packet) for packet in self._exchange.take(now)]
        return []

    def wake_at(self, now: float) -> float:
        """When the next turn is due, should nothing happen before."""
        times = [self._exchange.next_deadline(), self._deadline]
        if self._state is LinkState.DOWN:
            times.append(self._not_before)
        return min((moment for moment in times if moment is not None), default=now + 1.0)

    def handle(self, event: Event, now: float) -> list[Action]:
        """Take in what the connection tells."""
        match event:
            case Acknowledged(packet_id, code):
                self._exchange.acknowledged(packet_id, code, now)
            case Answered(correlation, payload, accept_batch):
                self.accept_batch = self.accept_batch if accept_batch is None else accept_batch
                self._exchange.answered(correlation, payload, now)
            case Accepted(limits):
                if self._follow(LinkHappening.ACCEPTED):
                    self.limits = limits
                    self._exchange.begin(limits)
                    return [Subscribe()]
            case Subscribed(code, text):
                return self._subscribed(code, text, now)
            case Refused(code, text):
                return self._refused(code, text, now)
            case Lost(reason, code):
                guilty = self._finds_guilty(code)
                self._go_down(Unreachable(reason), reason, now, too_large=guilty)
        return []

    def _finds_guilty(self, code: int | None) -> bool:
        """Whether the largest packet under way was too large for the broker.

        It says so, or its connections end over and over again with that packet on the way.
        """
        if code == mqtt_reasons.PACKET_TOO_LARGE:
            return True
        if code not in mqtt_reasons.SUSPICIOUS:
            return False
        suspect = self._exchange.largest_sent(LEAST_SUSPECT_BYTES)
        if suspect is None:
            return False
        self._strikes = self._strikes + 1 if suspect == self._suspect else 1
        self._suspect = suspect
        return self._strikes >= STRIKES

    def _subscribed(self, code: int, text: str, now: float) -> list[Action]:
        if code >= mqtt_reasons.FAILURE:
            return self._refused(code, f"answers may not be heard: {text}", now)
        if not self._follow(LinkHappening.SUBSCRIBED):
            return []
        self._deadline = None
        self._up_since = now
        self.trouble = None
        return [Announce()]

    def _refused(self, code: int, text: str, now: float) -> list[Action]:
        reply = mqtt_reasons.of_refusal(code, text)
        self._go_down(reply, f"refused: {text}", now)
        if not isinstance(reply, Unreachable):
            self._not_before = max(self._not_before, now + self._refused_wait_s)
        return [Cut()]

    def _go_down(self, reply: Reply, trouble: str, now: float, *, too_large: bool = False) -> None:
        """Settle what is under way and wait; a connection that has held is no failure so far."""
        if self._state is LinkState.UP and now - self._up_since >= self._backoff.cap_s:
            self._failures = 0
        if not self._follow(LinkHappening.LOST):
            return
        self._deadline = None
        self._failures += 1
        self._not_before = now + self._backoff.delay_s(self._failures, self._random)
        self._exchange.lost(reply, now, too_large=too_large)
        self.trouble = trouble

    def _follow(self, happening: LinkHappening) -> bool:
        state = follow_link(self._state, happening)
        if state is not None:
            self._state = state
        return state is not None
