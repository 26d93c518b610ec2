"""One gateway's session with its broker: (event or step, now) -> actions; sans-IO.

    DOWN --> CONNECTING: tried
    CONNECTING --> SUBSCRIBING: accepted
    SUBSCRIBING --> UP: subscribed
    CONNECTING --> DOWN: lost
    SUBSCRIBING --> DOWN: lost
    UP --> DOWN: lost

It connects at once and reconnects with full-jitter back-off, or at once when a record is submitted:
the relay has a back-off of its own, and its probe has to test the connection. Whatever fails
settles every record in flight; the relay keeps them and sends them again.
"""

from enum import StrEnum
from random import Random
from typing import Final, NamedTuple, TypeAlias

from edge_server.outbox.answers import Reply, Unreachable
from edge_server.outbox.retry import Backoff
from edge_server.transitions import TransitionTable
from edge_server.uplinks import mqtt_protocol
from edge_server.uplinks.mqtt_in_flight import InFlight, SettledRecord
from edge_server.uplinks.mqtt_protocol import Limits, RecordPacket

STRIKES: Final = 3
"""After so many protocol errors in a row over the same packet, the packet is rejected."""
LEAST_SUSPECT_BYTES: Final = 4096
"""No broker finds a smaller packet too large: it is put off, however often a connection breaks."""
_TIMEOUT: Final = "the broker did not answer in time"


class LinkState(StrEnum):
    """State of the connection."""

    DOWN = "down"
    CONNECTING = "connecting"
    SUBSCRIBING = "subscribing"
    UP = "up"


class LinkTrigger(StrEnum):
    """What changes the state of the connection."""

    TRIED = "tried"
    ACCEPTED = "accepted"
    SUBSCRIBED = "subscribed"
    LOST = "lost"


LINK_STATES: Final = TransitionTable(
    "a connection",
    {
        (LinkState.DOWN, LinkTrigger.TRIED): LinkState.CONNECTING,
        (LinkState.CONNECTING, LinkTrigger.ACCEPTED): LinkState.SUBSCRIBING,
        (LinkState.SUBSCRIBING, LinkTrigger.SUBSCRIBED): LinkState.UP,
        (LinkState.CONNECTING, LinkTrigger.LOST): LinkState.DOWN,
        (LinkState.SUBSCRIBING, LinkTrigger.LOST): LinkState.DOWN,
        (LinkState.UP, LinkTrigger.LOST): LinkState.DOWN,
    },
)
"""A trigger that is not here is ignored, such as a packet that arrives too late."""


class Accepted(NamedTuple):
    """Event: the broker has accepted the connection."""

    limits: Limits


class Refused(NamedTuple):
    """Event: the broker has refused the connection."""

    code: int
    text: str


class Subscribed(NamedTuple):
    """Event: the broker has answered the subscription to the cloud's answers."""

    code: int
    text: str


class Acknowledged(NamedTuple):
    """Event: the broker has accepted or refused a packet."""

    packet_id: int
    code: int


class Answered(NamedTuple):
    """Event: the cloud has answered a record."""

    correlation: bytes
    payload: bytes
    accept_batch: int | None = None  # [-] Records that it accepts in one packet, if it says so


class Lost(NamedTuple):
    """Event: the connection is lost; `code` is the broker's reason code if it sent one."""

    reason: str
    code: int | None = None


Event: TypeAlias = Accepted | Refused | Subscribed | Acknowledged | Answered | Lost


class Open(NamedTuple):
    """Action: connect to the broker."""


class Subscribe(NamedTuple):
    """Action: subscribe to the cloud's answers."""


class Announce(NamedTuple):
    """Action: publish that this gateway is online."""


class Publish(NamedTuple):
    """Action: send a record."""

    packet: RecordPacket


class Cut(NamedTuple):
    """Action: close the connection without a DISCONNECT."""


Action: TypeAlias = Open | Subscribe | Announce | Publish | Cut


class Session:
    """Decides when to connect, to send and to give up; times are monotonic seconds."""

    def __init__(
        self,
        *,
        backoff: Backoff,
        refused_wait_s: float,
        connect_timeout_s: float,
        answer_timeout_s: float,
        random: Random,
    ) -> None:
        self._backoff = backoff
        self._refused_wait_s = refused_wait_s
        self._connect_timeout_s = connect_timeout_s
        self._random = random
        self._in_flight = InFlight(timeout_s=answer_timeout_s)
        self._state = LinkState.DOWN
        self._failures = 0
        self._not_before = 0.0
        self._deadline: float | None = None  # Of the CONNACK and SUBACK
        self._up_since = 0.0
        self._suspect: str | None = None
        self._strikes = 0
        self.fault: str | None = "not connected yet"
        self.accept_batch = 0  # [-] Records that the cloud accepts in one packet
        self.limits = Limits()

    @property
    def state(self) -> LinkState:
        """State of the connection."""
        return self._state

    def submit(self, packet: RecordPacket, now: float) -> None:
        """Add a record that has to be sent."""
        self._in_flight.submit(packet, now)

    def sent(self, key: str, packet_id: int, now: float) -> None:
        """Note that a record has been sent."""
        self._in_flight.sent(key, packet_id, now)

    def announced(self, packet_id: int) -> None:
        """Note that our presence has been sent; it counts against the receive maximum too."""
        self._in_flight.sent_other(packet_id)

    def opened(self, now: float) -> None:
        """Note that CONNECT has been sent: from now on the connect timeout runs."""
        self._deadline = now + self._connect_timeout_s

    def close(self, now: float) -> None:
        """End for good: every record in flight gets a reason."""
        reason = "the relay stops"
        self._go_down(Unreachable(reason), reason, now)
        self._in_flight.connection_lost(Unreachable(reason), now)  # Submitted while it was down

    def take_settled(self) -> list[SettledRecord]:
        """Return the records that have been settled since the last call."""
        return self._in_flight.take_settled()

    def step(self, now: float) -> list[Action]:
        """Do what is due by time: connect, give up, send."""
        self._in_flight.tick(now)
        is_wanted = now >= self._not_before or not self._in_flight.idle
        if is_wanted and self._follow(LinkTrigger.TRIED):
            return [Open()]
        if self._deadline is not None and now >= self._deadline:
            self._go_down(Unreachable(_TIMEOUT), _TIMEOUT, now)
            return [Cut()]
        if self._state is LinkState.UP:
            return [Publish(packet) for packet in self._in_flight.take(now)]
        return []

    def next_step_at(self, now: float) -> float:
        """When the next step is due if no event comes before."""
        times = [self._in_flight.next_deadline(), self._deadline]
        if self._state is LinkState.DOWN:
            times.append(self._not_before)
        return min((moment for moment in times if moment is not None), default=now + 1.0)

    def handle(self, event: Event, now: float) -> list[Action]:
        """Handle an event of the connection."""
        match event:
            case Acknowledged(packet_id, code):
                self._in_flight.acknowledged(packet_id, code, now)
            case Answered(correlation, payload, accept_batch):
                self.accept_batch = self.accept_batch if accept_batch is None else accept_batch
                self._in_flight.answered(correlation, payload, now)
            case Accepted(limits):
                if self._follow(LinkTrigger.ACCEPTED):
                    self.limits = limits
                    self._in_flight.begin(limits)
                    return [Subscribe()]
            case Subscribed(code, text):
                return self._subscribed(code, text, now)
            case Refused(code, text):
                return self._refused(code, text, now)
            case Lost(reason, code):
                too_large = self._was_too_large(code)
                self._go_down(Unreachable(reason), reason, now, too_large=too_large)
        return []

    def _was_too_large(self, code: int | None) -> bool:
        """Whether the largest packet in flight was too large for the broker.

        Either the reason code says so, or the connection has ended several times in a row with that
        packet in flight.
        """
        if code == mqtt_protocol.PACKET_TOO_LARGE:
            return True
        if code not in mqtt_protocol.SUSPICIOUS:
            return False
        suspect = self._in_flight.largest_sent(LEAST_SUSPECT_BYTES)
        if suspect is None:
            return False
        self._strikes = self._strikes + 1 if suspect == self._suspect else 1
        self._suspect = suspect
        return self._strikes >= STRIKES

    def _subscribed(self, code: int, text: str, now: float) -> list[Action]:
        if code >= mqtt_protocol.FAILURE:
            return self._refused(code, f"no subscription to the answers: {text}", now)
        if not self._follow(LinkTrigger.SUBSCRIBED):
            return []
        self._deadline = None
        self._up_since = now
        self.fault = None
        return [Announce()]

    def _refused(self, code: int, text: str, now: float) -> list[Action]:
        reply = mqtt_protocol.reply_to_refusal(code, text)
        self._go_down(reply, f"refused: {text}", now)
        if not isinstance(reply, Unreachable):
            self._not_before = max(self._not_before, now + self._refused_wait_s)
        return [Cut()]

    def _go_down(self, reply: Reply, fault: str, now: float, *, too_large: bool = False) -> None:
        """Settle what is in flight and wait; a connection that lasted resets the failures."""
        if self._state is LinkState.UP and now - self._up_since >= self._backoff.cap_s:
            self._failures = 0
        if not self._follow(LinkTrigger.LOST):
            return
        self._deadline = None
        self._failures += 1
        self._not_before = now + self._backoff.delay_s(self._failures, self._random)
        self._in_flight.connection_lost(reply, now, too_large=too_large)
        self.fault = fault

    def _follow(self, trigger: LinkTrigger) -> bool:
        """Change the state; returns whether the table has the transition."""
        state = LINK_STATES.get(self._state, trigger)
        if state is not None:
            self._state = state
        return state is not None
