"""An edge server that can be away, and what the broker keeps for it meanwhile; simulated time.

In place of `EdgeClient`'s threads: the same queue, the same spool, one answer at a time.
"""

import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavlink_broker.edge.outbox import Post, SendQueue
from mavlink_broker.edge.spool import Spool
from mavlink_broker.edge.spool_writer import Keeper
from tests.support.fake_edge import FakeEdge


class AwayEdge(FakeEdge):
    """Keeps the first of two posts with one key, as the real one does."""

    def __init__(
        self, folder: Path, now: Callable[[], float], *, tells_before_it_asks: bool = True
    ) -> None:
        """Without `tells_before_it_asks` the broker takes work while it still owes reports."""
        super().__init__()
        self.is_away = False
        self._folder = folder
        self._now = now
        self._tells_before_it_asks = tells_before_it_asks
        self._keys: set[str] = set()
        self._begin()

    def _begin(self) -> None:
        self.queue = SendQueue(random.Random(1))
        self.spool = Spool(self._folder, most_bytes=1 << 20)
        self._keeper = Keeper(self.spool, self.queue, threading.Condition())

    def lose_broker(self) -> None:
        """Lose what waits in memory."""
        self.spool.close()
        self._begin()

    def post(self, post: Post) -> None:
        """Leave a post, and send what can be sent."""
        self.queue.put(post)
        self._send()

    def take_work(self) -> list[dict[str, Any]]:
        """Give the work of those who owe nothing; the rest when they do not."""
        if self.is_away:
            self._send()
            return []
        owing = self.queue.owing if self._tells_before_it_asks else frozenset()
        held = [work for work in self._new if work["vehicle_id"] in owing]
        self._new = [work for work in self._new if work not in held]
        due = super().take_work()
        self._send()
        self._new = [dict(self.work[w["id"]]) for w in held if w["id"] not in self.closed]
        return due

    def _send(self) -> None:
        while (post := self.queue.take(self._now())) is not None:
            if self.is_away:
                self.queue.failed(post, self._now(), cut_off=True)
            else:
                self.queue.answered(post)
                self._hear(post)
        self._keeper.go_round(self._now())

    def _hear(self, post: Post) -> None:
        if post.idempotency_key in self._keys:
            return
        if post.idempotency_key is not None:
            self._keys.add(post.idempotency_key)
        super().post(post)
