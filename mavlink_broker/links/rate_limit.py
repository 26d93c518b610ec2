"""Limits the rate at which a radio is written to, by the free buffer in its RADIO_STATUS.

A telemetry radio reads the line faster than it transmits and discards what does not fit. As PX4
does with its streams, the rate decreases in steps while the buffer fills and increases slowly
while it is empty. These reports are not signed, so a forged one may slow a line down to a tenth
but never stops it.
"""

from typing import Final

LOW_FREE_PERCENT: Final = 25
HIGH_FREE_PERCENT: Final = 90
DECREASE: Final = 0.8
INCREASE: Final = 1.05
MIN_FACTOR: Final = 0.1
BITS_PER_BYTE: Final = 10
"""On a serial line: a start bit, eight bits, a stop bit."""
BURST_S: Final = 0.25


class RateLimiter:
    """How many bytes may be written; any number without a report or at the full rate."""

    def __init__(self, baud: int) -> None:
        self._line_bytes_s = baud / BITS_PER_BYTE
        self.factor = 1.0
        self._allowance_bytes = 0.0  # May be written at once
        self._at: float | None = None

    @property
    def bytes_s(self) -> float:
        """The current rate."""
        return self.factor * self._line_bytes_s

    def report(self, free_percent: int) -> None:
        """Follow RADIO_STATUS.txbuf, the free part of the radio's buffer."""
        if free_percent < LOW_FREE_PERCENT:
            self.factor = max(MIN_FACTOR, DECREASE * self.factor)
        elif free_percent > HIGH_FREE_PERCENT:
            self.factor = min(1.0, INCREASE * self.factor)

    def allows(self, now: float) -> bool:
        """Whether another frame may be written."""
        if self.factor >= 1.0:
            self._at, self._allowance_bytes = now, 0.0
            return True
        passed_s = 0.0 if self._at is None else now - self._at
        self._at = now
        self._allowance_bytes = min(
            self._allowance_bytes + passed_s * self.bytes_s, BURST_S * self.bytes_s
        )
        return self._allowance_bytes >= 0.0

    def written(self, count: int) -> None:
        """Count bytes that were written."""
        if self.factor < 1.0:
            self._allowance_bytes -= count
