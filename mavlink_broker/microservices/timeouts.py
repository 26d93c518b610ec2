"""The timeout of a repeated request, which follows the round trip of the link.

Smoothed round trip and variation as in RFC 6298 section 2, with limits for MAVLink links from the
loopback to a satellite modem. Only requests that were not repeated are sampled (Karn's
algorithm), because the answer to a repetition is ambiguous. A link that is slower than the first
timeout would then never be sampled: when every request had to be repeated, the time since the first
one is taken, which is too long rather than too short.
"""

from typing import Final

FIRST_TIMEOUT_S: Final = 1.0
SHORTEST_TIMEOUT_S: Final = 0.3
LONGEST_TIMEOUT_S: Final = 5.0
AMBIGUOUS_IN_A_ROW: Final = 2
_SMOOTHED_GAIN: Final = 1 / 8
_VARIATION_GAIN: Final = 1 / 4


class RoundTrip:
    """Estimate for one vehicle's link."""

    def __init__(self) -> None:
        self._smoothed_s: float | None = None
        self._variation_s = 0.0
        self._ambiguous = 0

    def sample_repeated(self, seconds: float) -> None:
        """Take the time [s] from the first of several requests to an answer to one of them."""
        self._ambiguous += 1
        if self._ambiguous >= AMBIGUOUS_IN_A_ROW:
            self.sample(min(seconds, LONGEST_TIMEOUT_S))

    def sample(self, seconds: float) -> None:
        """Take the time [s] between a request and its answer."""
        self._ambiguous = 0
        if self._smoothed_s is None:
            self._smoothed_s = seconds
            self._variation_s = seconds / 2
            return
        error = seconds - self._smoothed_s
        self._variation_s += _VARIATION_GAIN * (abs(error) - self._variation_s)
        self._smoothed_s += _SMOOTHED_GAIN * error

    @property
    def timeout_s(self) -> float:
        """Time after which a request is repeated."""
        if self._smoothed_s is None:
            return FIRST_TIMEOUT_S
        wanted = self._smoothed_s + 4 * self._variation_s
        return min(max(wanted, SHORTEST_TIMEOUT_S), LONGEST_TIMEOUT_S)
