"""Limits the rate of bulk data and of the work for it.

A token is the cost of one packet of a file, about 15 us. The bucket fills with vehicle time, which
protects the control loop and the receive buffers of peers.
"""

from typing import Final

TOKENS_PER_SECOND: Final = 4_000
"""0.95 MB/s at 239 bytes each."""
TOKENS_MAX: Final = 256
"""Largest burst: 4 ms of work."""


class TokenBucket:
    """A token bucket; an expensive piece of work may make it negative."""

    def __init__(self, per_second: int = TOKENS_PER_SECOND, most: int = TOKENS_MAX) -> None:
        self.per_second = per_second
        self._most = most
        self._tokens = float(most)
        self._filled_us = 0

    def refill(self, now_us: int) -> None:
        """Add the tokens of the time since the last call."""
        gained = (now_us - self._filled_us) * 1e-6 * self.per_second
        self._filled_us = now_us
        self._tokens = min(self._tokens + max(gained, 0.0), float(self._most))

    @property
    def ready(self) -> bool:
        """Whether a token is available."""
        return self._tokens >= 1.0

    def spend(self, tokens: int = 1) -> None:
        """Take tokens; a negative balance delays further work."""
        self._tokens -= tokens
