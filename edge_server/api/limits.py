"""How often a key may call, and how often an address may show wrong keys.

Counted in memory by sliding windows of a minute, in each server by itself. What vehicles report
has a generous limit of its own, so that people and vehicles cannot starve each other.
"""

import math
import threading
import time
from typing import Final

from limits import RateLimitItem, RateLimitItemPerMinute
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter
from werkzeug.exceptions import TooManyRequests

from edge_server.config import Config
from edge_server.front.client_address import network_of
from edge_server.store.keys import Role, StoredKey

_FORGETTING_S: Final = 60.0


class _Counts(MemoryStorage):
    """Forgets what has expired once a minute, not in a thread of its own for every request."""

    @property  # type: ignore[override]  # the base class has an attribute
    def timer(self) -> "_Rarely":
        """What stands for the next thread that forgets."""
        return self._timer

    @timer.setter
    def timer(self, made: threading.Timer) -> None:
        self._timer = _Rarely(made)


class _Rarely:
    """A timer that counts as alive for a minute after its start, so that none follows it soon."""

    def __init__(self, timer: threading.Timer) -> None:
        self._timer = timer
        self._alive_until = 0.0

    def start(self) -> None:
        """Start it."""
        self._timer.daemon = True
        self._timer.start()
        self._alive_until = time.monotonic() + _FORGETTING_S

    def is_alive(self) -> bool:
        """Whether it is too early for the next one."""
        return time.monotonic() < self._alive_until


class Limits:
    """Counts; safe to share between threads."""

    def __init__(self, config: Config) -> None:
        self._limiter = SlidingWindowCounterRateLimiter(_Counts())
        self._of_people = RateLimitItemPerMinute(config.requests_per_minute, namespace="key")
        self._of_broker = RateLimitItemPerMinute(config.broker_requests_per_minute, namespace="key")
        self._of_failures = RateLimitItemPerMinute(config.failures_per_minute, namespace="wrong")

    def count(self, key: StoredKey) -> None:
        """Count a request of a key; raises 429 beyond its limit."""
        limit = self._of_broker if key.role == Role.BROKER else self._of_people
        self._hit(limit, key.prefix, "this key asks too often")

    def count_failure(self, address: str | None) -> None:
        """Count a wrong key from an address; raises 429 beyond the limit."""
        self._hit(self._of_failures, network_of(address), "too many wrong keys from this address")

    def _hit(self, limit: RateLimitItem, who: str, reason: str) -> None:
        if self._limiter.hit(limit, who):
            return
        reset_at, _ = self._limiter.get_window_stats(limit, who)
        raise TooManyRequests(reason, retry_after=max(math.ceil(reset_at - time.time()), 1))
