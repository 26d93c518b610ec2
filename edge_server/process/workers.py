"""Gunicorn's arbiter and worker, adapted: one worker, and a graceful shutdown.

Shutdown: `/readyz` answers 503 and long polls are answered; for `DRAIN_S` the server still accepts
requests, so that a load balancer sees the 503 first; requests in progress are completed; then the
process exits with 0. A second signal exits at once: whatever was acknowledged is on the disk.
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

from edge_server.connections import loop
from edge_server.connections.admission import Limits
from edge_server.connections.counts import COUNTS
from edge_server.connections.exchange import Exchange
from edge_server.process.exit_codes import FAILED, OK

LOG = logging.getLogger(__name__)
IDLE_LINGER_S: Final = 2.0
"""How long a server that shuts down keeps idle connections open for one more request."""
DRAIN_S: Final = 0.5
"""How long the server accepts requests after `/readyz` has turned to 503."""
RESTART: Final = signal.SIGUSR2
"""Signal of the worker to its parent: exit, so that the supervisor restarts the server."""
_ENDING: Final = frozenset({signal.SIGTERM, signal.SIGINT, signal.SIGQUIT})
_MULTIPLYING: Final = (signal.SIGHUP, signal.SIGTTIN, signal.SIGTTOU, signal.SIGWINCH)
_STATUS: Final[dict[type[Exception], tuple[int, str]]] = {
    errors.LimitRequestLine: (414, "URI Too Long"),
    errors.LimitRequestHeaders: (431, "Request Header Fields Too Large"),
    errors.ExpectationFailed: (417, "Expectation Failed"),
    errors.UnsupportedTransferCoding: (501, "Not Implemented"),
}
_SENTENCES: Final = {
    400: "the request cannot be understood, or has ended before it was complete",
    408: "the request was not complete in time, or was closed in favour of others",
    413: "the body is too large, or is in too many small chunks",
    414: "the address is too long",
    417: "what the request expects cannot be met",
    431: "the headers are too large",
    500: "internal error; the edge server's log has the details",
    501: "this transfer coding is not supported",
    505: "this server supports HTTP/1.0 and HTTP/1.1",
    503: "too many requests are waiting; try again",
}

stopping: Final = threading.Event()
"""Set in the worker when the shutdown begins."""
on_stop: Final[list[Callable[[], None]]] = []
"""Callbacks of the worker at that moment."""


class EdgeLogger(Logger):  # type: ignore[misc]  # gunicorn has no types
    """Passes gunicorn's log lines to the root logger."""

    def setup(self, cfg: Any) -> None:
        """Propagate to the root logger."""
        super().setup(cfg)
        for log in (self.error_log, self.access_log):
            log.handlers.clear()
            log.propagate = True


class EdgeWorker(ThreadWorker):  # type: ignore[misc]  # gunicorn has no types
    """Serves complete requests that the loop dispatches; shuts down as the module describes.

    It uses the process handling and the WSGI call of gunicorn's threaded worker. It sends no
    heartbeat to the parent and is not killed by it: on a busy processor that would lose requests.
    """

    _connections: loop.ConnectionLoop | None = None

    def init_process(self) -> None:
        """Serve; returns when the worker has shut down."""
        super(ThreadWorker, self).init_process()

    def run(self) -> None:
        """Serve until the shutdown, then complete the requests in progress."""
        limits: Limits = self.app.connection_limits
        room = loop.raise_descriptor_limit(limits.connections)
        options = loop.Options(
            threads=self.cfg.threads,
            limits=limits._replace(connections=room),
            tls=ssl_context(self.cfg) if self.cfg.is_ssl else None,
            refusal=_refusal,
            is_known=self.app.is_known_key,
        )
        listeners = [listener.sock for listener in self.sockets]
        self._connections = connections = loop.ConnectionLoop(
            listeners, self._serve, options, COUNTS
        )
        self.app.on_changes(connections.wake_streams)
        connections.start()
        while self.alive and self.is_parent_alive():
            connections.turn(time.monotonic())
        connections.stop_accepting()
        began = time.monotonic()
        while (
            not connections.is_quiet
            and (now := time.monotonic()) < began + self.cfg.graceful_timeout
        ):
            if now >= began + IDLE_LINGER_S:
                connections.close_idle()
            connections.turn(now)
        connections.close()

    def _serve(self, exchange: Exchange) -> bool:
        """Serve one request; returns whether its connection may be reused."""
        request = None
        try:
            if exchange.refusal is not None:
                LOG.warning("a request of %s cannot be framed", exchange.client[0])
                exchange.sendall(_refusal(exchange.refusal, exchange.reason))
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
        except Exception as error:  # noqa: BLE001  # logged and answered
            self.handle_error(request, exchange, exchange.client, error)
        return False

    def handle_exit(self, _signal: int, _frame: object) -> None:
        """Begin the shutdown; at the second signal exit at once."""
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
        if self._connections is not None:  # None while the application is loaded
            self._connections.wake()

    handle_quit = handle_exit

    def handle_error(
        self, req: Any, client: Exchange, addr: tuple[str, int] | None, exc: Exception
    ) -> None:
        """Answer invalid HTTP in the shape of every error.

        Nothing follows an answer that has begun: its client would take a second one for a part of
        the body. It sees by the closed connection that the body is not complete.
        """
        status, reason = _STATUS.get(type(exc), (400, "Bad Request"))
        if not isinstance(exc, (errors.ParseException, errors.InvalidChunkSize)):
            status, reason = 500, "Internal Server Error"
            LOG.error("a request failed outside its view", exc_info=exc)
        else:
            sender = addr[0] if addr else "an unknown client"
            LOG.warning("a request of %s is not valid HTTP (%s)", sender, type(exc).__name__)
        if client.has_begun:
            return
        try:
            client.sendall(_answer(status, reason))
        except OSError as error:
            LOG.debug("no answer to %s: %s", req, error)


def _refusal(status: int, message: str | None = None) -> bytes:
    return _answer(status, HTTPStatus(status).phrase, message)


def _answer(status: int, reason: str, message: str | None = None) -> bytes:
    request_id = os.urandom(8).hex()
    body = {"message": message or _SENTENCES[status], "detail": {}, "request_id": request_id}
    content = json.dumps(body).encode()
    from edge_server.api.errors import RETRY_SOON  # noqa: PLC0415  # loaded in the worker only
    from edge_server.api.headers import HEADERS  # noqa: PLC0415  # as above

    headers = HEADERS if status != HTTPStatus.SERVICE_UNAVAILABLE else HEADERS | RETRY_SOON
    hardening = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    head = (
        f"HTTP/1.1 {status} {reason}\r\nConnection: close\r\nContent-Type: application/json\r\n"
        f"X-Request-ID: {request_id}\r\nContent-Length: {len(content)}\r\n{hardening}\r\n"
    )
    return head.encode() + content


class EdgeArbiter(Arbiter):  # type: ignore[misc]  # gunicorn has no types
    """Supervises the one worker; a second termination signal exits at once."""

    def __init__(self, app: Any) -> None:
        super().__init__(app)
        self._ending = False
        self._exit_code = OK

    def signal(self, sig: int, frame: object) -> None:
        """Handle a signal; the worker exits with this process (prctl)."""
        if sig in _MULTIPLYING:
            return  # This server has exactly one worker
        if sig in _ENDING:
            if self._ending:
                os._exit(FAILED)
            self._ending = True
        super().signal(sig, frame)

    def handle_usr2(self) -> None:
        """Exit because the worker cannot continue with this database."""
        self._exit_code = FAILED
        raise StopIteration

    def halt(self, reason: str | None = None, exit_status: int = OK) -> None:
        """Exit with the code of the reason."""
        super().halt(reason, exit_status or self._exit_code)


def restart() -> None:
    """Ask the parent to shut the server down, so that the supervisor restarts it."""
    os.kill(os.getppid(), RESTART)


def run(app: Any) -> None:
    """Serve until a signal; raises SystemExit with the exit code."""
    try:
        EdgeArbiter(app).run()
    except RuntimeError as error:
        LOG.critical("the server cannot be started: %s", error)
        sys.exit(FAILED)
