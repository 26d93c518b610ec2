"""When silence means something: not while a lossy link explains it.

Five messages in a row are lost once in an hour where every fifth is; who took that for a failure
would end missions for nothing. So the patience grows with the share of frames that are lost.
"""

import math
from dataclasses import dataclass
from typing import Final

from mavlink_broker.mavlink.dialect import Message

SILENT_S: Final = 5.0
LONGEST_S: Final = 30.0
BY_CHANCE: Final = 1e-6
"""How improbable it must be that all messages of a silence were lost."""
INTERVALS: Final = 3.0
ARMED_BY: Final = 3
"""Messages after which a source is known to speak regularly."""
_MEMORY: Final = 500
_ROUND: Final = 256
_GAIN: Final = 0.2


class LinkLoss:
    """Share of one component's frames that are lost, by the gaps in its numbers."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._sent = self._lost = 0.0

    def take(self, message: Message) -> None:
        """Take a frame."""
        number = message.get_seq()
        step = 1 if self._last is None else (number - self._last) % _ROUND
        if not 1 <= step < _ROUND // 2:
            return  # It was overtaken, or comes again
        self._last = number
        self._sent += step
        self._lost += step - 1
        if self._sent > _MEMORY:
            self._sent, self._lost = self._sent / 2, self._lost / 2

    @property
    def share(self) -> float:
        """Of 0 to 1."""
        return self._lost / self._sent if self._sent else 0.0


@dataclass(slots=True)
class Voice:
    """One source that speaks regularly."""

    heard_at: float
    count: int = 1
    interval_s: float = 1.0
    has_fallen_silent: bool = False  # Until it is heard again, whatever the link is like by then

    def heard(self, now: float) -> None:
        """Take that it has spoken."""
        gap_s = now - self.heard_at
        self.interval_s = (
            gap_s if self.count == 1 else self.interval_s + _GAIN * (gap_s - self.interval_s)
        )
        self.count += 1
        self.heard_at = now
        self.has_fallen_silent = False

    def excuse(self, now: float) -> None:
        """Take that nobody could have heard it."""
        self.heard_at = now

    def is_silent(self, now: float, loss: float) -> bool:
        """Whether it has fallen silent, where such a share of its frames is lost by the way."""
        if self.count >= ARMED_BY and now - self.heard_at >= self._patience_s(loss):
            self.has_fallen_silent = True
        return self.has_fallen_silent

    def _patience_s(self, loss: float) -> float:
        expected_s = INTERVALS * self.interval_s
        if loss > 0.0:
            in_a_row = math.log(BY_CHANCE) / math.log(min(loss, 0.9))
            expected_s = max(expected_s, min(in_a_row * self.interval_s, LONGEST_S))
        return max(SILENT_S, expected_s)
