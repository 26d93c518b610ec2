"""Client of the edge server over HTTP, on threads of its own, so that no vehicle waits for it.

One thread gets work by long poll, two send posts. Every post is retried until it has a final
answer: a success, or a refusal that a retry would get again. With a spool, posts that have failed
once are stored on disk and sent by the next run, and posts that are refused become dead letters.

The threads only wait and exchange: `next_poll` and `take_answer`, `take_post` and `settle` are the
steps between, which take no time. A simulation calls them without threads.

A vehicle's work is held back while reports of an earlier run about it wait: what the edge server
states of a mission is true only when it has received every report about it.
"""

import logging
import queue
import random
import re
import threading
import time
from collections.abc import Callable
from enum import Enum, auto
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import requests

from afarcloud import wire
from mavlink_broker.edge.answers import (
    MAX_LOGGED_CHARACTERS,
    EdgeClock,
    PostOutcome,
    examined,
    explain,
)
from mavlink_broker.edge.bounded_http import Answer, EdgeConnection, cause_of
from mavlink_broker.edge.outbox import Outbox, Post
from mavlink_broker.edge.spool import Spool
from mavlink_broker.edge.spool_writer import SpoolWriter
from mavlink_broker.edge.wire import VEHICLE_LANE, AcceptanceResult
from mavlink_broker.supervision import SupervisedThread, reason_of

T = TypeVar("T")

LONG_POLL_S: Final = 20.0
SENDERS: Final = 2
RETRY_WORK_S: Final = 0.5
SHORTEST_UPDATE_S: Final = 0.2
"""A vehicle sends its position five times a second."""
_INTERVAL: Final = re.compile(r"[0-9]{1,3}(\.[0-9]{1,6})?", re.ASCII)
_LOG = logging.getLogger(__name__)


class Poll(NamedTuple):
    """One request for work."""

    path: str
    wait_s: float
    """How long the edge server may wait for work."""
    held_back: frozenset[int]
    """Vehicles whose work is not taken from the answer."""
    sent_at: float
    """When it was made, by the monotonic clock [s]: an answer was not written before."""


class Pause(Enum):
    """What the next request for work waits for."""

    NONE = auto()
    RETRY = auto()  # `RETRY_WORK_S`
    REPORTS = auto()  # Until the reports of a vehicle are sent, or `RETRY_WORK_S`


class EdgeClient:
    """The edge server as the program's loop uses it: work to take, posts to send."""

    def __init__(
        self,
        url: str,
        key_file: Path,
        wake: Callable[[], None],
        *,
        ca_file: Path | None = None,
        spool: Spool | None = None,
        clock: Callable[[], float] = time.monotonic,
        jitter: random.Random | None = None,
        instance_id: str = "",
    ) -> None:
        """Use the edge server's URL, the file of the access key and that of the only CA.

        `wake` ends the loop's sleep. Without a spool posts that wait are lost with the program.
        `clock` gives monotonic seconds; `jitter` draws the pauses between attempts, which a
        simulation repeats. The edge server distinguishes brokers with one access key by
        `instance_id`.
        """
        self._connect = partial(EdgeConnection, url, key_file, ca_file, instance_id)
        self._wake = wake
        self._clock = clock
        self._cursor = 0  # Of the work that was received
        self._edge_clock = EdgeClock()
        self._work: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._acceptance_results: queue.SimpleQueue[AcceptanceResult] = queue.SimpleQueue()
        self._outbox = Outbox(jitter or random.Random())
        self._update_intervals_s: dict[int, float] = {}  # By vehicle
        lock = threading.Lock()
        self._changed = threading.Condition(lock)  # For the threads that send
        self._answered = threading.Condition(lock)  # For threads that wait for answers
        self._stopping = threading.Event()
        self._reachable: bool | None = None
        self.failures = 0  # Requests without an answer
        self._held_back: frozenset[int] = frozenset()  # Vehicles whose work waits, as logged
        self._spool_writer = (
            None if spool is None else SpoolWriter(spool, self._outbox, self._changed)
        )
        self._threads = [
            SupervisedThread("edge-work", self._poll_work, self._stopping),
            *(
                SupervisedThread(f"edge-send-{i}", self._send_posts, self._stopping)
                for i in range(SENDERS)
            ),
        ]

    def start(self) -> None:
        """Start the threads."""
        if self._spool_writer is not None:
            self._spool_writer.start()
        for thread in self._threads:
            thread.start()

    def stop(self, within_s: float) -> None:
        """Send for a while, store the other posts, end; daemon threads do not delay the exit."""
        with self._changed:
            self._answered.wait_for(lambda: not len(self._outbox), within_s)
        self._stopping.set()
        with self._changed:
            self._changed.notify_all()
        if self._spool_writer is not None:
            self._spool_writer.stop()

    def take_work(self) -> list[dict[str, Any]]:
        """Give the work that has arrived, as the edge server wrote it."""
        return _drain(self._work)

    def take_acceptance_results(self) -> list[AcceptanceResult]:
        """Give the edge server's answers to missions that were accepted."""
        return _drain(self._acceptance_results)

    def post(self, post: Post) -> None:
        """Queue a post to be sent."""
        with self._changed:
            self._outbox.put(post)
            self._changed.notify()
            has_failures = self._outbox.has_failures
        if has_failures:
            self._notify_spool()

    @property
    def waiting(self) -> int:
        """How many posts have no final answer yet."""
        with self._changed:
            return len(self._outbox)

    @property
    def waiting_pictures(self) -> int:
        """How many pictures have no final answer yet."""
        with self._changed:
            return self._outbox.waiting_in(wire.Kind.IMAGE.value)

    def dead_letters_of(self, vehicle_id: int) -> int:
        """How many dead letters a vehicle has."""
        with self._changed:
            unstored = self._outbox.dead_letters_of(vehicle_id)
        stored = {} if self._spool_writer is None else self._spool_writer.dead_letters
        return unstored + stored.get(vehicle_id, 0)

    def update_interval_of(self, vehicle_id: int) -> float | None:
        """Interval [s] that the answer to the last update of a vehicle has requested, or None."""
        return self._update_intervals_s.get(vehicle_id)

    def _poll_work(self) -> None:
        self._cursor = 0
        with self._connect() as connection:
            while not self._stopping.is_set():
                poll = self.next_poll()
                answer: Answer | Exception
                try:
                    answer = connection.request("GET", poll.path, poll.wait_s)
                except requests.RequestException as error:
                    answer = error
                match self.take_answer(poll, answer):
                    case Pause.RETRY:
                        self._stopping.wait(RETRY_WORK_S)
                    case Pause.REPORTS:
                        self._wait_for_reports_of(poll.held_back)

    def next_poll(self) -> Poll:
        """Give the next request for work.

        The first one after a failure asks for an answer at once, to learn whether the edge server
        is reachable.
        """
        wait_s = LONG_POLL_S if self._reachable else 0.0
        path = f"/broker/commands?after={self._cursor}&wait={wait_s:.0f}"
        with self._changed:
            held_back = self._outbox.vehicles_with_unsent_reports
        return Poll(path, wait_s, held_back, self._clock())

    def take_answer(self, poll: Poll, answer: Answer | Exception) -> Pause:
        """Pass on the work in an answer, or note the error; gives what the next poll waits for."""
        found = None
        try:
            if isinstance(answer, Exception):
                raise answer
            if answer.status_code == HTTPStatus.OK:
                found = answer.json()
            self._set_reachable(None)
            if found is None:
                reason = explain(answer)[:MAX_LOGGED_CHARACTERS]
                _LOG.warning(
                    "the edge server refuses work: HTTP %d: %s", answer.status_code, reason
                )
        except requests.RequestException as error:
            self._set_reachable(error)
        if found is None:
            self._cursor = 0  # Another edge server may answer next; known work is recognised
            return Pause.RETRY
        return self._receive_work(found, poll)

    def _receive_work(self, answer: Any, poll: Poll) -> Pause:
        """Pass on the work of vehicles that are not held back, and note the cursor."""
        held_back, field = poll.held_back, "commands"
        try:
            commands = [dict(command) for command in answer["commands"]]
            field = "cursor"
            cursor = int(answer["cursor"])
        except (KeyError, TypeError, ValueError, OverflowError):
            _LOG.exception("the edge server's work cannot be read: its %s cannot be used", field)
            self._cursor = 0
            return Pause.RETRY
        edge_time = self._edge_clock.read(answer.get("time"), poll.sent_at, self._clock())
        waiting_for = tuple(held_back)  # An invalid vehicle_id may not be hashable
        due = [command for command in commands if command.get("vehicle_id") not in waiting_for]
        if due and not self._edge_clock.is_settled:
            self._cursor = 0  # Get it again at once, with a time that shows whether it has expired
            return Pause.NONE
        for command in due:
            self._work.put(command if edge_time is None else {**command, "edge_time": edge_time})
        if due:
            self._wake()
        if len(due) < len(commands):
            self._log_held_back(held_back)
            self._cursor = 0  # Get all of it again: known work is recognised, the rest has changed
            return Pause.REPORTS
        self._cursor = cursor
        self._held_back = frozenset()
        return Pause.NONE

    def _log_held_back(self, vehicles: frozenset[int]) -> None:
        """Log for which vehicles work waits, whenever these are others than before."""
        if vehicles != self._held_back:
            with self._changed:
                counts = {one: self._outbox.unsent_reports_of(one) for one in sorted(vehicles)}
            for vehicle_id, count in counts.items():
                if not count:
                    continue  # Sent since the question, so that the next one gets its work
                reports = "reports or answers to events of an earlier run are sent"
                _LOG.warning("work of vehicle %d waits until %d %s", vehicle_id, count, reports)
        self._held_back = vehicles

    def _wait_for_reports_of(self, vehicles: frozenset[int]) -> None:
        """Wait until all reports of one of the vehicles are sent, or for a while."""
        with self._changed:
            self._answered.wait_for(
                lambda: (
                    self._stopping.is_set() or self._outbox.vehicles_with_unsent_reports < vehicles
                ),
                RETRY_WORK_S,
            )

    def _send_posts(self) -> None:
        with self._connect() as connection:
            while not self._stopping.is_set():
                with self._changed:
                    post = self._outbox.take(self._clock())
                    if post is None:
                        self._changed.wait(timeout=self._pause())
                        continue
                try:
                    self._send(connection, post)
                except Exception as error:  # noqa: BLE001  # the boundary of one post
                    _LOG.exception("%s %s: an internal error", post.method, post.path)
                    self._postpone(post, reason_of(error))  # Else its lane would wait for ever

    def _postpone(self, post: Post, reason: str) -> None:
        """Count a failure, unless the post was answered before the error.

        The lane waits for its back-off; the thread goes on with the other lanes.
        """
        is_dead = False
        with self._changed:
            if self._outbox.is_in_flight(post):
                is_dead = self._outbox.failed(
                    post, self._clock(), is_unreachable=False, reason=reason
                )
            self._changed.notify_all()
            self._answered.notify_all()
        self._notify_spool()
        if is_dead:
            self._give_up(PostOutcome(post, None, reason))

    def _pause(self) -> float | None:
        due = self._outbox.next_due()
        return None if due is None else max(0.0, due - self._clock())

    def _send(self, connection: EdgeConnection, post: Post) -> None:
        answer: Answer | Exception
        try:
            answer = connection.request(
                post.method, post.path, body=post.body, headers=headers_of(post)
            )
        except requests.RequestException as error:
            answer = error
        self.settle(post, answer)

    def take_post(self) -> Post | None:
        """Give a post that is to be sent now; it is in flight until `settle`."""
        with self._changed:
            return self._outbox.take(self._clock())

    def settle(self, post: Post, answer: Answer | Exception) -> None:
        """Handle the answer to a post, or why there was none.

        A success of anybody else than the edge server, such as a captive portal, is no answer; a
        refusal, such as a proxy's, is not final.
        """
        answer, is_own = examined(answer)
        outcome = PostOutcome.of(post, answer, is_own=is_own)
        status = outcome.status
        self._set_reachable(answer if isinstance(answer, Exception) else None)
        if post.lane == VEHICLE_LANE:
            self._note_update_interval(post.vehicle_id, answer)
        is_dead = False
        with self._changed:
            if not outcome.is_settled:
                is_dead = self._outbox.failed(
                    post,
                    self._clock(),
                    is_unreachable=status is None,
                    is_temporary=outcome.is_temporary,
                    lacks_space=status == HTTPStatus.INSUFFICIENT_STORAGE,
                    reason=outcome.reason,
                )
            elif outcome.loses_nothing:
                self._outbox.answered(post)
            else:
                is_dead = self._outbox.refused(post, outcome.reason)
            self._changed.notify_all()
            self._answered.notify_all()
            concerns_spool = post.spool_number is not None or self._outbox.has_failures or is_dead
        if concerns_spool:
            self._notify_spool()
        if is_dead:
            self._give_up(outcome)
        elif outcome.is_settled:
            outcome.log_refusal()
            self._pass_on(outcome.acceptance_result)

    def _note_update_interval(self, vehicle_id: int, answer: Answer | Exception) -> None:
        text = None if isinstance(answer, Exception) else answer.update_interval
        if text is not None and _INTERVAL.fullmatch(text):
            self._update_intervals_s[vehicle_id] = max(SHORTEST_UPDATE_S, float(text))
        else:
            self._update_intervals_s.pop(vehicle_id, None)

    def _give_up(self, outcome: PostOutcome) -> None:
        """Log a post that is not sent again; if it is an acceptance, its mission fails."""
        outcome.log_given_up()
        self._pass_on(outcome.acceptance_result)

    def _pass_on(self, result: AcceptanceResult | None) -> None:
        if result is not None:
            self._acceptance_results.put(result)
            self._wake()

    def update_spool(self) -> None:
        """Bring the spool up to date, as its thread does once a second and when notified."""
        if self._spool_writer is not None:
            self._spool_writer.run_once(self._clock())

    def _notify_spool(self) -> None:
        """Have posts that may wait for long stored."""
        if self._spool_writer is not None:
            self._spool_writer.notify()

    def _set_reachable(self, error: Exception | None) -> None:
        """Note why a request has no answer; None: it has one."""
        self.failures += error is not None
        before, self._reachable = self._reachable, error is None
        if before == self._reachable:
            return
        if error is None:
            _LOG.info("the edge server answers")
        elif before is None:  # Programs start in any order: waiting at the start is normal
            _LOG.info("waiting for the edge server: %s", cause_of(error))
        else:
            _LOG.warning("the edge server does not answer: %s", cause_of(error))


def headers_of(post: Post) -> dict[str, str]:
    """Give the headers of a post's request."""
    return {"Idempotency-Key": post.idempotency_key} if post.idempotency_key else {}


def _drain(waiting: queue.SimpleQueue[T]) -> list[T]:
    """Remove and return all items that wait; only one thread may do so."""
    taken = []
    while not waiting.empty():
        taken.append(waiting.get_nowait())
    return taken
