"""How often a key may call, and how often an address may show wrong keys.

Counted in memory by sliding windows of a minute, in each server by itself. What vehicles report
has a generous limit of its own, so that people and vehicles cannot starve each other.
"""

import ipaddress
import math
import time
from typing import Final

from limits import RateLimitItem, RateLimitItemPerMinute
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter
from werkzeug.exceptions import TooManyRequests

from edge_server.config import Config
from edge_server.store.keys import Role, StoredKey

_NETWORK_BITS: Final = 64
"""Of an IPv6 address: one household has all the others."""


class Limits:
    """Counts; safe to share between threads."""

    def __init__(self, config: Config) -> None:
        self._limiter = SlidingWindowCounterRateLimiter(MemoryStorage())
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


def network_of(address: str | None) -> str:
    """Give by what an address is counted: itself, or its household when it is IPv6."""
    try:
        parsed = ipaddress.ip_address(address or "")
    except ValueError:
        return "unknown"
    if isinstance(parsed, ipaddress.IPv6Address) and parsed.ipv4_mapped is None:
        return str(ipaddress.ip_network((parsed, _NETWORK_BITS), strict=False))
    return str(parsed)
