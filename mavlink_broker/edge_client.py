"""Speaks to the edge server over HTTP, on threads of its own, so that the vehicles never wait.

One thread asks for work by long poll, two tell what the vehicles have to say. Every request is
tried until it has a final answer: a success, or a refusal that would be the same tomorrow. The
access key is read from its file when it is needed, because the edge server may not have written
it yet, or may have written a new one.
"""

import logging
import queue
import random
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import requests

from afarcloud import wire
from mavlink_broker.send_queue import Post, SendQueue

LONG_POLL_S: Final = 20.0
TIMEOUT_S: Final = 10.0
SENDERS: Final = 2
RETRY_WORK_S: Final = 0.5
SHOWN_CHARACTERS: Final = 500
"""Of a refusal's text, in the log."""

_TRY_AGAIN: Final = frozenset(
    {
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.REQUEST_TIMEOUT,
        HTTPStatus.TOO_EARLY,
        HTTPStatus.TOO_MANY_REQUESTS,
    }
)
_KNOWN: Final = "Idempotency-Key was used"
"""What the edge server says to another body under a key that it has seen."""
_LOG = logging.getLogger(__name__)


class NoKeyError(Exception):
    """The edge server has not written the broker's key yet."""


class _Door:
    """One thread's connection to the edge server."""

    def __init__(self, url: str, key_file: Path, ca_file: Path | None) -> None:
        self._url = url.rstrip("/")
        self._key_file = key_file
        self._http = requests.Session()
        self._http.trust_env = False
        if ca_file is not None:
            self._http.verify = str(ca_file)
        self._key: str | None = None

    def request(self, method: str, path: str, timeout_s: float, **how: Any) -> requests.Response:
        """Ask once.

        Raises:
            requests.RequestException: if there is no answer.
            NoKeyError: if there is no key to ask with.
        """
        headers = {"Authorization": f"Bearer {self._read_key()}", **how.pop("headers", {})}
        response = self._http.request(
            method,
            self._url + path,
            headers=headers,
            timeout=(TIMEOUT_S, timeout_s),
            allow_redirects=False,
            **how,
        )
        if response.status_code == HTTPStatus.UNAUTHORIZED:
            self._key = None
        return response

    def _read_key(self) -> str:
        if self._key is None:
            try:
                self._key = self._key_file.read_text(encoding="ascii").strip()
            except OSError as error:
                raise NoKeyError(f"no key in {self._key_file}: {error.strerror}") from error
            except UnicodeDecodeError as error:
                raise NoKeyError(f"no key in {self._key_file}: {error}") from error
        return self._key


def is_final(status_code: int) -> bool:
    """Whether an answer would be the same if the request were repeated."""
    if status_code in _TRY_AGAIN:
        return False
    return 200 <= status_code < 300 or 400 <= status_code < 500


class EdgeClient:
    """The edge server as the program's loop sees it: work to take, posts to leave."""

    def __init__(
        self, url: str, key_file: Path, wake: Callable[[], None], *, ca_file: Path | None = None
    ) -> None:
        """Take where the edge server is, our key, and who alone vouches for its certificate."""
        self._url = url
        self._key_file = key_file
        self._ca_file = ca_file
        self._wake = wake
        self._work: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._posts = SendQueue(random.Random())
        self._changed = threading.Condition()
        self._stopping = threading.Event()
        self._reachable: bool | None = None
        self._threads = [
            threading.Thread(target=self._poll_work, name="edge-work", daemon=True),
            *(
                threading.Thread(target=self._send_posts, name=f"edge-send-{i}", daemon=True)
                for i in range(SENDERS)
            ),
        ]

    def start(self) -> None:
        """Begin to speak."""
        for thread in self._threads:
            thread.start()

    def stop(self, within_s: float) -> None:
        """Send what can be sent soon, then stop; daemon threads do not hold the program up."""
        deadline = time.monotonic() + within_s
        with self._changed:
            while len(self._posts) and time.monotonic() < deadline:
                self._changed.wait(timeout=0.05)
        self._stopping.set()
        with self._changed:
            self._changed.notify_all()

    def take_work(self) -> list[dict[str, Any]]:
        """Give the work that has come in, as the edge server wrote it."""
        work = []
        while not self._work.empty():
            work.append(self._work.get_nowait())
        return work

    def post(self, post: Post) -> None:
        """Leave a post to be sent."""
        with self._changed:
            self._posts.put(post)
            self._changed.notify()

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

    @property
    def dropped(self) -> int:
        """How many state vectors were given up."""
        with self._changed:
            return self._posts.dropped

    def _poll_work(self) -> None:
        door, cursor = _Door(self._url, self._key_file, self._ca_file), 0
        while not self._stopping.is_set():
            try:
                # The first question after a silence is answered at once, to see who is there.
                wait_s = LONG_POLL_S if self._reachable else 0.0
                path = f"/broker/commands?after={cursor}&wait={wait_s:.0f}"
                response = door.request("GET", path, wait_s + TIMEOUT_S)
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
            cursor = self._accept(answer, cursor)

    def _accept(self, answer: Any, cursor: int) -> int:
        """Pass the work on; gives the next cursor."""
        try:
            commands = list(answer["commands"])
            cursor = int(answer["cursor"])
        except (KeyError, TypeError, ValueError):
            _LOG.exception("the edge server's work cannot be read")
            self._stopping.wait(RETRY_WORK_S)
            return 0
        for command in commands:
            self._work.put(command)
        if commands:
            self._wake()
        return cursor

    def _send_posts(self) -> None:
        door = _Door(self._url, self._key_file, self._ca_file)
        while not self._stopping.is_set():
            with self._changed:
                post = self._posts.take(time.monotonic())
                if post is None:
                    self._changed.wait(timeout=self._pause())
                    continue
            self._send(door, post)

    def _pause(self) -> float | None:
        due = self._posts.next_due()
        return None if due is None else max(0.0, due - time.monotonic())

    def _send(self, door: _Door, post: Post) -> None:
        headers = {"Idempotency-Key": post.idempotency_key} if post.idempotency_key else {}
        status, text = None, ""
        try:
            response = door.request(
                post.method, post.path, TIMEOUT_S, json=post.body, headers=headers
            )
            status, text = response.status_code, response.text[:SHOWN_CHARACTERS]
            self._note(reachable=True)
        except (requests.RequestException, NoKeyError) as error:
            self._note(reachable=False, why=error)
        with self._changed:
            if status is not None and is_final(status):
                self._posts.answered(post)
                if (
                    post.may_be_known
                    and status == HTTPStatus.UNPROCESSABLE_ENTITY
                    and _KNOWN in text
                ):
                    _LOG.info("%s was told before", post.path)
                elif status >= 400:
                    _LOG.error("%s %s: HTTP %d %s", post.method, post.path, status, text)
            else:
                self._posts.failed(post, time.monotonic(), cut_off=status is None)
            self._changed.notify_all()

    def _note(self, *, reachable: bool, why: Exception | None = None) -> None:
        if reachable == self._reachable:
            return
        at_start, self._reachable = self._reachable is None, reachable
        if reachable:
            _LOG.info("the edge server answers")
        elif at_start:  # Programs start in any order: to wait is nothing to warn of.
            _LOG.info("waiting for the edge server: %s", why)
        else:
            _LOG.warning("the edge server does not answer: %s", why)
