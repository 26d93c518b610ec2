"""Errors of the broker itself: counted, logged with their traceback, shown with their vehicle.

An error that nobody expected ends what it happened in, and no more: the program's loop catches it
at the border of one vehicle's session, of one datagram, of one piece of work. What is caught is
never silent.
"""

import logging
import math
import traceback
from collections import Counter
from typing import Final

TRACEBACK_EVERY_S: Final = 30.0
"""The same error of the same vehicle is logged no more often, however often it happens."""
SHOWN_FOR_S: Final = 600.0
"""A warning ends so long after its newest error."""
PLACES_KEPT: Final = 256

_LOG = logging.getLogger(__name__)


def reason_of(error: Exception) -> str:
    """Say in one line what went wrong inside the broker."""
    return f"internal error of the broker: {type(error).__name__}: {error}"


class Faults:
    """Everything that went wrong inside one broker."""

    def __init__(self) -> None:
        self.count = 0
        self._of: Counter[str] = Counter()
        self._newest: dict[str, tuple[str, float]] = {}
        self._logged_at: dict[tuple[str, str], float] = {}

    def note(self, owner: str, error: Exception, now: float) -> str:
        """Count an error of an owner, such as a vehicle; gives the reason in one line."""
        self.count += 1
        self._of[owner] += 1
        reason = reason_of(error)
        self._newest[owner] = reason, now
        if self._is_due(owner, error, now):
            _LOG.error("%s: %s (error %d)", owner, reason, self._of[owner], exc_info=error)
        return reason

    def warning(self, owner: str, now: float) -> str | None:
        """What somebody should know about an owner: how often, and what it was last.

        None without an error in the last 10 minutes; the count goes on.
        """
        reason, noted_at = self._newest.get(owner, ("", -math.inf))
        if now - noted_at >= SHOWN_FOR_S:
            return None
        return f"{reason} ({self._of[owner]} so far)"

    def _is_due(self, owner: str, error: Exception, now: float) -> bool:
        frames = traceback.extract_tb(error.__traceback__)
        last = frames[-1] if frames else None
        place = owner, f"{type(error).__name__} {last and (last.filename, last.lineno)}"
        if now - self._logged_at.get(place, -math.inf) < TRACEBACK_EVERY_S:
            return False
        if len(self._logged_at) >= PLACES_KEPT:
            self._logged_at.clear()
        self._logged_at[place] = now
        return True
