"""When each message is due to one peer.

Due times lie on a grid of whole intervals of vehicle time, shifted by a phase that depends on
the message alone. Peers with the same rate are therefore due in the same control step and
share one packed payload, while different messages of the same rate spread over the steps.
"""

from collections.abc import Mapping
from typing import Final

LONGEST_INTERVAL_US: Final = 1_000_000
"""What counts as the interval of one to whom nothing is sent [us]."""

_PHASE_STEPS: Final = 23
_PHASE_STEP_US: Final = 4000


def _phase_us(message_id: int) -> int:
    """Shift of a message's grid [us]: below a tenth of a second, spread by a prime."""
    return message_id * 7 % _PHASE_STEPS * _PHASE_STEP_US


class Schedule:
    """Intervals of one peer's messages and what is due next."""

    def __init__(self, default_intervals_us: Mapping[int, int]) -> None:
        """Begin with the defaults: message id to interval [us]."""
        self._defaults = default_intervals_us
        self._intervals = dict(default_intervals_us)
        self._due = dict.fromkeys(self._intervals, 0)
        self.next_due_us: int = 0
        self.shortest_interval_us = self._shortest_interval_us()

    def interval_us(self, message_id: int) -> int:
        """Present interval [us]; 0 when the message is not sent."""
        return self._intervals.get(message_id, 0)

    def default_interval_us(self, message_id: int) -> int:
        """Interval [us] that the message has unasked; 0 when it is not sent."""
        return self._defaults.get(message_id, 0)

    def set_interval(self, message_id: int, interval_us: int, now_us: int) -> None:
        """Send a message every `interval_us` from now on; 0 stops it."""
        self._intervals.pop(message_id, None)
        self._due.pop(message_id, None)
        if interval_us > 0:
            self._intervals[message_id] = interval_us
            self._due[message_id] = now_us
        self.next_due_us = min(self._due.values(), default=now_us)
        self.shortest_interval_us = self._shortest_interval_us()

    def _shortest_interval_us(self) -> int:
        return min(self._intervals.values(), default=LONGEST_INTERVAL_US)

    def take_due(self, now_us: int) -> list[int]:
        """Messages due at `now_us`; each is due again at the next point of its grid."""
        if now_us < self.next_due_us:
            return []
        due = [message_id for message_id, time_us in self._due.items() if time_us <= now_us]
        for message_id in due:
            interval = self._intervals[message_id]
            phase = _phase_us(message_id)
            self._due[message_id] = ((now_us - phase) // interval + 1) * interval + phase
        self.next_due_us = min(self._due.values(), default=now_us + _PHASE_STEP_US)
        return due
