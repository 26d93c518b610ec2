"""Puts what waits for the edge server onto the disk, on a thread of its own.

Neither the loop nor those who send ever wait for the disk: they nudge, and go on. While the edge
server answers there is nothing to do.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Final

from mavlink_broker.edge.dead_letters import Orders
from mavlink_broker.edge.outbox import DEAD_KEPT, DeadLetter, Post, SendQueue, Urgency
from mavlink_broker.edge.spool import Spool
from mavlink_broker.supervision import SupervisedThread

LOOK_EVERY_S: Final = 1.0
"""An edge server that hangs nudges nobody."""
TRY_AGAIN_S: Final = 5.0
"""After the disk has refused."""
MOST_AT_ONCE: Final = 1000
"""Lines that are written together: some 15 ms of work, also when the disk refuses them again."""
END_WITHIN_S: Final = 5.0
"""How long an ending program waits for a slow disk."""

_LOG = logging.getLogger(__name__)


class Keeper:
    """Between the queue, which others use too, and the spool, which nobody else does."""

    def __init__(self, spool: Spool, queue: SendQueue, lock: threading.Condition) -> None:
        """Take the queue's lock along; what an earlier run has left goes ahead of everything."""
        self._spool = spool
        self._queue = queue
        self._lock = lock
        self._nudged = threading.Event()
        self._stopping = threading.Event()
        self._unburied: list[DeadLetter] = []
        self._dead = spool.dead.of_vehicles
        self._words_after = 0.0
        self._pictures_after = 0.0
        self._refused: set[str] = set()  # What the disk did not take when it was last asked
        self._has_ended = False
        self._thread = SupervisedThread("spool", self._run, self._stopping)
        left = spool.take_left()
        for post in left:
            queue.put(post)
        if spool.damaged:
            _LOG.warning("%s: %d lines cannot be read", spool.folder, spool.damaged)
        if left:
            _LOG.info("%d words of an earlier run are still to be told", len(left))

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def nudge(self) -> None:
        """Say that there may be something to do."""
        self._nudged.set()

    def stop(self) -> None:
        """Put everything onto the disk that waits, and end."""
        self._stopping.set()
        self._nudged.set()
        self._thread.join(END_WITHIN_S)
        if not self._thread.is_alive and not self._has_ended:
            try:  # The thread has ended in its pause behind a failure
                self._end()
            except Exception:  # noqa: BLE001  # logged; the program ends anyway
                _LOG.exception("%s: not all that waits could be kept", self._spool.folder)

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._nudged.wait(LOOK_EVERY_S)
            self._nudged.clear()
            self.go_round(time.monotonic())
        self._end()

    def _end(self) -> None:
        """Keep what waits, and leave the folder to the next run."""
        self.keep_everything(time.monotonic())
        self._spool.close()
        self._has_ended = True

    @property
    def dead_letters(self) -> dict[int, int]:
        """How many posts of each vehicle were given up and wait for a person."""
        return dict(self._dead)

    def go_round(self, now: float) -> None:
        """Let go of what has been answered, keep what is endangered."""
        self._bury(now)
        self._obey(now)
        words, pictures = now >= self._words_after, now >= self._pictures_after
        self._round(now, lambda: self._queue.endangered(now, words=words, pictures=pictures))

    def _bury(self, now: float) -> None:
        """Bring what was given up onto the disk, and only then forget that it waited."""
        with self._lock:
            self._unburied += self._queue.take_dead()
        if not self._unburied or now < self._words_after:
            return
        waiting, self._unburied = self._unburied[-DEAD_KEPT:], []
        for letter in waiting:
            number = letter.post.kept_as or self._spool.next_number()
            if not self._does("dead letters", partial(self._spool.dead.add, number, letter)):
                self._unburied.append(letter)
                self._words_after = now + TRY_AGAIN_S
                continue
            _LOG.error(
                "dead letter %d: POST %s of vehicle %d is given up: %s; see "
                "`python -m mavlink_broker dead-letters`",
                *(number, letter.post.path, letter.post.vehicle_id, letter.reason),
            )
            with self._lock:
                if letter.post.kept_as is not None:
                    self._queue.settle(letter.post.kept_as)
        self._dead = self._spool.dead.of_vehicles

    def _obey(self, now: float) -> None:
        """Send dead letters again, or remove them, as a person has asked."""
        orders = Orders()

        def look() -> None:
            nonlocal orders
            orders = self._spool.dead.take_orders()

        if not self._does("orders", look):
            return
        if orders != Orders() and not self._carry_out(orders, now):
            return  # Once more in the next round
        self._does("ended orders", self._spool.dead.end_orders)

    def _carry_out(self, orders: Orders, now: float) -> bool:
        """Do what was asked; whether the disk has taken all of it."""
        posts = [post for post in map(self._spool.dead.get, sorted(orders.retry)) if post]
        for post in posts:
            post.kept_as = self._spool.next_number()
        lost = self._keep(posts, now)
        with self._lock:
            for post in posts:
                post.kept_as = None if post.kept_as in lost else post.kept_as
                self._queue.put(post)
            self._lock.notify_all()
        dropped = sum(number in self._spool.dead for number in orders.drop)
        remove = partial(self._spool.dead.remove, orders.retry | orders.drop)
        is_removed = self._does("dead letters", remove)
        self._dead = self._spool.dead.of_vehicles
        if posts or dropped:
            _LOG.info("dead letters: %d are sent again, %d were removed", len(posts), dropped)
        return is_removed

    def keep_everything(self, now: float) -> None:
        """Keep what waits, whether it is endangered or not."""
        self._bury(now)
        while self._round(now, self._queue.unkept):
            continue

    def _round(self, now: float, choose: Callable[[], Sequence[Post]]) -> bool:
        """Write the first of what is chosen; whether there is more, and it may have room."""
        with self._lock:
            settled = self._queue.take_settled()
            waiting = choose()
            chosen = waiting[:MOST_AT_ONCE]
            for post in chosen:
                post.kept_as = self._spool.next_number()
        if settled:
            self._does("answers", partial(self._spool.settle, settled))
        missing = self._keep(chosen, now)
        lost = missing | self._spool.take_given_up()
        if lost:
            with self._lock:
                self._queue.unkeep(lost)
        is_more = len(waiting) > len(chosen)
        if is_more:
            self._nudged.set()
        return is_more and not missing

    def _keep(self, posts: Sequence[Post], now: float) -> frozenset[int]:
        """Write posts; gives the numbers that are not on the disk."""
        words = [post for post in posts if not _is_picture(post)]
        pictures = [post for post in posts if _is_picture(post)]
        if words and not self._does("words", partial(self._spool.keep_words, words)):
            self._words_after = now + TRY_AGAIN_S
        if pictures and not self._does("pictures", partial(self._spool.keep_pictures, pictures)):
            self._pictures_after = now + TRY_AGAIN_S
        return self._missing(posts)

    def _missing(self, posts: Iterable[Post]) -> frozenset[int]:
        numbers = (post.kept_as for post in posts)
        return frozenset(n for n in numbers if n is not None and n not in self._spool)

    def _does(self, what: str, change: Callable[[], None]) -> bool:
        """Change something on the disk; whether it could be done is told when that changes."""
        folder = self._spool.folder
        try:
            change()
        except OSError as error:
            if what not in self._refused:
                _LOG.warning("%s takes no more %s: %s", folder, what, error.strerror or error)
            self._refused.add(what)
            return False
        if what in self._refused:
            _LOG.info("%s takes %s again", folder, what)
        self._refused.discard(what)
        return True


def _is_picture(post: Post) -> bool:
    return post.urgency is Urgency.PICTURE
