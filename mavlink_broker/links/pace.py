"""How fast a radio is written to, by its own word: RADIO_STATUS says how much buffer is free.

A telemetry radio takes from the line faster than it can send, and throws away what does not fit.
As PX4 does with its streams, the rate goes down by steps when the buffer fills, and slowly up
again when it is empty. Nobody signs these reports, so a forged one may slow a line down to a tenth
and never stop it.
"""

from typing import Final

FULL_PERCENT: Final = 25
EMPTY_PERCENT: Final = 90
SLOWER: Final = 0.8
FASTER: Final = 1.05
SLOWEST: Final = 0.1
BITS_PER_BYTE: Final = 10
"""On a serial line: a start bit, eight bits, a stop bit."""
BURST_S: Final = 0.25


class Pace:
    """Bytes that may be written; without a report, or at full rate, any number."""

    def __init__(self, baud: int) -> None:
        self._line_bytes_s = baud / BITS_PER_BYTE
        self.factor = 1.0
        self._saved = 0.0  # [bytes] May be written at once
        self._at: float | None = None

    @property
    def bytes_s(self) -> float:
        """Rate that is kept."""
        return self.factor * self._line_bytes_s

    def report(self, free_percent: int) -> None:
        """Take a radio's word about its buffer."""
        if free_percent < FULL_PERCENT:
            self.factor = max(SLOWEST, SLOWER * self.factor)
        elif free_percent > EMPTY_PERCENT:
            self.factor = min(1.0, FASTER * self.factor)

    def allows(self, now: float) -> bool:
        """Whether another frame may be written."""
        if self.factor >= 1.0:
            self._at, self._saved = now, 0.0
            return True
        passed_s = 0.0 if self._at is None else now - self._at
        self._at = now
        self._saved = min(self._saved + passed_s * self.bytes_s, BURST_S * self.bytes_s)
        return self._saved >= 0.0

    def wrote(self, count: int) -> None:
        """Note what was written."""
        if self.factor < 1.0:
            self._saved -= count
