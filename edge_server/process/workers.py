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
import sys
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import Any, Final

from gunicorn import http  # type: ignore[import-untyped]  # it has no types
from gunicorn.arbiter import Arbiter  # type: ignore[import-untyped]  # it has no types
from gunicorn.glogging import Logger  # type: ignore[import-untyped]  # as above
from gunicorn.http import errors  # type: ignore[import-untyped]  # as above
from gunicorn.sock import ssl_context  # type: ignore[import-untyped]  # as above
from gunicorn.workers.gthread import ThreadWorker  # type: ignore[import-untyped]  # as above

from edge_server.front import loop
from edge_server.front.admission import Limits
from edge_server.front.counts import COUNTS
from edge_server.front.exchange import Exchange
from edge_server.process.exit_codes import FAILED, OK

LOG = logging.getLogger(__name__)
IDLE_LINGER_S: Final = 2.0
"""How long a server that ends keeps connections open that may bring one more request."""
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
    408: "the request was not complete in time, or gave way to others",
    413: "the body is too large, or is in too many small chunks",
    414: "the address is too long",
    417: "what the request expects cannot be met",
    431: "the headers are too large",
    500: "an error in the edge server; its log tells more",
    501: "this transfer coding is not known here",
    505: "this server knows HTTP/1.0 and HTTP/1.1",
    503: "too many requests wait for their answers; try again",
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
    """Serves whole requests that the front hands over; ends in the order that the module describes.

    Of gunicorn's worker with threads it has the life of a process and the calling of the
    application. It neither beats time for the parent nor is killed by it: a processor that is busy
    elsewhere is no reason to kill a worker with every request in it.
    """

    def init_process(self) -> None:
        """Begin to serve; returns when the worker has ended."""
        super(ThreadWorker, self).init_process()

    def run(self) -> None:
        """Serve until told to end, then see through what has begun."""
        limits: Limits = self.app.front_limits
        room = loop.raise_descriptor_limit(limits.connections)
        options = loop.Options(
            threads=self.cfg.threads,
            limits=limits._replace(connections=room),
            tls=ssl_context(self.cfg) if self.cfg.is_ssl else None,
            refusal=_refusal,
            is_known=self.app.is_known_key,
        )
        listeners = [listener.sock for listener in self.sockets]
        self._front = front = loop.Front(listeners, self._serve, options, COUNTS)
        front.start()
        while self.alive and self.is_parent_alive():
            front.turn(time.monotonic())
        front.stop_accepting()
        began = time.monotonic()
        while not front.is_quiet and (now := time.monotonic()) < began + self.cfg.graceful_timeout:
            if now >= began + IDLE_LINGER_S:
                front.close_idle()
            front.turn(now)
        front.close()

    def _serve(self, exchange: Exchange) -> bool:
        """Serve one request; returns whether its connection may be used again."""
        request = None
        try:
            if exchange.refusal is not None:
                LOG.warning("a request of %s cannot be framed", exchange.client[0])
                exchange.sendall(_refusal(exchange.refusal, exchange.why))
                return False
            request = next(http.get_parser(self.cfg, exchange, exchange.client))
            if not request:
                return False
            if not exchange.is_whole:
                request.force_close()
            return bool(self.handle_request(request, exchange))
        except (errors.NoMoreData, StopIteration):
            if not exchange.is_whole:  # The head has no end
                self.handle_error(request, exchange, exchange.client, errors.LimitRequestHeaders())
        except OSError as error:
            LOG.debug("%s got no answer: %s", exchange.client[0], error)
        except Exception as error:  # noqa: BLE001  # whatever it was, it is logged and answered
            self.handle_error(request, exchange, exchange.client, error)
        return False

    def handle_exit(self, _signal: int, _frame: object) -> None:
        """Begin the end, at the second signal complete it."""
        if stopping.is_set():
            os._exit(FAILED)
        stopping.set()
        for action in on_stop:
            action()
        close = threading.Timer(DRAIN_S, self._end)
        close.daemon = True
        close.start()

    def _end(self) -> None:
        self.alive = False
        self._front.wake()

    handle_quit = handle_exit

    def handle_error(
        self, req: Any, client: Exchange, addr: tuple[str, int] | None, exc: Exception
    ) -> None:
        """Answer what is no HTTP in the shape of every error."""
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


def _refusal(status: int, why: str | None = None) -> bytes:
    return _answer(status, HTTPStatus(status).phrase, why)


def _answer(status: int, reason: str, why: str | None = None) -> bytes:
    request_id = os.urandom(8).hex()
    body = {"message": why or _SENTENCES[status], "detail": {}, "request_id": request_id}
    content = json.dumps(body).encode()
    from edge_server.api.errors import RETRY_SOON  # noqa: PLC0415  # only the worker has loaded it
    from edge_server.api.headers import HEADERS  # noqa: PLC0415  # as above

    headers = HEADERS if status != HTTPStatus.SERVICE_UNAVAILABLE else HEADERS | RETRY_SOON
    hardening = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
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
