"""Speaks to the edge server over HTTP, on threads of its own, so that the vehicles never wait.

One thread asks for work by long poll, two send what the vehicles report. Every request is
tried until it has a final answer: a success, or a refusal that would be the same tomorrow. With a
spool, what has failed once is put onto the disk meanwhile, and sent by the next run; what is
refused becomes a dead letter there.

A vehicle's work is not taken while reports of an earlier run about it wait: what the edge server
states of a mission is true only when it has received every report about it.
"""

import logging
import queue
import random
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, TypeVar

import requests

from afarcloud import wire
from mavlink_broker.edge.http import Door, NoKeyError, is_final, waits_on_purpose
from mavlink_broker.edge.outbox import Post, SendQueue
from mavlink_broker.edge.posts import is_acknowledgement
from mavlink_broker.edge.spool import Spool
from mavlink_broker.edge.spool_writer import Keeper
from mavlink_broker.edge.work import Verdict
from mavlink_broker.internal_errors import reason_of
from mavlink_broker.supervision import SupervisedThread

T = TypeVar("T")

LONG_POLL_S: Final = 20.0
SENDERS: Final = 2
RETRY_WORK_S: Final = 0.5
SHOWN_CHARACTERS: Final = 500
"""Of a refusal's text, in the log."""

_WITHDRAWN: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.GONE})
"""Answers to an acknowledgement that mean: the work is cancelled, expired, ended."""
_KNOWN: Final = "Idempotency-Key was used"
"""What the edge server says to another body under a key that it has seen."""
_LOG = logging.getLogger(__name__)


class EdgeClient:
    """The edge server as the program's loop sees it: work to take, posts to leave."""

    def __init__(
        self,
        url: str,
        key_file: Path,
        wake: Callable[[], None],
        *,
        ca_file: Path | None = None,
        spool: Spool | None = None,
    ) -> None:
        """Take where the edge server is, our key, and who alone vouches for its certificate.

        Without a spool what waits is lost with the program.
        """
        self._url = url
        self._key_file = key_file
        self._ca_file = ca_file
        self._wake = wake
        self._work: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._verdicts: queue.SimpleQueue[Verdict] = queue.SimpleQueue()
        self._posts = SendQueue(random.Random())
        lock = threading.Lock()
        self._changed = threading.Condition(lock)  # For those who send
        self._answered = threading.Condition(lock)  # For those who wait for less to be said
        self._stopping = threading.Event()
        self._reachable: bool | None = None
        self.failures = 0  # Requests that had no answer
        self._is_held_back = False
        self._keeper = None if spool is None else Keeper(spool, self._posts, self._changed)
        self._threads = [
            SupervisedThread("edge-work", self._poll_work, self._stopping),
            *(
                SupervisedThread(f"edge-send-{i}", self._send_posts, self._stopping)
                for i in range(SENDERS)
            ),
        ]

    def start(self) -> None:
        """Begin to speak."""
        if self._keeper is not None:
            self._keeper.start()
        for thread in self._threads:
            thread.start()

    def stop(self, within_s: float) -> None:
        """Send what can be sent soon, keep the rest; daemon threads do not hold the program up."""
        deadline = time.monotonic() + within_s
        with self._changed:
            while len(self._posts) and time.monotonic() < deadline:
                self._answered.wait(timeout=0.05)
        self._stopping.set()
        with self._changed:
            self._changed.notify_all()
        if self._keeper is not None:
            self._keeper.stop()

    def take_work(self) -> list[dict[str, Any]]:
        """Give the work that has come in, as the edge server wrote it."""
        return _drain(self._work)

    def take_verdicts(self) -> list[Verdict]:
        """Give what has been answered to missions that were accepted."""
        return _drain(self._verdicts)

    def post(self, post: Post) -> None:
        """Leave a post to be sent."""
        with self._changed:
            self._posts.put(post)
            self._changed.notify()
            is_in_trouble = self._posts.is_in_trouble
        if is_in_trouble:
            self._nudge()

    @property
    def waiting(self) -> int:
        """How many posts have no final answer yet."""
        with self._changed:
            return len(self._posts)

    @property
    def waiting_pictures(self) -> int:
        """How many pictures have no final answer yet."""
        with self._changed:
            return self._posts.waiting_in(wire.Kind.IMAGE.value)

    def dead_letters_of(self, vehicle_id: int) -> int:
        """How many posts of a vehicle were given up and wait for a person."""
        with self._changed:
            waiting = self._posts.dead_of(vehicle_id)
        kept = {} if self._keeper is None else self._keeper.dead_letters
        return waiting + kept.get(vehicle_id, 0)

    @property
    def dropped(self) -> int:
        """How many state vectors were given up."""
        with self._changed:
            return self._posts.dropped

    def _poll_work(self) -> None:
        door, cursor = Door(self._url, self._key_file, self._ca_file), 0
        while not self._stopping.is_set():
            try:
                # The first question after a silence is answered at once, to see who is there.
                wait_s = LONG_POLL_S if self._reachable else 0.0
                owing = self._owing()
                path = f"/broker/commands?after={cursor}&wait={wait_s:.0f}"
                response = door.request("GET", path, wait_s)
                answer = response.json() if response.status_code == HTTPStatus.OK else None
                if answer is None:
                    self._note(reachable=True)
                    _LOG.warning("the edge server gives no work: HTTP %d", response.status_code)
            except (requests.RequestException, NoKeyError) as error:
                self._note(reachable=False, why=error)
                answer = None
            if answer is None:
                cursor = 0  # Another edge server may be there next time; nothing is lost by asking
                self._stopping.wait(RETRY_WORK_S)
                continue
            self._note(reachable=True)
            cursor = self._accept(answer, owing)

    def _accept(self, answer: Any, owing: frozenset[int]) -> int:
        """Pass on the work of those who owed nothing when it was asked for; gives the cursor."""
        try:
            commands = [dict(command) for command in answer["commands"]]
            cursor = int(answer["cursor"])
        except (KeyError, TypeError, ValueError):
            _LOG.exception("the edge server's work cannot be read")
            self._stopping.wait(RETRY_WORK_S)
            return 0
        waiting_for = tuple(owing)  # Of a number that is none no hash is asked
        due = [command for command in commands if command.get("vehicle_id") not in waiting_for]
        for command in due:
            self._work.put(command)
        if due:
            self._wake()
        if len(due) < len(commands):
            if not self._is_held_back:
                _LOG.info("work waits until what an earlier run has reported is told")
            self._is_held_back = True
            self._wait_for_less_than(owing)
            return 0  # All of it once more: what was taken is known, the rest has changed
        return cursor

    def _owing(self) -> frozenset[int]:
        """Whose work must not be taken, for what is said of it is not all told."""
        with self._changed:
            return self._posts.owing

    def _wait_for_less_than(self, owing: frozenset[int]) -> None:
        """Wait until a vehicle owes nothing any more, or for a while."""
        with self._changed:
            self._answered.wait_for(
                lambda: self._stopping.is_set() or self._posts.owing < owing, RETRY_WORK_S
            )

    def _send_posts(self) -> None:
        door = Door(self._url, self._key_file, self._ca_file)
        while not self._stopping.is_set():
            with self._changed:
                post = self._posts.take(time.monotonic())
                if post is None:
                    self._changed.wait(timeout=self._pause())
                    continue
            try:
                self._send(door, post)
            except Exception as error:  # noqa: BLE001  # the boundary of one post
                _LOG.exception("%s %s: an internal error", post.method, post.path)
                self._put_off(post, reason_of(error))  # Else its lane would wait for ever

    def _put_off(self, post: Post, reason: str) -> None:
        """Retry a post later, unless it was answered before the error; give up the hopeless one.

        The lane waits out its back-off; the thread goes on with the others.
        """
        is_dead = False
        with self._changed:
            if self._posts.is_in_flight(post):
                is_dead = self._posts.failed(post, time.monotonic(), cut_off=False, reason=reason)
            self._changed.notify_all()
            self._answered.notify_all()
        self._nudge()
        if is_dead:
            self._given_up(post, None, reason)

    def _pause(self) -> float | None:
        due = self._posts.next_due()
        return None if due is None else max(0.0, due - time.monotonic())

    def _send(self, door: Door, post: Post) -> None:
        headers = {"Idempotency-Key": post.idempotency_key} if post.idempotency_key else {}
        status, text, is_dead = None, "", False
        try:
            response = door.request(post.method, post.path, body=post.body, headers=headers)
            status, text = response.status_code, response.text[:SHOWN_CHARACTERS]
            self._note(reachable=True)
        except (requests.RequestException, NoKeyError) as error:
            text = str(error)[:SHOWN_CHARACTERS]
            self._note(reachable=False, why=error)
        reason = text if status is None else f"HTTP {status} {text}"
        with self._changed:
            if status is None or not is_final(status):
                is_dead = self._posts.failed(
                    post,
                    time.monotonic(),
                    cut_off=status is None,
                    waits=status is not None and waits_on_purpose(status),
                    reason=reason,
                )
            elif _loses_nothing(post, status, text):
                self._posts.answered(post)
            else:
                is_dead = self._posts.refused(post, reason)
            self._changed.notify_all()
            self._answered.notify_all()
            concerns_disk = post.kept_as is not None or self._posts.is_in_trouble or is_dead
        if concerns_disk:
            self._nudge()
        if is_dead:
            self._given_up(post, status, text)
            return
        if status is None or not is_final(status):
            return
        if status >= HTTPStatus.BAD_REQUEST:
            self._tell_refusal(post, status, text)
        if post.accepts is not None:
            holds = status < HTTPStatus.BAD_REQUEST
            self._verdicts.put(Verdict(post.accepts, holds=holds, reason="" if holds else text))
            self._wake()

    def _given_up(self, post: Post, status: int | None, text: str) -> None:
        """Log a post that was given up; a mission whose acceptance it is must not be flown."""
        _LOG.error(
            "%s %s of vehicle %d%s is given up: HTTP %s %s",
            *(post.method, post.path, post.vehicle_id),
            *(" by an earlier run" if post.is_inherited else "", status, text),
        )
        if post.accepts is not None:
            reason = text if status is not None and is_final(status) else ""
            self._verdicts.put(Verdict(post.accepts, holds=False, reason=reason))
            self._wake()

    def _tell_refusal(self, post: Post, status: int, text: str) -> None:
        """Log what the edge server does not take: its words name field and reason."""
        if _was_sent_before(post, status, text):
            _LOG.info("%s was told before", post.path)
        elif post.is_inherited:
            _LOG.warning("%s of an earlier run is refused: HTTP %d %s", post.path, status, text)
        else:
            _LOG.error("%s %s: HTTP %d %s", post.method, post.path, status, text)

    def _nudge(self) -> None:
        """Let the spool see to it that what may wait for long survives us."""
        if self._keeper is not None:
            self._keeper.nudge()

    def _note(self, *, reachable: bool, why: Exception | None = None) -> None:
        self.failures += not reachable
        if reachable == self._reachable:
            return
        at_start, self._reachable = self._reachable is None, reachable
        if reachable:
            _LOG.info("the edge server answers")
        elif at_start:  # Programs start in any order: to wait is nothing to warn of.
            _LOG.info("waiting for the edge server: %s", why)
        else:
            _LOG.warning("the edge server does not answer: %s", why)


def _loses_nothing(post: Post, status: int, text: str) -> bool:
    """Whether nothing is lost by an answer: a success, or a refusal of what it knows or has ended.

    An acknowledgement of work that the edge server has withdrawn or closed is of no use to anybody.
    """
    if status < HTTPStatus.BAD_REQUEST or _was_sent_before(post, status, text):
        return True
    return is_acknowledgement(post) and status in _WITHDRAWN


def _was_sent_before(post: Post, status: int, text: str) -> bool:
    return post.may_be_known and status == HTTPStatus.UNPROCESSABLE_ENTITY and _KNOWN in text


def _drain(waiting: queue.SimpleQueue[T]) -> list[T]:
    """Take everything that waits; nobody else takes from it."""
    taken = []
    while not waiting.empty():
        taken.append(waiting.get_nowait())
    return taken
