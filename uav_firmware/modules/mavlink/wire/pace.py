"""How much bulk data may be sent and how much work done for it: a bucket of tokens.

One token is what one packet of a file costs, some 15 us. The bucket fills with vehicle time, so
that whatever peers ask for, the control loop keeps its time and a peer's buffer does not flow
over.
"""

from typing import Final

TOKENS_PER_SECOND: Final = 4_000
"""Of 239 bytes each: 0.95 MB/s."""
TOKENS_MAX: Final = 256
"""What may be done at once: 4 ms of work."""


class Pace:
    """A bucket of tokens; a costly piece of work may leave it in debt."""

    def __init__(self, per_second: int = TOKENS_PER_SECOND, most: int = TOKENS_MAX) -> None:
        self._per_second = per_second
        self._most = most
        self._tokens: float = most
        self._filled_us = 0

    def refill(self, now_us: int) -> None:
        """Add what has come together since the last call."""
        gained = (now_us - self._filled_us) * 1e-6 * self._per_second
        self._filled_us = now_us
        self._tokens = min(self._tokens + max(gained, 0.0), float(self._most))

    @property
    def ready(self) -> bool:
        """Whether there is a token left."""
        return self._tokens >= 1.0

    def spend(self, tokens: int = 1) -> None:
        """Take tokens; a debt is paid before anything else is done."""
        self._tokens -= tokens
