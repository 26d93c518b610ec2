"""Internal errors of the broker: counted, logged with their traceback, shown with their vehicle.

An unexpected error ends only what it occurred in: the loop catches it at the boundary of one
vehicle's session, one datagram or one piece of work. Every caught error is recorded here.
"""

import logging
import math
import traceback
from collections import Counter
from typing import Final

TRACEBACK_INTERVAL_S: Final = 30.0
"""Shortest interval of log entries about the same error of the same vehicle."""
WARNING_DURATION_S: Final = 600.0
"""A warning ends so long after the latest error."""
LOCATIONS_KEPT: Final = 256

_LOG = logging.getLogger(__name__)


def reason_of(error: Exception) -> str:
    """Describe an internal error in one line."""
    return f"internal error of the broker: {type(error).__name__}: {error}"


class InternalErrors:
    """The internal errors of one broker."""

    def __init__(self) -> None:
        self.count = 0
        self._counts: Counter[str] = Counter()
        self._latest: dict[str, tuple[str, float]] = {}
        self._logged_at: dict[tuple[str, str], float] = {}

    def record(self, owner: str, error: Exception, now: float) -> str:
        """Count an error of an owner, such as a vehicle; returns its description in one line."""
        self.count += 1
        self._counts[owner] += 1
        reason = reason_of(error)
        self._latest[owner] = reason, now
        if self._is_due(owner, error, now):
            _LOG.error("%s: %s (error %d)", owner, reason, self._counts[owner], exc_info=error)
        return reason

    def warning(self, owner: str, now: float) -> str | None:
        """Latest error of an owner and their count.

        None without an error in the last 10 minutes; the count continues.
        """
        reason, noted_at = self._latest.get(owner, ("", -math.inf))
        if now - noted_at >= WARNING_DURATION_S:
            return None
        return f"{reason} ({self._counts[owner]} so far)"

    def _is_due(self, owner: str, error: Exception, now: float) -> bool:
        frames = traceback.extract_tb(error.__traceback__)
        last = frames[-1] if frames else None
        place = owner, f"{type(error).__name__} {last and (last.filename, last.lineno)}"
        if now - self._logged_at.get(place, -math.inf) < TRACEBACK_INTERVAL_S:
            return False
        if len(self._logged_at) >= LOCATIONS_KEPT:
            self._logged_at.clear()
        self._logged_at[place] = now
        return True
