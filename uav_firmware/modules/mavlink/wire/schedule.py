"""Schedule of the streams to one peer.

Due times are multiples of the interval in vehicle time plus a phase that depends on the message
only. Peers with the same rate are therefore due in the same control step and share a packed
payload, while different messages of the same rate are spread over the steps.

A key is a message id; above its 24 bits is the component, 0 for the autopilot. One message of
several components is due in the same step, and the autopilot's is both the first and the last of
them. pymavlink knows a vehicle's system id after `wait_heartbeat` only if the first HEARTBEAT that
arrives is the autopilot's, and it and MAVSDK take the newest of any component for the autopilot's.
"""

from collections.abc import Mapping
from functools import cache
from heapq import heapify, heapreplace
from typing import Final

LONGEST_INTERVAL_US: Final = 1_000_000
"""Shortest interval of a schedule without streams [us]."""

_PHASE_STEPS: Final = 23
_PHASE_STEP_US: Final = 4000
_MESSAGE_IDS: Final = 0xFFFFFF
"""The bits of a key that are the message id, and so the largest key of the autopilot."""


@cache
def _phase_us(key: int) -> int:
    """Phase of a message [us]: below 0.1 s, spread by a prime."""
    return (key & _MESSAGE_IDS) * 7 % _PHASE_STEPS * _PHASE_STEP_US


def _due(due_us: int, key: int) -> tuple[int, bool, int]:
    """Entry of the heap: other components come before the autopilot."""
    return due_us, key <= _MESSAGE_IDS, key


def _autopilot_first(taken: list[int]) -> list[int]:
    """Put what the autopilot sends too before what other components send of it."""
    of_others = {key & _MESSAGE_IDS for key in taken if key > _MESSAGE_IDS}
    return [key for key in taken if key in of_others] + taken if of_others else taken


class Schedule:
    """Intervals and due times of the streams to one peer."""

    def __init__(self, default_intervals_us: Mapping[int, int]) -> None:
        """Start with the defaults: key to interval [us]."""
        self._defaults = default_intervals_us
        self._intervals = dict(default_intervals_us)
        self._due = sorted(_due(0, key) for key in self._intervals)  # A heap [us]
        self.next_due_us: int = 0
        self.shortest_interval_us = self._shortest_interval_us()

    def interval_us(self, key: int) -> int:
        """Current interval [us]; 0 when the message is off."""
        return self._intervals.get(key, 0)

    def default_interval_us(self, key: int) -> int:
        """Default interval [us]; 0 when the message is off by default."""
        return self._defaults.get(key, 0)

    def set_interval(self, key: int, interval_us: int, now_us: int) -> None:
        """Send a message every `interval_us` from now on; 0 stops it."""
        self._intervals.pop(key, None)
        self._due = [entry for entry in self._due if entry[2] != key]
        if interval_us > 0:
            self._intervals[key] = interval_us
            self._due.append(_due(now_us, key))
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
            key = due[0][2]
            interval_us, phase_us = self._intervals[key], _phase_us(key)
            next_us = ((now_us - phase_us) // interval_us + 1) * interval_us + phase_us
            heapreplace(due, _due(next_us, key))
            taken.append(key)
        self.next_due_us = due[0][0] if due else now_us + _PHASE_STEP_US
        return _autopilot_first(taken)
