"""Rate limits: requests of a key, unknown keys from an address, sign-ins of a person.

Counted in memory by sliding windows of one minute, in each server process separately. The broker
has a limit of its own, so that people and vehicles cannot starve each other.
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
from edge_server.connections.client_address import network_of
from edge_server.store.rows.keys import Role, StoredKey

_CLEANUP_INTERVAL_S: Final = 60.0
_ADDRESSES_PER_NAME: Final = 6
"""So many addresses may use up their sign-ins with one name before it is blocked for all."""


_PLACES_KEPT: Final = 1000
"""Names with an address from which they have signed in."""


class _Counts(MemoryStorage):
    """Deletes expired windows once a minute; the base class starts a thread for every request."""

    @property  # type: ignore[override]  # the base class has an attribute
    def timer(self) -> "_ThrottledTimer":
        """The timer of the next cleanup."""
        return self._timer

    @timer.setter
    def timer(self, made: threading.Timer) -> None:
        self._timer = _ThrottledTimer(made)


class _ThrottledTimer:
    """A timer that reports itself alive for a minute after its start, which delays the next one."""

    def __init__(self, timer: threading.Timer) -> None:
        self._timer = timer
        self._alive_until = 0.0

    def start(self) -> None:
        """Start it."""
        self._timer.daemon = True
        self._timer.start()
        self._alive_until = time.monotonic() + _CLEANUP_INTERVAL_S

    def is_alive(self) -> bool:
        """Whether it is too early for the next one."""
        return time.monotonic() < self._alive_until


class Limits:
    """Counts requests; safe to use from several threads."""

    def __init__(self, config: Config) -> None:
        self._limiter = SlidingWindowCounterRateLimiter(_Counts())
        self._of_people = RateLimitItemPerMinute(config.requests_per_minute, namespace="key")
        self._of_broker = RateLimitItemPerMinute(config.broker_requests_per_minute, namespace="key")
        self._of_failures = RateLimitItemPerMinute(config.failures_per_minute, namespace="wrong")
        attempts = config.sign_ins_per_minute
        self._of_sign_ins = RateLimitItemPerMinute(attempts, namespace="sign-in")
        self._of_names = RateLimitItemPerMinute(
            attempts * _ADDRESSES_PER_NAME, namespace="sign-in name"
        )
        self._lock = threading.Lock()
        self._signed_in: dict[tuple[str | None, str], None] = {}  # The oldest first

    def count(self, key: StoredKey) -> None:
        """Count a request of a key; raises 429 beyond its limit."""
        limit = self._of_broker if key.role == Role.BROKER else self._of_people
        self._hit(limit, key.prefix, "too many requests with this key")

    def count_failure(self, address: str | None) -> None:
        """Count an unknown key from an address; raises 429 beyond the limit."""
        self._hit(self._of_failures, network_of(address), "too many unknown keys from this address")

    def count_sign_in(self, name: str | None, address: str | None) -> None:
        """Count an attempt to sign in, successful or not; raises 429 beyond the limits.

        `name` is None for a link, whose token nobody can guess. Who guesses a name's password from
        many addresses does not block those from which the person has signed in before.
        """
        reason, network = "too many attempts to sign in", network_of(address)
        self._hit(self._of_sign_ins, network, reason)
        with self._lock:
            is_known = (name, network) in self._signed_in
        if name is not None and not is_known:
            self._hit(self._of_names, name, reason)

    def note_sign_in(self, name: str, address: str | None) -> None:
        """Note from where a person has signed in; the last ones are kept until a restart."""
        place = name, network_of(address)
        with self._lock:
            self._signed_in.pop(place, None)
            self._signed_in[place] = None
            if len(self._signed_in) > _PLACES_KEPT:
                del self._signed_in[next(iter(self._signed_in))]

    def _hit(self, limit: RateLimitItem, who: str, reason: str) -> None:
        if self._limiter.hit(limit, who):
            return
        reset_at, _ = self._limiter.get_window_stats(limit, who)
        raise TooManyRequests(reason, retry_after=max(math.ceil(reset_at - time.time()), 1))
