"""Gunicorn's parts as this server needs them: one worker, and an end in order.

The end: `/readyz` turns to 503 and long polls are answered; requests are taken for a moment
longer, so that whoever asks for readiness sees it first; what is being served is finished; then
the process ends with 0. A second signal ends it where it stands: whatever was acknowledged is on
the disk.
"""

import json
import logging
import os
import signal
import socket
import ssl
import sys
import threading
from collections.abc import Callable
from typing import Any, Final

from gunicorn.arbiter import Arbiter  # type: ignore[import-untyped]  # it has no types
from gunicorn.glogging import Logger  # type: ignore[import-untyped]  # as above
from gunicorn.http import errors  # type: ignore[import-untyped]  # as above
from gunicorn.workers.gthread import ThreadWorker  # type: ignore[import-untyped]  # as above

from edge_server.exit_codes import FAILED, OK

LOG = logging.getLogger(__name__)
DRAIN_S: Final = 0.5
"""How long requests are still taken after the server has said that it is not ready."""
START_AGAIN: Final = signal.SIGUSR2
"""The worker's word to its parent: end, and let the supervisor start us anew."""
_ENDING: Final = frozenset({signal.SIGTERM, signal.SIGINT, signal.SIGQUIT})
_MULTIPLYING: Final = (signal.SIGHUP, signal.SIGTTIN, signal.SIGTTOU, signal.SIGWINCH)
_STATUS: Final[dict[type[Exception], tuple[int, str]]] = {
    errors.LimitRequestLine: (414, "URI Too Long"),
    errors.LimitRequestHeaders: (431, "Request Header Fields Too Large"),
    errors.ExpectationFailed: (417, "Expectation Failed"),
    errors.UnsupportedTransferCoding: (501, "Not Implemented"),
}
_SENTENCES: Final = {
    400: "the request cannot be understood",
    414: "the address is too long",
    417: "what the request expects cannot be met",
    431: "the headers are too large",
    500: "an error in the edge server; its log tells more",
    501: "this transfer coding is not known here",
}

stopping: Final = threading.Event()
"""Set in the worker when the server has been told to end."""
on_stop: Final[list[Callable[[], None]]] = []
"""What the worker does then, at once."""


class EdgeLogger(Logger):  # type: ignore[misc]  # gunicorn has no types
    """Passes gunicorn's words to our own log."""

    def setup(self, cfg: Any) -> None:
        """Let the lines rise to the root, which knows how we write."""
        super().setup(cfg)
        for log in (self.error_log, self.access_log):
            log.handlers.clear()
            log.propagate = True


class EdgeWorker(ThreadWorker):  # type: ignore[misc]  # gunicorn has no types
    """Serves; ends in the order that the module describes."""

    def handle_exit(self, sig: int, frame: object) -> None:
        """Begin the end, at the second signal complete it."""
        if stopping.is_set():
            os._exit(FAILED)
        stopping.set()
        for action in on_stop:
            action()
        close = threading.Timer(DRAIN_S, super().handle_exit, (sig, frame))
        close.daemon = True
        close.start()

    handle_quit = handle_exit

    def handle_error(
        self, req: Any, client: socket.socket, addr: tuple[str, int] | None, exc: Exception
    ) -> None:
        """Answer what is no HTTP in the shape of every error; a failure of TLS gets none."""
        if isinstance(exc, ssl.SSLError):
            LOG.info("no TLS with %s: %s", addr[0] if addr else "somebody", exc.reason)
            return
        status, reason = _STATUS.get(type(exc), (400, "Bad Request"))
        if not isinstance(exc, (errors.ParseException, errors.InvalidChunkSize)):
            status, reason = 500, "Internal Server Error"
            LOG.error("a request failed outside of its view", exc_info=exc)
        else:
            sender = addr[0] if addr else "somebody"
            LOG.warning("what %s sent is no HTTP (%s)", sender, type(exc).__name__)
        try:
            client.sendall(_answer(status, reason))
        except OSError as error:
            LOG.debug("%s is gone: %s", req, error)


def _answer(status: int, reason: str) -> bytes:
    request_id = os.urandom(8).hex()
    body = {"message": _SENTENCES[status], "detail": {}, "request_id": request_id}
    content = json.dumps(body).encode()
    from edge_server.api.headers import HEADERS  # noqa: PLC0415  # only the worker has loaded it

    hardening = "".join(f"{name}: {value}\r\n" for name, value in HEADERS.items())
    head = (
        f"HTTP/1.1 {status} {reason}\r\nConnection: close\r\nContent-Type: application/json\r\n"
        f"X-Request-ID: {request_id}\r\nContent-Length: {len(content)}\r\n{hardening}\r\n"
    )
    return head.encode() + content


class EdgeArbiter(Arbiter):  # type: ignore[misc]  # gunicorn has no types
    """Watches the one worker; a second signal to end is an order to end now."""

    def __init__(self, app: Any) -> None:
        super().__init__(app)
        self._ending = False
        self._exit_code = OK

    def signal(self, sig: int, frame: object) -> None:
        """Take a signal; the worker dies with us (prctl)."""
        if sig in _MULTIPLYING:
            return  # More workers, or fewer, is what this server cannot have
        if sig in _ENDING:
            if self._ending:
                os._exit(FAILED)
            self._ending = True
        super().signal(sig, frame)

    def handle_usr2(self) -> None:
        """End because the worker cannot go on with this database."""
        self._exit_code = FAILED
        raise StopIteration

    def halt(self, reason: str | None = None, exit_status: int = OK) -> None:
        """End with the code that says why."""
        super().halt(reason, exit_status or self._exit_code)


def start_again() -> None:
    """Ask the parent to end the server in order, so that it is prepared and started anew."""
    os.kill(os.getppid(), START_AGAIN)


def run(app: Any) -> None:
    """Serve until told to end; raises SystemExit with the exit code."""
    try:
        EdgeArbiter(app).run()
    except RuntimeError as error:
        LOG.critical("the server cannot be started: %s", error)
        sys.exit(FAILED)
