"""One thread that reads all requests, and the threads that serve those which are whole.

A connection costs a descriptor and what it has sent, never a thread, until its request is whole;
so however many clients say nothing, or say it slowly, requests are served. Events and the broker's
requests have threads of their own.
"""

import contextlib
import errno
import logging
import os
import queue
import resource
import selectors
import socket
import ssl
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NamedTuple

from edge_server.front import admission
from edge_server.front.admission import Eviction, Limits, NoRoomError, Reason
from edge_server.front.client_address import network_of
from edge_server.front.connection import Connection, Phase
from edge_server.front.counts import FrontCounts
from edge_server.front.exchange import Exchange
from edge_server.front.framing import Lane, lane_of

LOG = logging.getLogger(__name__)
URGENT_THREADS: Final = 4
BROKER_THREADS: Final = 10  # As many as may wait for work, and two
DESCRIPTORS_WANTED: Final = 8192
_DESCRIPTORS_OF_OURS: Final = 256  # Database, logs, long polls of a shared database
_AT_ONCE: Final = 64  # Connections that are accepted before those that are there go on
_HANDSHAKES_AT_ONCE: Final = 4  # A signature by RSA of 4096 bits takes 5 ms and more
_SWEEP_S: Final = 0.25
_REPORT_S: Final = 5.0
_PAUSE_S: Final = 0.5
_NO_DESCRIPTOR: Final = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
Serve = Callable[[Exchange], bool]
"""Serves a request; returns whether the connection may be used again. Never raises."""


class Options(NamedTuple):
    """What the front is set up with."""

    threads: int
    limits: Limits
    tls: ssl.SSLContext | None
    refusal: Callable[[int], bytes]
    """Gives the answer for a status."""
    is_known: Callable[[str], bool]
    """Whether an access key is one of ours, as far as is known without waiting."""


class _Served(NamedTuple):
    """A request that has been served, or was given up."""

    connection: Connection
    lane: Lane
    kept_bytes: int
    keep: bool
    """Whether the connection may be used again."""


class Front:
    """Accepts, reads, hands over, closes. All methods but `wake` belong to one thread."""

    def __init__(
        self,
        listeners: Sequence[socket.socket],
        serve: Serve,
        options: Options,
        counts: FrontCounts,
    ) -> None:
        self._listeners = listeners
        self._serve = serve
        self._options = options
        self._counts = counts
        self._selector = selectors.DefaultSelector()
        self._pools: Mapping[Lane, ThreadPoolExecutor] = {
            Lane.GENERAL: ThreadPoolExecutor(options.threads, "serve"),
            Lane.BROKER: ThreadPoolExecutor(BROKER_THREADS, "serve-broker"),
            Lane.URGENT: ThreadPoolExecutor(URGENT_THREADS, "serve-urgent"),
        }
        self._done: queue.SimpleQueue[_Served] = queue.SimpleQueue()
        self._handed_over_bytes: Counter[Lane] = Counter()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._connections: set[Connection] = set()
        self._by_network: Counter[str] = Counter()
        self._unreported: Counter[tuple[Reason, str]] = Counter()
        self._report_at = 0.0
        self._sweep_at = 0.0
        self._accepts_from = 0.0
        self._accepting = False

    def wake(self) -> None:
        """End a wait of `turn`; may be called by any thread, and by a signal handler."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._wake_write, b"\n")

    def start(self) -> None:
        """Begin to accept."""
        self._selector.register(self._wake_read, selectors.EVENT_READ)
        for listener in self._listeners:
            listener.settimeout(0.0)
        self._accept(on=True)

    def turn(self, now: float) -> None:
        """Let everything move once; waits for at most a part of a second."""
        if not self._accepting and self._accepts_from and now >= self._accepts_from:
            self._accept(on=True)
        handshakes: list[Connection] = []
        for key, _ in self._selector.select(_SWEEP_S):
            if key.fileobj == self._wake_read:
                with contextlib.suppress(BlockingIOError):
                    os.read(self._wake_read, 4096)
            elif key.data is None:
                self._welcome(key.fileobj, time.monotonic())
            elif key.data.phase is Phase.HANDSHAKE:
                handshakes.append(key.data)
            else:
                self._move(key.data, time.monotonic())
        self._shake_hands(handshakes)
        self._collect(time.monotonic())
        if now >= self._sweep_at:
            self._sweep_at = now + _SWEEP_S
            self._sweep(time.monotonic())

    def stop_accepting(self) -> None:
        """Take no more connections, for good, and close those on which nothing is under way."""
        self._accept(on=False)
        self._accepts_from = 0.0

    def close_idle(self) -> None:
        """Close what nothing is expected of."""
        for connection in [one for one in self._connections if one.is_idle]:
            self._close(connection)

    @property
    def is_quiet(self) -> bool:
        """Whether no connection is left."""
        return not self._connections

    def close(self) -> None:
        """Close everything; what is being served is served in vain."""
        for connection in list(self._connections):
            self._close(connection)
        for pool in self._pools.values():
            pool.shutdown(wait=False, cancel_futures=True)
        for listener in self._listeners:
            listener.close()
        self._selector.close()

    def _accept(self, *, on: bool) -> None:
        if on != self._accepting:
            for listener in self._listeners:
                if on:
                    self._selector.register(listener, selectors.EVENT_READ)
                else:
                    self._selector.unregister(listener)
            self._accepting = on

    def _welcome(self, listener: Any, now: float) -> None:
        for _ in range(_AT_ONCE):
            try:
                sock, client = listener.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                LOG.warning("no connection can be accepted: %s", error)
                if error.errno in _NO_DESCRIPTOR:
                    self._make_room()
                self._accept(on=False)
                self._accepts_from = now + _PAUSE_S
                return
            self._admit(sock, client, now)

    def _make_room(self) -> None:
        """Close the connection that has waited longest: there is no descriptor for another one."""
        none_left = self._options.limits._replace(connections=0)
        with contextlib.suppress(NoRoomError):
            self._evict(admission.eviction(none_left, self._by_network, self._waiting(), ""))

    def _evict(self, found: Eviction[Connection] | None) -> None:
        if found is not None:
            self._refuse_late(found.connection, found.reason)

    def _admit(self, sock: socket.socket, client: Any, now: float) -> None:
        network, limits = network_of(client[0]), self._options.limits
        try:
            self._evict(admission.eviction(limits, self._by_network, self._waiting(), network))
        except NoRoomError as error:
            self._note_refused(error.reason, network)
            sock.close()
            return
        try:
            sock.settimeout(0.0)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._options.tls is not None:
                sock = self._options.tls.wrap_socket(
                    sock, server_side=True, do_handshake_on_connect=False
                )
            connection = Connection(sock, client[:2], network, now)
        except OSError as error:
            LOG.debug("a connection has ended before it began: %s", error)
            sock.close()
            return
        self._connections.add(connection)
        self._by_network[network] += 1
        self._counts.open = len(self._connections)
        self._selector.register(sock, connection.interest, connection)
        if connection.phase is Phase.READING:
            self._move(connection, now)  # A request that came with the connection waits for nothing

    def _shake_hands(self, ready: Sequence[Connection]) -> None:
        """Go on with some handshakes; those of the others are looked at in the next turn."""
        if len(ready) > _HANDSHAKES_AT_ONCE:
            ready = admission.next_handshakes(ready, _HANDSHAKES_AT_ONCE)
        for connection in ready:
            self._move(connection, time.monotonic())

    def _waiting(self) -> Iterable[Connection]:
        return (one for one in self._connections if one.phase is not Phase.SERVING)

    def _move(self, connection: Connection, now: float) -> None:
        """Let one connection move; one that has been closed in this turn stays closed."""
        if connection.phase in {Phase.CLOSED, Phase.SERVING}:
            return
        before = connection.interest
        try:
            is_whole = connection.on_ready(now)
        except ssl.SSLError as error:
            LOG.info("no TLS with %s: %s", connection.client[0], error.reason)
            self._close(connection)
        except (OSError, EOFError):
            self._close(connection)
        else:
            if is_whole:
                self._selector.unregister(connection.sock)
                self._hand_over(connection, now)
            elif connection.interest != before:
                self._selector.modify(connection.sock, connection.interest, connection)

    def _hand_over(self, connection: Connection, now: float) -> None:
        """Give a whole request to the threads of its lane; the selector has not its connection."""
        taken = connection.framing.take()
        lane = lane_of(taken.raw, self._options.is_known)
        kept_bytes = len(taken.raw) + connection.kept_bytes  # With what has come behind it
        limits = self._options.limits
        if not admission.may_hand_over(limits, self._handed_over_bytes, lane, kept_bytes):
            self._turn_away(connection, now)
            return
        connection.phase = Phase.SERVING
        self._handed_over_bytes[lane] += kept_bytes
        server = connection.sock.getsockname()[:2]
        exchange = Exchange(connection.sock, connection.client, server, taken)

        def serve() -> None:
            keep = False
            try:
                keep = self._serve(exchange) and taken.is_whole
            finally:
                self._done.put(_Served(connection, lane, kept_bytes, keep))
                self.wake()

        self._pools[lane].submit(serve)

    def _turn_away(self, connection: Connection, now: float) -> None:
        """Answer 503 to a whole request for which there is no room among those that wait."""
        self._note_refused(Reason.BUSY, connection.network)
        try:
            connection.sock.send(self._options.refusal(503))
            connection.linger(now)
            self._selector.register(connection.sock, connection.interest, connection)
        except OSError:
            self._close(connection)

    def _collect(self, now: float) -> None:
        """Take back the connections that have been served."""
        while not self._done.empty():
            connection, lane, kept_bytes, keep = self._done.get()
            self._handed_over_bytes[lane] -= kept_bytes
            if connection.phase is Phase.CLOSED:
                continue
            try:
                if not keep:
                    connection.linger(now)
                elif connection.answered(now):
                    self._hand_over(connection, now)
                    continue
                self._selector.register(connection.sock, connection.interest, connection)
            except OSError:
                self._close(connection)
                continue
            self._move(connection, now)  # What came meanwhile, and what TLS holds decrypted

    def _sweep(self, now: float) -> None:
        """Close what is late, or keeps too much."""
        for connection in [one for one in self._waiting() if now >= one.deadline]:
            if connection.phase is Phase.LINGERING or connection.has_been_served:
                self._close(connection)
            else:
                self._refuse_late(connection, connection.reason_if_late)
        for found in admission.too_much_kept(self._options.limits, self._waiting()):
            self._evict(found)
        if self._unreported and now >= self._report_at:
            self._report_at = now + _REPORT_S
            for (reason, network), number in self._unreported.items():
                LOG.warning(
                    "closed %d connections of %s before a request was served: %s",
                    *(number, network, reason.replace("_", " ")),
                )
            self._unreported.clear()

    def _note_refused(self, reason: Reason, network: str) -> None:
        self._counts.note_closed(reason)
        self._unreported[reason, network] += 1

    def _refuse_late(self, connection: Connection, reason: Reason) -> None:
        """Close a connection before its request is whole, with the reason if it has begun one."""
        if connection.phase is not Phase.LINGERING:
            self._note_refused(reason, connection.network)
        if connection.has_begun:
            with contextlib.suppress(OSError):
                connection.sock.send(self._options.refusal(408))
        self._close(connection)

    def _close(self, connection: Connection) -> None:
        if connection not in self._connections:
            return
        with contextlib.suppress(KeyError, ValueError):
            self._selector.unregister(connection.sock)
        self._connections.remove(connection)
        self._by_network[connection.network] -= 1
        if not self._by_network[connection.network]:
            del self._by_network[connection.network]
        self._counts.open = len(self._connections)
        connection.close()


def raise_descriptor_limit(wanted: int) -> int:
    """Let this process hold as many descriptors as it may; returns how many connections fit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = DESCRIPTORS_WANTED if hard == resource.RLIM_INFINITY else min(hard, DESCRIPTORS_WANTED)
    if soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        soft = most
    return max(min(wanted, soft - _DESCRIPTORS_OF_OURS), 1)
