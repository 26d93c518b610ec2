"""Timeouts that follow the link: of repeated requests, and of periodic messages.

Requests: smoothed round trip and variation as in RFC 6298 section 2, with limits for MAVLink links
from the loopback to a satellite modem. Only requests that were not repeated are sampled (Karn's
algorithm), because the answer to a repetition is ambiguous. A link that is slower than the first
timeout would then never be sampled: when every request had to be repeated, the time since the first
one is taken, which is too long rather than too short.

Periodic messages: at 20 % loss five messages in a row are lost once an hour; that must not end a
mission. So the timeout grows with the ratio of lost frames.

"""

import math
from dataclasses import dataclass
from typing import Final

from mavlink_broker.mavlink.dialect import Message

FIRST_TIMEOUT_S: Final = 1.0
SHORTEST_TIMEOUT_S: Final = 0.3
LONGEST_TIMEOUT_S: Final = 5.0
AMBIGUOUS_IN_A_ROW: Final = 2
_SMOOTHED_GAIN: Final = 1 / 8
_VARIATION_GAIN: Final = 1 / 4
MIN_TIMEOUT_S: Final = 5.0
MAX_TIMEOUT_S: Final = 30.0
CHANCE_LIMIT: Final = 1e-6
"""Highest probability that all messages of a timeout were lost by chance."""
INTERVALS: Final = 3.0
MIN_MESSAGES: Final = 3
"""Messages after which a source counts as periodic."""
_MEMORY: Final = 500
_ROUND: Final = 256
_GAIN: Final = 0.2


class RoundTrip:
    """Estimate for one vehicle's link."""

    def __init__(self) -> None:
        self._smoothed_s: float | None = None
        self._variation_s = 0.0
        self._ambiguous = 0

    def sample_repeated(self, seconds: float) -> None:
        """Add the time [s] from the first of several requests to an answer to one of them."""
        self._ambiguous += 1
        if self._ambiguous >= AMBIGUOUS_IN_A_ROW:
            self.sample(min(seconds, LONGEST_TIMEOUT_S))

    def sample(self, seconds: float) -> None:
        """Add the time [s] between a request and its answer."""
        self._ambiguous = 0
        if self._smoothed_s is None:
            self._smoothed_s = seconds
            self._variation_s = seconds / 2
            return
        error = seconds - self._smoothed_s
        self._variation_s += _VARIATION_GAIN * (abs(error) - self._variation_s)
        self._smoothed_s += _SMOOTHED_GAIN * error

    @property
    def timeout_s(self) -> float:
        """Time after which a request is repeated."""
        if self._smoothed_s is None:
            return FIRST_TIMEOUT_S
        wanted = self._smoothed_s + 4 * self._variation_s
        return min(max(wanted, SHORTEST_TIMEOUT_S), LONGEST_TIMEOUT_S)


class FrameLoss:
    """Ratio of lost frames of one component, by gaps in its sequence numbers."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._sent = self._lost = 0.0

    def take(self, message: Message) -> None:
        """Handle a frame."""
        number = message.get_seq()
        step = 1 if self._last is None else (number - self._last) % _ROUND
        if not 1 <= step < _ROUND // 2:
            return  # Late or repeated
        self._last = number
        self._sent += step
        self._lost += step - 1
        if self._sent > _MEMORY:
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
