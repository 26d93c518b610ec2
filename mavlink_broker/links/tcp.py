"""MAVLink over TCP: a client that connects for ever again, and a listener for several.

A connection whose other side has vanished without a word ends when what was sent to it has been
unanswered for 10 s (TCP_USER_TIMEOUT): heartbeats make sure that something was.
"""

import errno
import logging
import os
import socket
from collections.abc import Callable
from typing import Final

from mavlink_broker.links.link import Arrival, Retry
from mavlink_broker.links.name_lookup import HostName
from mavlink_broker.links.one_peer import OnePeerLink
from mavlink_broker.links.stream import Stream, StreamEndedError
from mavlink_broker.links.udp import bind
from mavlink_broker.links.url import Address, LinkUrl

CONNECTED_WITHIN_S: Final = 5.0
UNANSWERED_MS: Final = 10_000
QUEUE_BYTES: Final = 65_536
CLIENTS: Final = 16
"""More are turned away."""
_UNDER_WAY: Final = frozenset({0, errno.EINPROGRESS, errno.EWOULDBLOCK, errno.EINTR})

_LOG = logging.getLogger(__name__)


class TcpClient(OnePeerLink):
    """Implements `mavlink_broker.links.link.Link` with a connection of our own."""

    def __init__(self, url: LinkUrl, number: int, on_found: Callable[[], None]) -> None:
        super().__init__(url, number, Retry(url))
        self._host = HostName(url.host, on_found)
        self._socket: socket.socket | None = None
        self._give_up_at = 0.0

    def writers(self) -> list[int]:
        """A connection that is being made, or to which something waits to be sent."""
        if self._stream is not None:
            return [self._stream.descriptor] if self._stream.is_behind else []
        return [self._socket.fileno()] if self._socket else []

    def due_at(self) -> float | None:
        """When it is tried again, or given up."""
        if self._stream is not None:
            return None
        return self._give_up_at if self._socket else self._retry.at

    def radio(self, free_percent: int) -> None:
        """Networks keep a pace of their own."""

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Connect when it is time, else read and write."""
        if self._socket is None:
            if now >= self._retry.at:
                self._connect(now)
            return []
        if self._stream is None:
            self._watch_connecting(self._socket, ready, now)
            return []
        return self._exchange(self._stream, ready, now)

    def _release(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _connect(self, now: float) -> None:
        host = self._host.numeric(now)
        if host is None:
            self._retry.failed(now, f"nobody knows the address of {self.url.host}")
            return
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        _make_quick(self._socket)
        self._give_up_at = now + CONNECTED_WITHIN_S
        result = self._socket.connect_ex((host, self.url.port))
        if result not in _UNDER_WAY:
            self._lose(os.strerror(result), now)

    def _watch_connecting(
        self, connection: socket.socket, ready: frozenset[int], now: float
    ) -> None:
        if connection.fileno() in ready:
            result = connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if result:
                self._lose(os.strerror(result), now)
                return
            self._stream = Stream(connection.fileno(), QUEUE_BYTES)
            self._retry.opened()
        elif now >= self._give_up_at:
            self._lose("no answer", now)


class TcpListener:
    """Implements `mavlink_broker.links.link.Link` for those who connect to us."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Listen.

        Raises:
            LinkError: if it cannot listen there; PortBusyError if another program does.
        """
        self.url = url
        self._number = number
        family = socket.AF_INET6 if ":" in url.host else socket.AF_INET
        self._listener = socket.socket(family, socket.SOCK_STREAM)
        self._listener.settimeout(0.0)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bind(self._listener, (url.host, url.port), url)
        self._listener.listen(CLIENTS)
        self._clients: dict[Address, tuple[socket.socket, Stream]] = {}
        self._dropped = 0

    @property
    def port(self) -> int:
        """Port that it listens on."""
        port: int = self._listener.getsockname()[1]
        return port

    @property
    def dropped(self) -> int:
        """Frames that a client did not take in time."""
        return self._dropped + sum(stream.dropped for _, stream in self._clients.values())

    def readers(self) -> list[int]:
        """The listener and its clients."""
        clients = [stream.descriptor for _, stream in self._clients.values()]
        return [self._listener.fileno(), *clients]

    def writers(self) -> list[int]:
        """Clients for whom something waits."""
        return [s.descriptor for _, s in self._clients.values() if s.is_behind]

    def due_at(self) -> float | None:
        """Nothing is done unasked."""
        return None

    def radio(self, free_percent: int) -> None:
        """Networks keep a pace of their own."""

    def greeted(self) -> list[Address]:
        """Everybody who has connected."""
        return list(self._clients)

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Take new clients, read from and write to those that are there."""
        if self._listener.fileno() in ready:
            self._accept()
        arrivals: list[Arrival] = []
        for address, (_, stream) in list(self._clients.items()):
            try:
                stream.flush()
                frames = stream.read(now, is_readable=stream.descriptor in ready)
            except StreamEndedError as error:
                self._lose(address, str(error))
                continue
            arrivals += [(address, frame) for frame in frames]
        return arrivals

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame to one client, now or when there is room."""
        if address not in self._clients:
            return
        try:
            self._clients[address][1].send(frame)
        except StreamEndedError as error:
            self._lose(address, str(error))

    def close(self) -> None:
        """End everything."""
        for address in list(self._clients):
            self._lose(address, "the broker stops")
        self._listener.close()

    def _accept(self) -> None:
        try:
            client, place = self._listener.accept()
        except OSError:
            return  # He has thought better of it
        if len(self._clients) >= CLIENTS:
            _LOG.warning("%s: %s is turned away, %d are there", self.url, place[0], CLIENTS)
            client.close()
            return
        _make_quick(client)
        address = Address(place[0], place[1], self._number)
        self._clients[address] = client, Stream(client.fileno(), QUEUE_BYTES)
        _LOG.info("%s: %s has connected", self.url, address)

    def _lose(self, address: Address, reason: str) -> None:
        client, stream = self._clients.pop(address)
        self._dropped += stream.dropped
        client.close()
        _LOG.info("%s: %s is gone: %s", self.url, address, reason)


def _make_quick(connection: socket.socket) -> None:
    """Wait for nothing, hold nothing back, notice a vanished other side."""
    connection.settimeout(0.0)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNANSWERED_MS)
