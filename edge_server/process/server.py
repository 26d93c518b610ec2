"""Starts the web server: gunicorn's processes and parser, with our own loop for connections.

One worker, because SQLite has one writer and the broker's long polls are woken within one process.
The parent process supervises the worker and does not load the application.

FewDescriptorsError  the limit of open files leaves too few for connections
PortTakenError       another program listens on the port
TlsSetupError        other machines could connect without TLS, or certificate or key is invalid
UnpreparedError      the state folder cannot be used
"""

import logging
import os
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Final

from gunicorn.app.base import BaseApplication  # type: ignore[import-untyped]  # it has no types
from gunicorn.arbiter import Arbiter  # type: ignore[import-untyped]  # as above
from setproctitle import getproctitle

from edge_server.config import Config, ConfigError
from edge_server.connections import loop
from edge_server.connections.admission import KEEP_ALIVE_S, Limits
from edge_server.process import children, tls, workers
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.store.files.read_only import wait_until_writable

if TYPE_CHECKING:
    from flask import Flask

    from edge_server.api.access.auth import KeyRing
    from edge_server.api.routes.fleet.live import Live
    from edge_server.live.video import Cameras

LOG = logging.getLogger(__name__)
BIND_PATIENCE_S: Final = 3.0
KEPT_MIB: Final = 64
"""Memory for incomplete requests; and as much again for complete ones without an answer."""
BACKLOG: Final = 1024
FEWEST_CONNECTIONS: Final = 64
"""Some browsers and a broker; with fewer, each new connection would close another one."""
DATABASE_LOOK_S: Final = 0.5
GRACE_S: Final = 5
_WsgiApp = Callable[[dict[str, Any], Any], Iterable[bytes]]


class FewDescriptorsError(Exception):
    """The limit of open files leaves too few for connections."""


class PortTakenError(Exception):
    """Another program listens on the port."""


class TlsSetupError(Exception):
    """Other machines could connect without TLS, or certificate or key is invalid."""


def serve(config: Config) -> None:
    """Prepare the database and the keys, then serve until a signal ends it.

    Raises:
        FewDescriptorsError: if the limit of open files is too low.
        PortTakenError: if the port is in use.
        TlsSetupError: if others could connect without TLS, or certificate or key is invalid.
        UnpreparedError: if the state folder cannot be used; the reason has been logged.
    """
    try:
        tls.check_exposure(config)
        context = tls.context_for(config)
    except (tls.ExposedError, tls.CertificateError) as error:
        raise TlsSetupError(str(error)) from None
    _check_descriptors(config.connections)
    listener = listen(config.host, config.port, BIND_PATIENCE_S)
    _prepare_in_child(config)
    workers.run(_Application(config, listener, context))


def _check_descriptors(wanted: int) -> None:
    """Raise the limit of open files, which the worker inherits, and check what it leaves."""
    room = loop.raise_descriptor_limit(wanted)
    needed = min(wanted, FEWEST_CONNECTIONS)
    if room < needed:
        raise FewDescriptorsError(
            "the limit of open files (ulimit -n) is too low: it has to be at least "
            f"{loop.OTHER_DESCRIPTORS + needed}"
        )
    if room < wanted:
        LOG.warning("the limit of open files allows %d connections, not %d", room, wanted)


def _prepare_in_child(config: Config) -> None:
    """Prepare in a child process, so that the modules it loads do not stay in memory."""
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        children.exit_with_parent(parent)
        os._exit(_prepare(config))
    _, status = os.waitpid(child, 0)
    if (code := os.waitstatus_to_exitcode(status)) != OK:
        raise UnpreparedError(code)


def _prepare(config: Config) -> int:
    from edge_server.process.key_files import SecretFileError  # noqa: PLC0415  # stays in the child
    from edge_server.store.migrate import StoreError  # noqa: PLC0415  # as above

    try:
        _prepare_when_available(config)
    except (ConfigError, SecretFileError, StoreError) as error:
        LOG.error("%s", error)  # noqa: TRY400  # the sentence is enough
        return WRONG_SETUP
    except OSError:
        LOG.exception("the state folder %s cannot be prepared", config.state_dir)
        return FAILED
    return OK


def _prepare_when_available(config: Config) -> None:
    """Prepare; waits for a database server that does not answer yet, and for a disk to write to."""
    from edge_server.process.preparation import prepare  # noqa: PLC0415  # stays in the child
    from edge_server.store.migrate import (  # noqa: PLC0415  # as above
        NoSpaceError,
        UnreachableError,
    )

    logged, never = "", threading.Event()  # A signal ends the parent, which ends this process
    while True:
        wait_until_writable(config.edge_dir, never.wait)
        try:
            prepare(config)
        except (UnreachableError, NoSpaceError) as error:
            if logged != str(error):
                logged = str(error)
                LOG.warning("waiting for the database: %s", error)
            time.sleep(DATABASE_LOOK_S)
        else:
            return


def listen(host: str, port: int, patience_s: float) -> socket.socket:
    """Listen on the port; waits for one that a killed predecessor still holds.

    Raises:
        PortTakenError: if it is in use after `patience_s`.
    """
    deadline = time.monotonic() + patience_s
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    while True:
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
            listener.listen(BACKLOG)
        except OSError as error:
            listener.close()
            if time.monotonic() > deadline:
                raise PortTakenError(
                    f"cannot listen on {host}:{port} ({error.strerror}); is another edge server "
                    f"running? Choose another port with EDGE_PORT or --port."
                ) from None
            time.sleep(0.05)
        else:
            return listener


class UnpreparedError(Exception):
    """The state folder cannot be used."""

    def __init__(self, exit_code: int) -> None:
        super().__init__(f"preparing the state folder ended with code {exit_code}")
        self.exit_code = exit_code


class _Application(BaseApplication):  # type: ignore[misc]  # gunicorn has no types
    """Gunicorn's application, configured by `Config`."""

    def __init__(
        self, config: Config, listener: socket.socket, context: ssl.SSLContext | None
    ) -> None:
        self._config = config
        self._listener = listener
        self._context = context
        self._app: Flask | None = None
        self._ring: KeyRing | None = None
        self._live: Live | None = None
        self._cameras: Cameras | None = None
        super().__init__()

    @property
    def connection_limits(self) -> Limits:
        """Limits of connections and of the memory for their requests."""
        config = self._config
        return Limits(config.connections, config.connections_per_address, KEPT_MIB * 1024 * 1024)

    def is_known_key(self, key: str) -> bool:
        """Whether an access key was active when the keys were last read; never blocks."""
        return self._ring is None or self._ring.is_known(key)

    def on_changes(self, wake: Callable[[], None]) -> None:
        """Call `wake` whenever the live stream or a live picture has something new."""
        if self._live is not None:
            self._live.watcher.wake = wake
        if self._cameras is not None:
            self._cameras.wake = wake

    def load_config(self) -> None:
        if self._context is not None:
            # Gunicorn uses TLS if these files are set
            self.cfg.set("certfile", str(self._config.tls_certificate_file))
            self.cfg.set("keyfile", str(self._config.tls_key_file))
            self.cfg.set("ssl_context", lambda _config, _default: self._context)
        for name, value in {
            "bind": f"fd://{self._listener.fileno()}",
            "workers": 1,
            "threads": self._config.threads,
            "worker_class": workers.EdgeWorker,
            "logger_class": workers.EdgeLogger,
            "worker_tmp_dir": "/dev/shm" if os.path.isdir("/dev/shm") else None,  # noqa: PTH112, S108  # gunicorn's heartbeat file, made safely
            "keepalive": int(KEEP_ALIVE_S),
            "timeout": 0,  # A slow machine must not kill a worker with its requests
            "sendfile": False,  # Exchange.sendall enforces the time budget
            "graceful_timeout": GRACE_S,
            "control_socket_disable": True,
            "loglevel": "warning",
            "proc_name": getproctitle(),  # Gunicorn shows it behind its own name
            "post_fork": _post_fork,
            "worker_exit": lambda _server, _worker: self._close(),
        }.items():
            self.cfg.set(name, value)

    def _close(self) -> None:
        """Close the database in the worker: its file is whole without its log then."""
        if self._app is not None:
            from edge_server.app import close  # noqa: PLC0415  # in the worker only

            close(self._app)

    def load(self) -> _WsgiApp:
        from edge_server.api.access.auth import KEY_RING  # noqa: PLC0415  # in the worker only
        from edge_server.api.routes.fleet import live, videos  # noqa: PLC0415  # as above
        from edge_server.app import context_of, create_app  # noqa: PLC0415  # as above
        from edge_server.process import housekeeping  # noqa: PLC0415  # as above

        self._app = app = create_app(self._config)
        context = context_of(app)
        self._ring = app.extensions[KEY_RING]
        self._live = app.extensions[live.EXTENSION]
        self._cameras = app.extensions[videos.EXTENSION]
        workers.on_stop.append(context.work_signal.close)
        context.database.listen(context.receive_notice)
        tasks: list[Callable[[], None]] = [
            lambda: housekeeping.run(context, workers.stopping),
            lambda: housekeeping.watch_file(context, workers.stopping, workers.restart),
        ]
        for task in tasks:
            threading.Thread(target=task, daemon=True).start()
        scheme = "http" if self._context is None else "https"
        LOG.info("serving on %s://%s:%d", scheme, self._config.host, self._config.port)
        return app


def _post_fork(server: Arbiter, _worker: object) -> None:
    children.exit_with_parent(server.pid)
