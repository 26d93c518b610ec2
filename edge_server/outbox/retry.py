"""How long to wait before the next try; pure.

Full jitter: a uniform draw from zero to the capped exponential, so that many farms whose cloud
comes back do not all knock at once (M. Brooker, "Exponential Backoff and Jitter", AWS, 2015).
"""

from random import Random
from typing import NamedTuple

LONGEST_RETRY_AFTER_S = 3600.0
"""A cloud may ask for more patience than our own cap, but not for ever."""

_LARGEST_EXPONENT = 30


class Backoff(NamedTuple):
    """The first wait is at most `base_s`, any wait at most `cap_s`."""

    base_s: float
    cap_s: float

    def delay_s(self, failures: int, random: Random, retry_after_s: float | None = None) -> float:
        """Wait after so many failures in a row (1 or more); the cloud's own wish is a minimum."""
        ceiling = min(self.cap_s, self.base_s * 2.0 ** min(failures - 1, _LARGEST_EXPONENT))
        wished = min(max(retry_after_s or 0.0, 0.0), LONGEST_RETRY_AFTER_S)
        return max(random.uniform(0.0, ceiling), wished)
