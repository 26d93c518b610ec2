"""When the next state vector is due: with the position that comes in its turn, so that it is new.

A vehicle tells its position a few times a second. A vector that is made between two of them is
already as old as the last one when it begins its way to the cloud.
"""

from dataclasses import dataclass
from typing import Final

PATIENCE_S: Final = 1.0
"""How long a vector waits for a new position; after that an older one is told, unless stale."""


@dataclass(slots=True)
class VectorPace:
    """A beat of `every_s`; each vector waits for the first position behind its beat."""

    every_s: float
    _due_at: float = 0.0

    def is_due(self, now: float, position_age_s: float | None) -> bool:
        """Whether to tell one now; without any position (None) there is nothing to wait for."""
        late_s = now - self._due_at
        if late_s < 0.0 or position_age_s is None:
            return False
        return position_age_s <= late_s or late_s >= PATIENCE_S

    def told(self, now: float) -> None:
        """Begin the next turn, unless one was told ahead of its turn because somebody asked.

        Beats that were missed are not made up for.
        """
        if now < self._due_at:
            return
        self._due_at += self.every_s
        if self._due_at <= now:
            self._due_at = now + self.every_s
