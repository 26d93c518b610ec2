"""Schedule of the streams to one peer.

Due times are multiples of the interval in vehicle time plus a phase that depends on the message
only. Peers with the same rate are therefore due in the same control step and share a packed
payload, while different messages of the same rate are spread over the steps.
"""

from collections.abc import Mapping
from functools import cache
from heapq import heapify, heapreplace
from typing import Final

LONGEST_INTERVAL_US: Final = 1_000_000
"""Shortest interval of a schedule without streams [us]."""

_PHASE_STEPS: Final = 23
_PHASE_STEP_US: Final = 4000


@cache
def _phase_us(message_id: int) -> int:
    """Phase of a message [us]: below 0.1 s, spread by a prime."""
    return message_id * 7 % _PHASE_STEPS * _PHASE_STEP_US


class Schedule:
    """Intervals and due times of the streams to one peer."""

    def __init__(self, default_intervals_us: Mapping[int, int]) -> None:
        """Start with the defaults: message id to interval [us]."""
        self._defaults = default_intervals_us
        self._intervals = dict(default_intervals_us)
        self._due = sorted((0, message_id) for message_id in self._intervals)  # A heap [us]
        self.next_due_us: int = 0
        self.shortest_interval_us = self._shortest_interval_us()

    def interval_us(self, message_id: int) -> int:
        """Current interval [us]; 0 when the message is off."""
        return self._intervals.get(message_id, 0)

    def default_interval_us(self, message_id: int) -> int:
        """Default interval [us]; 0 when the message is off by default."""
        return self._defaults.get(message_id, 0)

    def set_interval(self, message_id: int, interval_us: int, now_us: int) -> None:
        """Send a message every `interval_us` from now on; 0 stops it."""
        self._intervals.pop(message_id, None)
        self._due = [entry for entry in self._due if entry[1] != message_id]
        if interval_us > 0:
            self._intervals[message_id] = interval_us
            self._due.append((now_us, message_id))
        heapify(self._due)
        self.next_due_us = self._due[0][0] if self._due else now_us
        self.shortest_interval_us = self._shortest_interval_us()

    def _shortest_interval_us(self) -> int:
        return min(self._intervals.values(), default=LONGEST_INTERVAL_US)

    def take_due(self, now_us: int) -> list[int]:
        """Return the messages due at `now_us`, and schedule each one again."""
        taken: list[int] = []
        due = self._due
        while due and due[0][0] <= now_us:
            message_id = due[0][1]
            interval_us, phase_us = self._intervals[message_id], _phase_us(message_id)
            next_us = ((now_us - phase_us) // interval_us + 1) * interval_us + phase_us
            heapreplace(due, (next_us, message_id))
            taken.append(message_id)
        self.next_due_us = due[0][0] if due else now_us + _PHASE_STEP_US
        return taken
