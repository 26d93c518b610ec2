"""How long to wait for an answer, learnt from the answers so far.

Smoothed round trip and variation as in RFC 6298 section 2, limited to what MAVLink links do:
fast enough on loopback, patient enough on a satellite modem. Only exchanges that were not
repeated may be sampled (Karn's rule), for the answer to a repetition tells nothing. A link that
is slower than the first guess would never be sampled that way: when every exchange had to be
repeated, the time since the first question is taken, which is too long rather than too short.
"""

from typing import Final

FIRST_TIMEOUT_S: Final = 1.0
SHORTEST_TIMEOUT_S: Final = 0.3
LONGEST_TIMEOUT_S: Final = 5.0
DOUBTFUL_IN_A_ROW: Final = 2
_SMOOTHED_GAIN: Final = 1 / 8
_VARIATION_GAIN: Final = 1 / 4


class RoundTrip:
    """Estimate for one vehicle's link."""

    def __init__(self) -> None:
        self._smoothed_s: float | None = None
        self._variation_s = 0.0
        self._doubtful = 0

    def sample_repeated(self, seconds: float) -> None:
        """Take the time from the first of several questions to an answer to one of them."""
        self._doubtful += 1
        if self._doubtful >= DOUBTFUL_IN_A_ROW:
            self.sample(min(seconds, LONGEST_TIMEOUT_S))

    def sample(self, seconds: float) -> None:
        """Take the time between one question and its answer."""
        self._doubtful = 0
        if self._smoothed_s is None:
            self._smoothed_s = seconds
            self._variation_s = seconds / 2
            return
        error = seconds - self._smoothed_s
        self._variation_s += _VARIATION_GAIN * (abs(error) - self._variation_s)
        self._smoothed_s += _SMOOTHED_GAIN * error

    @property
    def timeout_s(self) -> float:
        """Time after which an answer has to be taken for lost."""
        if self._smoothed_s is None:
            return FIRST_TIMEOUT_S
        wanted = self._smoothed_s + 4 * self._variation_s
        return min(max(wanted, SHORTEST_TIMEOUT_S), LONGEST_TIMEOUT_S)
