"""Which posts a broker that is killed must have stored on its disk."""

from collections.abc import Callable
from typing import Final

from dst.scheduler import Scheduler
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post

STORED_AFTER_S: Final = 12.0
"""A post that has failed is on the broker's disk within this time."""


class Owed:
    """Posts that have failed so long before the broker ended that they must be on its disk.

    Each of them reaches the edge server in the end.
    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._taken: set[str] = set()  # Idempotency keys
        self._failed: dict[str, tuple[float, str]] = {}  # By idempotency key: when first, what
        self.life = 0
        """How often the broker has ended: what it had sent before concerns no later one."""
        self.texts: dict[str, str] = {}
        """By idempotency key: what the edge server has to get."""

    def note(self, post: Post, arrived: Answer | Exception) -> None:
        """Note a post that was not answered, or refused for the time being."""
        is_failure = isinstance(arrived, Exception) or arrived.status_code >= 500
        is_kept = post.must_survive and not post.is_acceptance
        key = post.idempotency_key
        if is_failure and is_kept and key is not None and key not in self._taken:
            self._failed.setdefault(key, (self._scheduler.now_s, post.path))

    def take(self, post: Post, answer: Answer) -> None:
        """Note an answer of the edge server, whether or not it arrives."""
        if answer.status_code < 500 and post.idempotency_key is not None:
            self._taken.add(post.idempotency_key)
            self._failed.pop(post.idempotency_key, None)
            self.texts.pop(post.idempotency_key, None)

    def broker_ends(self, is_lasting: Callable[[str], bool], *, disk_worked_s: float) -> None:
        """Note what the broker must have stored, whose disk has worked for so long.

        `is_lasting` gives whether a post, by its idempotency key, is refused for good.
        """
        now_s = self._scheduler.now_s
        for key, (failed_s, path) in self._failed.items():
            is_stored = STORED_AFTER_S < now_s - failed_s < disk_worked_s - STORED_AFTER_S
            if is_stored and not is_lasting(key):
                self.texts[key] = f"POST {path} is lost, which failed at {failed_s:.1f} s"
        self._failed.clear()
        self.life += 1
