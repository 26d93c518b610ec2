"""Whether a vehicle that is received also receives: TIMESYNC requests, which it answers.

Heartbeats show one direction of a link only. Where the other one is dead, by an antenna, a firewall
or a signing key that the vehicle does not have, every order is lost although the vehicle looks
connected. TIMESYNC(111) is the request that changes nothing: PX4 and ArduPilot answer one with
`tc1 = 0` by their own time in `tc1` and the request's `ts1`
(https://mavlink.io/en/services/timesync.html).

A vehicle that answers other requests and never a TIMESYNC does not have it, and is asked no more.
Only what it answers when it could have answered a TIMESYNC too shows that.
"""

from collections import deque
from typing import Final

from mavlink_broker.mavlink.dialect import Message, Route, mavlink

INTERVAL_S: Final = 2.0
REPEAT_S: Final = 0.5
"""Interval while the last request is not answered."""
UNANSWERED_AFTER_S: Final = 10.0
"""Time without an answer after which orders do not reach it: at 30 % loss in both directions, all
of the twenty requests are lost once in a million times."""
LONGEST_TRIP_S: Final = 3.0
"""Time that a request and its answer may be on their way on a slow link."""
LONGEST_PAUSE_S: Final = 3.0
"""A monitor that was not stepped for longer has not listened: the time begins anew."""
REQUESTS_KEPT: Final = 32


class AnswerMonitor:
    """Whether one vehicle answers, from when its link came up until it is lost."""

    def __init__(self, route: Route, unanswered_s: float = 0.0) -> None:
        """Begin with the time for which it was received before, without an answer until now."""
        self._own_system = route.own_system
        self._before_s = unanswered_s
        self._sent: deque[int] = deque(maxlen=REQUESTS_KEPT)  # ts1 of the requests
        self._send_at: float | None = None
        self._first_sent_at: float | None = None
        self._ticked_at: float | None = None
        self._unanswered_since: float | None = None
        self._has_timesync = False
        self._lacks_timesync = False
        self._has_answered_others = False
        self.is_unanswered = False
        """Whether it is received, but has not answered for `UNANSWERED_AFTER_S`."""

    def unanswered_s(self, until: float) -> float:
        """Give for how long it has not answered at a time; 0 if it answers."""
        since = self._unanswered_since
        return self._before_s if since is None else max(0.0, until - since)

    def receive(self, message: Message) -> None:
        """Handle a message of the vehicle, which may be an answer to the broker."""
        if message.get_type() == "TIMESYNC":
            if message.tc1 == 0 or message.ts1 not in self._sent:
                return  # Its own request, or the answer to another system
            self._has_timesync, self._lacks_timesync = True, False
        else:
            target = getattr(message, "target_system", None)
            is_ours = target == self._own_system
            is_to_all = target == 0 and message.get_type() == "COMMAND_ACK"
            if is_ours or is_to_all:
                self._has_answered_others |= self._has_had_time()
            if not is_ours:
                return
        self._unanswered_since, self.is_unanswered = None, False

    def _has_had_time(self) -> bool:
        """Whether the first request would have been answered by now."""
        if self._first_sent_at is None or self._ticked_at is None:
            return False
        return self._ticked_at - self._first_sent_at >= LONGEST_TRIP_S

    def tick(self, now: float) -> list[Message]:
        """Send a request if one is due; to be called only while the vehicle is received."""
        if self._ticked_at is not None and now - self._ticked_at > LONGEST_PAUSE_S:
            self._unanswered_since, self._send_at = None, now
        self._ticked_at = now
        since = self._unanswered_since
        if since is not None and now - since >= UNANSWERED_AFTER_S:
            self._lacks_timesync = self._has_answered_others and not self._has_timesync
            self.is_unanswered = not self._lacks_timesync
        if self._lacks_timesync or (self._send_at is not None and now < self._send_at):
            return []
        self._send_at = now + (INTERVAL_S if since is None else REPEAT_S)
        self._unanswered_since = now - self._before_s if since is None else since
        self._before_s = 0.0
        self._first_sent_at = now if self._first_sent_at is None else self._first_sent_at
        self._sent.append(sent_ns := int(now * 1e9))
        return [mavlink.MAVLink_timesync_message(0, sent_ns)]
