"""An edge server that can be unreachable, and the broker's outbox and spool; simulated time.

In place of `EdgeClient`'s threads: the same outbox, the same spool, one answer at a time.
"""

import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavlink_broker.edge.outbox import Outbox, Post
from mavlink_broker.edge.spool_writer import SpoolWriter
from tests.support.fake_edge import FakeEdge
from tests.support.spooled_posts import spool_in


class UnreachableEdge(FakeEdge):
    """Stores the first of two posts with one key, as the real one does."""

    def __init__(
        self, folder: Path, now: Callable[[], float], *, sends_before_it_asks: bool = True
    ) -> None:
        """Without `sends_before_it_asks` the broker takes work while it has unsent reports."""
        super().__init__()
        self.is_unreachable = False
        self._folder = folder
        self._now = now
        self._sends_before_it_asks = sends_before_it_asks
        self._keys: set[str] = set()
        self._begin()

    def _begin(self) -> None:
        self.queue = Outbox(random.Random(1))
        self.spool = spool_in(self._folder)
        self._writer = SpoolWriter(self.spool, self.queue, threading.Condition())

    def lose_broker(self) -> None:
        """Lose the posts that wait in memory."""
        self.spool.database.close()
        self._begin()

    def post(self, post: Post) -> None:
        """Queue a post, and send those that can be sent."""
        self.queue.put(post)
        self._send()

    def take_work(self) -> list[dict[str, Any]]:
        """Give the work of vehicles without unsent reports; the rest when they are sent."""
        if self.is_unreachable:
            self._send()
            return []
        unsent = (
            self.queue.vehicles_with_unsent_reports if self._sends_before_it_asks else frozenset()
        )
        held = [work for work in self._new if work["vehicle_id"] in unsent]
        self._new = [work for work in self._new if work not in held]
        due = super().take_work()
        self._send()
        self._new = [dict(self.work[w["id"]]) for w in held if w["id"] not in self.closed]
        return due

    def _send(self) -> None:
        while (post := self.queue.take(self._now())) is not None:
            if self.is_unreachable:
                self.queue.failed(post, self._now(), is_unreachable=True)
            else:
                self.queue.answered(post)
                self._receive(post)
        self._writer.run_once(self._now())

    def _receive(self, post: Post) -> None:
        if post.idempotency_key in self._keys:
            return
        if post.idempotency_key is not None:
            self._keys.add(post.idempotency_key)
        super().post(post)
