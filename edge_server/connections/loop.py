"""One thread reads all requests; other threads serve those that are complete.

A connection occupies a descriptor and memory for what it has sent, but no thread before its request
is complete; so silent or slow clients, however many, delay no requests. Events and the broker's
requests have threads of their own. A stream, which has no end, occupies no thread either: the loop
sends it.
"""

import contextlib
import errno
import logging
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

from edge_server.connections import admission
from edge_server.connections.admission import Eviction, Limits, NoRoomError, Reason
from edge_server.connections.client_address import network_of
from edge_server.connections.connection import Connection, Phase
from edge_server.connections.counts import ConnectionCounts
from edge_server.connections.exchange import Exchange, Stream
from edge_server.connections.framing import Lane, lane_of
from edge_server.connections.stall import StallMonitor

LOG = logging.getLogger(__name__)
URGENT_THREADS: Final = 4
BROKER_THREADS: Final = 10  # The long polls that may wait for work, and two more
DESCRIPTORS_WANTED: Final = 8192
OTHER_DESCRIPTORS: Final = 256  # Database, logs, long polls of a shared database
_AT_ONCE: Final = 64  # Connections accepted before the loop serves others
_HANDSHAKES_AT_ONCE: Final = 4  # A signature by RSA of 4096 bits takes 5 ms and more
_SWEEP_S: Final = 0.25
_REPORT_S: Final = 5.0
_PAUSE_S: Final = 0.5
_NO_DESCRIPTOR: Final = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
Serve = Callable[[Exchange], bool]
"""Serves a request; returns whether the connection may be used again. Never raises."""


class Options(NamedTuple):
    """Options of the loop."""

    threads: int
    limits: Limits
    tls: ssl.SSLContext | None
    refusal: Callable[[int], bytes]
    """Makes the answer for a status."""
    is_known: Callable[[str], bool]
    """Whether an access key is known; never blocks."""


class _Served(NamedTuple):
    """A request that has been served, or has failed."""

    connection: Connection
    lane: Lane
    kept_bytes: int
    keep: bool
    """Whether the connection may be used again."""
    stream: Stream | None
    """What it sends from now on, if the answer has no end."""


class ConnectionLoop:
    """Accepts and reads connections and dispatches requests.

    One thread calls all but `wake` and `wake_streams`.
    """

    def __init__(
        self,
        listeners: Sequence[socket.socket],
        serve: Serve,
        options: Options,
        counts: ConnectionCounts,
        stalls: StallMonitor | None = None,
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
        self._dispatched_bytes: Counter[Lane] = Counter()
        # Sockets and no pipe: one that is closed has no number that another file may get
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.settimeout(0.0)
        self._wake_write.settimeout(0.0)
        self._connections: set[Connection] = set()
        self._streams: set[Connection] = set()
        self._streams_are_due = False
        self._by_network: Counter[str] = Counter()
        self._unreported: Counter[tuple[Reason, str]] = Counter()
        self._report_at = 0.0
        self._sweep_at = 0.0
        self._stalls = stalls or StallMonitor()
        self._accepts_from = 0.0
        self._accepting = False

    def wake(self) -> None:
        """Wake `turn`; safe in any thread and in a signal handler, also after `close`."""
        with contextlib.suppress(OSError):  # It is awake already, or closed
            self._wake_write.send(b"\n")

    def wake_streams(self) -> None:
        """Let `turn` send what is new to every stream; safe in any thread."""
        self._streams_are_due = True
        self.wake()

    def start(self) -> None:
        """Start to accept connections."""
        self._selector.register(self._wake_read, selectors.EVENT_READ)
        for listener in self._listeners:
            listener.settimeout(0.0)
        self._accept(on=True)

    def turn(self, now: float) -> None:
        """Run the loop once; waits for `_SWEEP_S` at most."""
        if not self._accepting and self._accepts_from and now >= self._accepts_from:
            self._accept(on=True)
        handshakes: list[Connection] = []
        self._stalls.note()
        ready = self._selector.select(_SWEEP_S)
        self._stalls.note(waited_s=_SWEEP_S)
        for key, _ in ready:
            if key.fileobj is self._wake_read:
                with contextlib.suppress(BlockingIOError):
                    self._wake_read.recv(4096)
            elif key.data is None:
                self._accept_ready(key.fileobj)
            elif key.data.phase is Phase.HANDSHAKE:
                handshakes.append(key.data)
            else:
                self._advance_connection(key.data, time.monotonic())
        self._shake_hands(handshakes)
        self._collect(time.monotonic())
        is_sweep = now >= self._sweep_at
        # Not in each turn: every request would wait until all streams had been asked
        if self._streams_are_due or is_sweep:
            self._streams_are_due = False  # Before they look: what is new after that wakes again
            for connection in list(self._streams):
                self._advance_connection(connection, time.monotonic())
        if is_sweep:
            self._sweep_at = now + _SWEEP_S
            self._sweep(time.monotonic())

    def stop_accepting(self) -> None:
        """Stop accepting connections for good."""
        self._accept(on=False)
        self._accepts_from = 0.0

    def close_idle(self) -> None:
        """Close connections without a request, and streams."""
        for connection in [one for one in self._connections if one.is_idle or one in self._streams]:
            self._close(connection)

    @property
    def is_quiet(self) -> bool:
        """Whether no connection is left."""
        return not self._connections

    def close(self) -> None:
        """Close everything; answers of requests that are being served are lost."""
        for connection in list(self._connections):
            self._close(connection)
        for pool in self._pools.values():
            pool.shutdown(wait=False, cancel_futures=True)
        for listener in self._listeners:
            listener.close()
        self._selector.close()
        self._wake_read.close()
        self._wake_write.close()

    def _accept(self, *, on: bool) -> None:
        if on != self._accepting:
            for listener in self._listeners:
                if on:
                    self._selector.register(listener, selectors.EVENT_READ)
                else:
                    self._selector.unregister(listener)
            self._accepting = on

    def _accept_ready(self, listener: Any) -> None:
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
                self._accepts_from = time.monotonic() + _PAUSE_S
                return
            # A time of its own each: the oldest of them is closed first where there is no room
            self._admit(sock, client, time.monotonic())

    def _make_room(self) -> None:
        """Close the connection that has waited longest: no descriptor is left."""
        none_left = self._options.limits._replace(connections=0)
        with contextlib.suppress(NoRoomError):
            self._evict(admission.eviction(none_left, self._by_network, self._not_served(), ""))

    def _make_room_for(self, network: str, now: float) -> None:
        """Close the connection that has waited longest if there are too many.

        Raises:
            NoRoomError: if all are being served.
        """
        limits = self._options.limits
        try:
            found = admission.eviction(limits, self._by_network, self._not_served(), network)
        except NoRoomError:
            self._collect(now)  # Threads have answered some since this turn began
            found = admission.eviction(limits, self._by_network, self._not_served(), network)
        self._evict(found)

    def _evict(self, found: Eviction[Connection] | None) -> None:
        if found is not None:
            self._refuse_late(found.connection, found.reason)

    def _admit(self, sock: socket.socket, client: Any, now: float) -> None:
        network = network_of(client[0])
        try:
            self._make_room_for(network, now)
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
            LOG.debug("a connection failed while it was set up: %s", error)
            sock.close()
            return
        self._connections.add(connection)
        self._by_network[network] += 1
        self._counts.open = len(self._connections)
        self._selector.register(sock, connection.interest, connection)
        if connection.phase is Phase.READING:
            self._advance_connection(
                connection, now
            )  # The request may have arrived with the connection

    def _shake_hands(self, ready: Sequence[Connection]) -> None:
        """Advance some handshakes; the others follow in the next turn."""
        if len(ready) > _HANDSHAKES_AT_ONCE:
            ready = admission.next_handshakes(ready, _HANDSHAKES_AT_ONCE)
        for connection in ready:
            self._advance_connection(connection, time.monotonic())

    def _not_served(self) -> Iterable[Connection]:
        return (one for one in self._connections if one.phase is not Phase.SERVING)

    def _advance_connection(self, connection: Connection, now: float) -> None:
        """Read from a connection, unless it was closed in this turn."""
        if connection.phase in {Phase.CLOSED, Phase.SERVING}:
            return
        before = connection.interest
        try:
            is_whole = connection.on_ready(now)
        except ssl.SSLError as error:
            LOG.info("the TLS handshake with %s failed: %s", connection.client[0], error.reason)
            self._close(connection)
        except EOFError:
            if connection.has_begun:  # The client may still read (RFC 9112 section 8)
                self._send_last(connection, 400)
            self._close(connection)
        except OSError:
            self._close(connection)
        else:
            if is_whole:
                self._selector.unregister(connection.sock)
                self._dispatch(connection, now)
            elif connection.interest != before:
                self._selector.modify(connection.sock, connection.interest, connection)

    def _dispatch(self, connection: Connection, now: float) -> None:
        """Pass a complete request to the threads of its lane; its connection is unregistered."""
        request = connection.framing.take()
        lane = lane_of(request.raw, self._options.is_known)
        kept_bytes = len(request.raw) + connection.kept_bytes  # Including pipelined data
        limits = self._options.limits
        if not admission.may_dispatch(limits, self._dispatched_bytes, lane, kept_bytes):
            self._refuse_busy(connection, now)
            return
        connection.phase = Phase.SERVING
        self._dispatched_bytes[lane] += kept_bytes
        server = connection.sock.getsockname()[:2]
        arrived_s = self._stalls.arrived_s()
        exchange = Exchange(connection.sock, connection.client, server, request, arrived_s)

        def serve() -> None:
            keep = False
            try:
                keep = self._serve(exchange) and request.is_whole
            finally:
                self._done.put(_Served(connection, lane, kept_bytes, keep, exchange.stream))
                self.wake()

        self._pools[lane].submit(serve)

    def _refuse_busy(self, connection: Connection, now: float) -> None:
        """Answer 503 to a complete request if too many are waiting."""
        self._note_refused(Reason.BUSY, connection.network)
        try:
            connection.sock.send(self._options.refusal(503))
            connection.linger(now)
            self._selector.register(connection.sock, connection.interest, connection)
        except OSError:
            self._close(connection)

    def _collect(self, now: float) -> None:
        """Resume the connections whose requests have been served."""
        while not self._done.empty():
            connection, lane, kept_bytes, keep, stream = self._done.get()
            self._dispatched_bytes[lane] -= kept_bytes
            if connection.phase is Phase.CLOSED:
                continue
            try:
                if stream is not None:
                    connection.begin_stream(stream, now)
                    self._streams.add(connection)
                elif not keep:
                    connection.linger(now)
                elif connection.answered(now):
                    self._dispatch(connection, now)
                    continue
                self._selector.register(connection.sock, connection.interest, connection)
            except OSError:
                self._close(connection)
                continue
            self._advance_connection(
                connection, now
            )  # Data may have arrived, or TLS may have decrypted some

    def _sweep(self, now: float) -> None:
        """Close connections beyond their deadline or the memory limit."""
        for connection in [one for one in self._not_served() if now >= one.deadline]:
            quiet = connection.phase in {Phase.LINGERING, Phase.STREAMING}
            if quiet or connection.has_been_served:
                self._close(connection)
            else:
                self._refuse_late(connection, connection.timeout_reason)
        for found in admission.over_memory_limit(self._options.limits, self._not_served()):
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
        """Close a connection before its request is complete; answer 408 if one has begun."""
        if connection.phase not in {Phase.LINGERING, Phase.STREAMING}:
            self._note_refused(reason, connection.network)
        if connection.has_begun:
            self._send_last(connection, 408)
        self._close(connection)

    def _send_last(self, connection: Connection, status: int) -> None:
        """Send a refusal to a connection that is closed next, if its client still reads."""
        with contextlib.suppress(OSError):
            connection.sock.send(self._options.refusal(status))

    def _close(self, connection: Connection) -> None:
        if connection not in self._connections:
            return
        with contextlib.suppress(KeyError, ValueError):
            self._selector.unregister(connection.sock)
        self._connections.remove(connection)
        self._streams.discard(connection)
        self._by_network[connection.network] -= 1
        if not self._by_network[connection.network]:
            del self._by_network[connection.network]
        self._counts.open = len(self._connections)
        connection.close()


def raise_descriptor_limit(wanted: int) -> int:
    """Raise the limit of open descriptors; returns how many connections fit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = DESCRIPTORS_WANTED if hard == resource.RLIM_INFINITY else min(hard, DESCRIPTORS_WANTED)
    if soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        soft = most
    return max(min(wanted, soft - OTHER_DESCRIPTORS), 1)
