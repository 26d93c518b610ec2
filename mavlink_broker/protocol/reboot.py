"""Notices that a vehicle was restarted: its time since boot goes back."""

from typing import Final

TOLERANCE_MS: Final = 1000
"""Frames that overtake one another make small steps back."""
CONFIRMATIONS: Final = 3
"""A single late frame proves nothing; a restarted vehicle goes on counting from zero."""


class RebootWatch:
    """Follows `time_boot_ms` of one vehicle."""

    def __init__(self) -> None:
        self._newest_ms: int | None = None
        self._behind = 0

    def sample(self, time_boot_ms: int) -> bool:
        """Take a time since boot; true when it proves a restart."""
        if self._newest_ms is None or time_boot_ms >= self._newest_ms:
            self._newest_ms = time_boot_ms
            self._behind = 0
        elif time_boot_ms < self._newest_ms - TOLERANCE_MS:
            self._behind += 1
        if self._behind < CONFIRMATIONS:
            return False
        self._newest_ms = time_boot_ms
        self._behind = 0
        return True
