"""The link to a vehicle: its state, reboots, the order and loss of frames, whether it answers.

The broker's own heartbeat is that of an onboard controller (type 18), unless a vehicle requires a
ground station (type 6): a vehicle may return home when it loses its last ground station, but a
mission must survive a broker that dies.

A vehicle has rebooted when its time since boot goes back. These are not reboots: frames that
overtake one another; frames that a radio has delayed, some seconds of them in a row; messages whose
clocks differ by some seconds, which is why each kind of message is tracked separately; and the
overflow of the counter at 2^32 ms, after 49.7 days. The speed of the clock does not matter: a
simulated one may run at any speed.

`StateOrder` recognises a state that a newer one of its kind has overtaken on the network. UDP may
deliver two frames in reverse order, and these messages have no time of their own. A late
heartbeat shows a mode that the vehicle has left: it would look as if somebody else had changed it.
A late MISSION_CURRENT shows the mission before as complete: the one just begun would count as
flown. The frames of a component are numbered, modulo 256.

A source that sends periodically, such as a camera, has a timeout (`PeriodicSource`). At 20 % loss
five messages in a row are lost once an hour; that must not end a mission. So the timeout grows with
the ratio of lost frames (`FrameLoss`).

`AnswerMonitor` finds out whether a vehicle that is received also receives. Heartbeats show one
direction of a link only. Where the other one is dead, by an antenna, a firewall or a signing key
that the vehicle does not have, every order is lost although the vehicle looks connected.
TIMESYNC(111) is the request that changes nothing: PX4 and ArduPilot answer one with `tc1 = 0` by
their own time in `tc1` and the request's `ts1` (https://mavlink.io/en/services/timesync.html). A
vehicle that answers other requests and never a TIMESYNC does not have it, and is asked no more.
Only what it answers when it could have answered a TIMESYNC too shows that.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from mavlink_broker.mavlink.codec import SEQUENCES
from mavlink_broker.mavlink.dialect import BOOT_MS_VALUES, Message, Route, mavlink

HEARTBEAT_EVERY_S: Final = 1.0
"""Interval of the broker's own heartbeats."""
STALE_AFTER_S: Final = 2.0
LOST_AFTER_S: Final = 5.0
TOLERANCE_MS: Final = 1000
"""Frames that overtake one another step back by less."""
CONFIRMATIONS: Final = 3
"""One late frame proves nothing; a rebooted vehicle continues to count from zero."""
SILENCE_S: Final = 2.0
"""After this silence any step back counts: the vehicle may have been switched off."""
JUMP_GAP_S: Final = 3.0
"""Longer than the interval of any message that is requested: the vehicle was silent."""
JUMP_MS: Final = 500
"""After such a gap: a clock with a larger deviation may be another vehicle's."""
JUMP_WITHOUT_GAP_MS: Final = 5000
"""Without a gap: a radio delays one frame more than the frame before it, by less than this."""
REAL_TIME: Final = 1000.0
"""Rate of a clock that is not simulated [ms/s]."""
RATE_KNOWN_S: Final = 1.0
"""A clock is followed for this long before its own rate is used, instead of `REAL_TIME`."""
DRIFT: Final = 0.01
"""Share of the time by which a clock may gain or lose against the broker's."""
FAR_BACK_MS: Final = 30_000
"""Step back that counts without a silence: no radio delays frames for so long."""
MESSAGES_KEPT: Final = 64
CLOCK_WITHIN_S: Final = 3.0
"""How long a vehicle that is back, or behind a new address, may take to send its clock, if ever."""
_NEAR_THE_END_MS: Final = 600_000


class LinkState(StrEnum):
    """State of a vehicle's link by the age of its heartbeat; the values are the edge server's."""

    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


def own_heartbeat(kind: int = mavlink.MAV_TYPE_ONBOARD_CONTROLLER) -> Message:
    """HEARTBEAT(0) of the broker with a MAV_TYPE."""
    return mavlink.MAVLink_heartbeat_message(
        kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


class OwnHeartbeat:
    """Sends the broker's heartbeat once a second."""

    def __init__(self) -> None:
        self._due_at: float | None = None
        self._kind: int | None = None

    def tick(self, now: float, kind: int = mavlink.MAV_TYPE_ONBOARD_CONTROLLER) -> list[Message]:
        """Send it if it is due, or if the type has changed."""
        if self._due_at is not None and now < self._due_at and kind == self._kind:
            return []
        self._due_at, self._kind = now + HEARTBEAT_EVERY_S, kind
        return [own_heartbeat(kind)]


class LinkMonitor:
    """State of one vehicle's link by the age of its heartbeat only.

    A radio that continues to send must not make a dead vehicle look connected.
    """

    def __init__(self) -> None:
        self._received_at: float | None = None

    def heartbeat_received(self, now: float) -> None:
        """Handle a heartbeat of the vehicle."""
        self._received_at = now

    def state(self, now: float) -> LinkState:
        """Return the state; LOST before the first heartbeat."""
        if self._received_at is None or now - self._received_at > LOST_AFTER_S:
            return LinkState.LOST
        if now - self._received_at > STALE_AFTER_S:
            return LinkState.STALE
        return LinkState.CONNECTED


@dataclass(slots=True)
class _Clock:
    """The clock of one kind of message."""

    newest_ms: int
    received_at: float
    began_at: float  # First sample
    first_ms: int
    went_on_at: float = -math.inf
    behind: int = 0
    was_silent: bool = False  # Before it went back


class RebootMonitor:
    """Follows `time_boot_ms` of one vehicle."""

    def __init__(self) -> None:
        self._clocks: dict[str, _Clock] = {}
        self._confirmed_at = -math.inf  # When the clock last went on, or a reboot was detected
        self._doubted_at = -math.inf  # When it last was behind as after a reboot
        self.has_jumped = False  # By the newest sample: it may be another vehicle's
        self._rebooted_at = self._jumped_at = -math.inf

    def is_received(self, since: float | None) -> bool:
        """Whether the vehicle sends its time since boot, and has since a time (None: ever)."""
        is_sent = self._confirmed_at > -math.inf
        return is_sent and (since is None or self._confirmed_at >= since)

    def may_show(self, since: float, now: float) -> bool:
        """Whether the clock may show soon what became of a vehicle that is back since a time."""
        is_recent = now - max(since, self._doubted_at) < CLOCK_WITHIN_S
        return is_recent and not self._has_shown(since)

    def _has_shown(self, since: float) -> bool:
        """Whether a clock of before has gone on since a time, or a reboot or jump was detected.

        A kind of message that was not received before would go on after a reboot too.
        """
        clocks = self._clocks.values()
        goes_on = any(clock.began_at < since <= clock.went_on_at for clock in clocks)
        return goes_on or max(self._rebooted_at, self._jumped_at) >= since

    def sample(self, kind: str, time_boot_ms: int, now: float) -> bool:
        """Compare a time since boot of a kind of message; true when it proves a reboot."""
        self.has_jumped = False
        clock = self._clocks.get(kind)
        if clock is None:
            if len(self._clocks) < MESSAGES_KEPT:
                self._clocks[kind] = _Clock(time_boot_ms, now, now, time_boot_ms)
            return False
        has_wrapped = _has_wrapped(clock.newest_ms, time_boot_ms)
        passed_ms = time_boot_ms - clock.newest_ms + (BOOT_MS_VALUES if has_wrapped else 0)
        if passed_ms >= -TOLERANCE_MS and _has_jumped(clock, passed_ms, now):
            # No restart; what was known of the clocks says nothing of this one
            self._clocks = {kind: _Clock(time_boot_ms, now, now, time_boot_ms)}
            self.has_jumped = True
            self._confirmed_at = self._jumped_at = now
            return False
        gap_s, clock.received_at = now - clock.received_at, now
        if passed_ms >= 0:
            if has_wrapped:
                clock.first_ms, clock.began_at = time_boot_ms, now
            clock.newest_ms, clock.behind, clock.was_silent = time_boot_ms, 0, False
            self._confirmed_at = clock.went_on_at = now
        else:
            clock.was_silent |= gap_s >= SILENCE_S
            if _is_suspicious(clock, time_boot_ms):
                clock.behind += 1
                self._doubted_at = now
        if clock.behind < CONFIRMATIONS:
            return False
        self._clocks = {kind: _Clock(time_boot_ms, now, now, time_boot_ms)}
        self._confirmed_at = self._rebooted_at = now
        return True


def _has_jumped(clock: _Clock, passed_ms: int, now: float) -> bool:
    """Whether a clock has not gone on by what it would at its rate of before.

    A simulated vehicle's clock runs faster or slower than the broker's, and in bursts: the
    tolerance grows with its rate. Frames that were delayed look like a jump.
    """
    gap_s, known_s = now - clock.received_at, clock.received_at - clock.began_at
    is_rate_known = known_s >= RATE_KNOWN_S
    if not is_rate_known and gap_s < JUMP_GAP_S:
        return False
    rate = (clock.newest_ms - clock.first_ms) / known_s if is_rate_known else REAL_TIME
    least_ms = JUMP_MS if gap_s >= JUMP_GAP_S else JUMP_WITHOUT_GAP_MS
    tolerance_ms = least_ms * max(1.0, rate / REAL_TIME) + DRIFT * rate * gap_s
    return abs(passed_ms - rate * gap_s) > tolerance_ms


def _is_suspicious(clock: _Clock, time_boot_ms: int) -> bool:
    back_ms = clock.newest_ms - time_boot_ms
    if back_ms <= TOLERANCE_MS:
        return False
    begun_again = back_ms > FAR_BACK_MS or time_boot_ms < clock.newest_ms / 2
    return begun_again or clock.was_silent


def _has_wrapped(newest_ms: int, time_boot_ms: int) -> bool:
    at_the_end = newest_ms > BOOT_MS_VALUES - _NEAR_THE_END_MS
    return at_the_end and time_boot_ms < _NEAR_THE_END_MS


SEQUENCE_GAP_S: Final = 0.5
"""After such a gap the numbers prove nothing: the vehicle may have counted round or restarted."""
COPIED_WITHIN_S: Final = 3.0
"""Longest delay of a frame that the network repeats; a later one may be an equal frame of a
restarted vehicle."""
BEHIND_IN_A_ROW: Final = 10
"""So many frames in a row behind the newest one are not late: the numbers begin again. A vehicle
may number the frames of each of its links, and be received on another link from now on."""


STATES: Final = frozenset({"HEARTBEAT", "EXTENDED_SYS_STATE", "MISSION_CURRENT"})
"""Messages that show what is now, and replace the one before; they have no time of their own."""


class StateOrder:
    """The order of the frames of one component."""

    def __init__(self) -> None:
        self._number = 0  # Of the newest frame
        self._position = 0  # The same, counted on
        self._behind = 0  # Frames in a row that were not newer
        self._newest: dict[str, int] = {}  # Position of the newest message of each of `STATES`
        self._frames = [(-1, -math.inf)] * SEQUENCES  # Checksum and time, by number
        self._received_at = -math.inf

    def is_overtaken(self, message: Message, now: float) -> bool:
        """Handle a frame; gives whether it is a state that is older than another of its kind."""
        number, half = message.get_seq(), SEQUENCES // 2
        step = (number - self._number + half) % SEQUENCES - half
        before, before_at = self._frames[number]
        is_copy = step <= 0 and message.get_crc() == before and now - before_at <= COPIED_WITHIN_S
        if not is_copy:  # The network may repeat frames, also many in a row: they prove nothing
            self._frames[number] = message.get_crc(), now
            self._behind = self._behind + 1 if step <= 0 else 0
            if now - self._received_at > SEQUENCE_GAP_S or self._behind >= BEHIND_IN_A_ROW:
                step, self._behind = 1, 0
            self._received_at = now
        position = self._position + step
        if step > 0:
            self._number, self._position = number, position
        kind = message.get_type()
        if kind not in STATES:
            return False
        if position < self._newest.get(kind, position):
            return True
        self._newest[kind] = position
        return False


MIN_TIMEOUT_S: Final = 5.0
MAX_TIMEOUT_S: Final = 30.0
CHANCE_LIMIT: Final = 1e-6
"""Highest probability that all messages of a timeout were lost by chance."""
INTERVALS: Final = 3.0
MIN_MESSAGES: Final = 3
"""Messages after which a source counts as periodic."""
_FRAMES_KEPT: Final = 500
_GAIN: Final = 0.2


class FrameLoss:
    """Ratio of lost frames of one component, by gaps in its sequence numbers."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._sent = self._lost = 0.0

    def take(self, message: Message) -> None:
        """Handle a frame."""
        number = message.get_seq()
        step = 1 if self._last is None else (number - self._last) % SEQUENCES
        if not 1 <= step < SEQUENCES // 2:
            return  # Late or repeated
        self._last = number
        self._sent += step
        self._lost += step - 1
        if self._sent > _FRAMES_KEPT:
            self._sent, self._lost = self._sent / 2, self._lost / 2

    @property
    def ratio(self) -> float:
        """Lost frames, 0 to 1."""
        return self._lost / self._sent if self._sent else 0.0


@dataclass(slots=True)
class PeriodicSource:
    """One source of a periodic message."""

    received_at: float
    count: int = 1
    interval_s: float = 1.0
    is_timed_out: bool = False  # Until the next message, also if the loss changes

    def received(self, now: float) -> None:
        """Handle a message of the source."""
        gap_s = now - self.received_at
        self.interval_s = (
            gap_s if self.count == 1 else self.interval_s + _GAIN * (gap_s - self.interval_s)
        )
        self.count += 1
        self.received_at = now
        self.is_timed_out = False

    def restart_timer(self, now: float) -> None:
        """Restart the timeout: the link was lost."""
        self.received_at = now

    def is_silent(self, now: float, loss: float) -> bool:
        """Whether it has timed out at this ratio of lost frames."""
        if self.count >= MIN_MESSAGES and now - self.received_at >= self._timeout_s(loss):
            self.is_timed_out = True
        return self.is_timed_out

    def _timeout_s(self, loss: float) -> float:
        expected_s = INTERVALS * self.interval_s
        if loss > 0.0:
            in_a_row = math.log(CHANCE_LIMIT) / math.log(min(loss, 0.9))
            expected_s = max(expected_s, min(in_a_row * self.interval_s, MAX_TIMEOUT_S))
        return max(MIN_TIMEOUT_S, expected_s)


ASKED_EVERY_S: Final = 2.0
ASKED_AGAIN_AFTER_S: Final = 0.5
"""While the last request is not answered."""
UNANSWERED_AFTER_S: Final = 10.0
"""Time without an answer after which orders do not reach it: at 30 % loss in both directions, all
of the twenty requests are lost once in a million times."""
LONGEST_TRIP_S: Final = 3.0
"""Time that a request and its answer may be in transit on a slow link."""
LONGEST_PAUSE_S: Final = 3.0
"""A monitor that was not stepped for longer has not listened: its time begins again."""
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
        self._send_at = now + (ASKED_EVERY_S if since is None else ASKED_AGAIN_AFTER_S)
        self._unanswered_since = now - self._before_s if since is None else since
        self._before_s = 0.0
        self._first_sent_at = now if self._first_sent_at is None else self._first_sent_at
        self._sent.append(sent_ns := int(now * 1e9))
        return [mavlink.MAVLink_timesync_message(0, sent_ns)]
