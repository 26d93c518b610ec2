"""How long to wait before the next attempt; pure.

Full jitter: a uniform draw from zero to the capped exponential, so that many farms do not connect
at the same moment when the cloud is back (M. Brooker, "Exponential Backoff and Jitter", AWS, 2015).
"""

from random import Random
from typing import NamedTuple

LONGEST_RETRY_AFTER_S = 3600.0
"""The cloud may ask for a wait beyond our own cap, up to this."""

_LARGEST_EXPONENT = 30


class Backoff(NamedTuple):
    """The first wait is at most `base_s`, any wait at most `cap_s`."""

    base_s: float
    cap_s: float

    def delay_s(self, failures: int, random: Random, retry_after_s: float | None = None) -> float:
        """Return the wait after so many failures in a row (1 or more), at least `retry_after_s`."""
        ceiling = min(self.cap_s, self.base_s * 2.0 ** min(failures - 1, _LARGEST_EXPONENT))
        minimum = min(max(retry_after_s or 0.0, 0.0), LONGEST_RETRY_AFTER_S)
        return max(random.uniform(0.0, ceiling), minimum)
