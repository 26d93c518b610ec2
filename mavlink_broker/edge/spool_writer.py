"""Writes posts that wait for the edge server to the spool, on a thread of its own.

The loop and the threads that send never wait for the disk: they notify this thread and go on.
While the edge server answers, nothing is written.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from mavlink_broker.edge.outbox import MAX_DEAD_LETTERS, DeadLetter, Outbox, Post, Urgency
from mavlink_broker.edge.spool import Actions, Spool
from mavlink_broker.supervision import SupervisedThread

POLL_INTERVAL_S: Final = 1.0
"""An edge server that does not answer causes no notification."""
RETRY_AFTER_S: Final = 5.0
"""When the disk has refused."""
MAX_BATCH: Final = 1000
"""Posts per write: some 15 ms of work, also when the disk refuses them again."""
STOP_TIMEOUT_S: Final = 5.0
"""How long an ending program waits for a slow disk."""

_LOG = logging.getLogger(__name__)


class SpoolWriter:
    """Moves posts from the outbox, which other threads use too, to the spool, which none does."""

    def __init__(self, spool: Spool, outbox: Outbox, lock: threading.Condition) -> None:
        """Write the outbox's posts under its lock; those of an earlier run precede all others."""
        self._spool = spool
        self._outbox = outbox
        self._lock = lock
        self._notified = threading.Event()
        self._stopping = threading.Event()
        self._unstored: list[DeadLetter] = []
        self._dead_letters = spool.dead_letters.by_vehicle
        self._reports_after = 0.0
        self._pictures_after = 0.0
        self._refused: set[str] = set()  # What the disk refused at the last attempt
        self._has_ended = False
        self._thread = SupervisedThread("spool", self._run, self._stopping)
        inherited = spool.take_inherited()
        for post in inherited:
            outbox.put(post)
        if spool.damaged:
            _LOG.warning("%s: %d posts cannot be read", spool.database.folder, spool.damaged)
        if inherited:
            _LOG.info("%d posts of an earlier run are still to be sent", len(inherited))

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def notify(self) -> None:
        """Have the thread look for work now."""
        self._notified.set()

    def stop(self) -> None:
        """Store all posts that wait, and end."""
        self._stopping.set()
        self._notified.set()
        self._thread.join(STOP_TIMEOUT_S)
        if not self._thread.is_alive and not self._has_ended:
            try:  # The thread has ended in its pause after a failure
                self._end()
            except Exception:  # noqa: BLE001  # logged; the program ends anyway
                _LOG.exception(
                    "%s: some posts that wait could not be stored", self._spool.database.folder
                )

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._notified.wait(POLL_INTERVAL_S)
            self._notified.clear()
            self.run_once(time.monotonic())
        self._end()

    def _end(self) -> None:
        self.store_all(time.monotonic())
        self._has_ended = True

    @property
    def dead_letters(self) -> dict[int, int]:
        """The number of stored dead letters of each vehicle."""
        return dict(self._dead_letters)

    def run_once(self, now: float) -> None:
        """Remove posts that have been answered, store those at risk."""
        self._store_dead_letters(now)
        self._carry_out_actions(now)
        reports, pictures = now >= self._reports_after, now >= self._pictures_after
        self._store_batch(
            now, lambda: self._outbox.at_risk(now, reports=reports, pictures=pictures)
        )

    def _store_dead_letters(self, now: float) -> None:
        """Store dead letters, and only then remove their posts from the spool."""
        with self._lock:
            self._unstored += self._outbox.take_dead_letters()
        if not self._unstored or now < self._reports_after:
            return
        waiting, self._unstored = self._unstored[-MAX_DEAD_LETTERS:], []
        for letter in waiting:
            number = letter.post.spool_number or self._spool.next_number()
            add = partial(self._spool.dead_letters.add, number, letter)
            if not self._try("dead letters", add):
                self._unstored.append(letter)
                self._reports_after = now + RETRY_AFTER_S
                continue
            _LOG.error(
                "dead letter %d: POST %s of vehicle %d is given up: %s; see "
                "`python -m mavlink_broker dead-letters`",
                *(number, letter.post.path, letter.post.vehicle_id, letter.reason),
            )
            with self._lock:
                if letter.post.spool_number is not None:
                    self._outbox.release(letter.post.spool_number)
        self._dead_letters = self._spool.dead_letters.by_vehicle

    def _carry_out_actions(self, now: float) -> None:
        """Send dead letters again, or remove them, as a person has requested."""
        letters = self._spool.dead_letters
        taken: list[Actions] = []
        if not self._try("actions", lambda: taken.append(letters.take_actions())):
            return
        (actions,) = taken
        if actions != Actions() and not self._carry_out(actions, now):
            return  # They are tried again in the next round
        self._try("completed actions", letters.complete_actions)

    def _carry_out(self, actions: Actions, now: float) -> bool:
        """Carry actions out; whether the disk has taken all changes.

        An acceptance that an earlier version has stored is removed instead of sent: its mission
        is not flown.
        """
        letters = self._spool.dead_letters
        found = [post for post in map(letters.get, sorted(actions.retry)) if post]
        posts = [post for post in found if not post.is_acceptance]
        for post in posts:
            post.spool_number = self._spool.next_number()
        missing = self._store(posts, now)
        with self._lock:
            for post in posts:
                post.spool_number = None if post.spool_number in missing else post.spool_number
                self._outbox.put(post)
            self._lock.notify_all()
        dropped = len(found) - len(posts) + sum(number in letters for number in actions.drop)
        is_removed = self._try(
            "dead letters", partial(letters.remove, actions.retry | actions.drop)
        )
        self._dead_letters = letters.by_vehicle
        if posts or dropped:
            _LOG.info("dead letters: %d are sent again, %d were removed", len(posts), dropped)
        return is_removed

    def store_all(self, now: float) -> None:
        """Store every post that waits, at risk or not."""
        self._store_dead_letters(now)
        while self._store_batch(now, self._outbox.unspooled):
            continue

    def _store_batch(self, now: float, choose: Callable[[], Sequence[Post]]) -> bool:
        """Store the first of the chosen posts; whether there are more and may be space."""
        with self._lock:
            released = self._outbox.take_released()
            waiting = choose()
            batch = waiting[:MAX_BATCH]
            for post in batch:
                post.spool_number = self._spool.next_number()
        if released:
            self._try("answers", partial(self._spool.release, released))
        missing = self._store(batch, now)
        unspooled = missing | self._spool.take_evicted()
        if unspooled:
            with self._lock:
                self._outbox.mark_unspooled(unspooled)
        is_more = len(waiting) > len(batch)
        if is_more:
            self._notified.set()
        return is_more and not missing

    def _store(self, posts: Sequence[Post], now: float) -> frozenset[int]:
        """Write posts; gives the numbers that are not on the disk."""
        reports = [post for post in posts if not _is_picture(post)]
        pictures = [post for post in posts if _is_picture(post)]
        if reports and not self._try("reports", partial(self._spool.store_reports, reports)):
            self._reports_after = now + RETRY_AFTER_S
        if pictures and not self._try("pictures", partial(self._spool.store_pictures, pictures)):
            self._pictures_after = now + RETRY_AFTER_S
        numbers = (post.spool_number for post in posts)
        return frozenset(n for n in numbers if n is not None and n not in self._spool)

    def _try(self, what: str, change: Callable[[], None]) -> bool:
        """Change something on the disk; whether that worked is logged when it changes."""
        folder = self._spool.database.folder
        try:
            change()
        except OSError as error:
            if what not in self._refused:
                _LOG.warning("%s cannot store %s: %s", folder, what, error.strerror or error)
            self._refused.add(what)
            return False
        if what in self._refused:
            _LOG.info("%s stores %s again", folder, what)
        self._refused.discard(what)
        return True


def _is_picture(post: Post) -> bool:
    return post.urgency is Urgency.PICTURE
