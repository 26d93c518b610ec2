"""MAVLink over TCP: a client that reconnects without end, and a listener for several clients.

A connection whose other side has vanished without closing it ends when sent data has not been
acknowledged for 10 s (TCP_USER_TIMEOUT); heartbeats make sure that data is sent.
"""

import errno
import logging
import os
import socket
from collections.abc import Callable
from typing import Final

from mavlink_broker.links.link import Arrival, HostName, RetryTimer
from mavlink_broker.links.stream import SinglePeerLink, Stream, StreamEndedError
from mavlink_broker.links.udp import bind
from mavlink_broker.links.url import Address, LinkUrl

CONNECT_TIMEOUT_S: Final = 5.0
USER_TIMEOUT_MS: Final = 10_000
QUEUE_BYTES: Final = 65_536
MAX_CLIENTS: Final = 16
"""More connections are closed at once."""
_UNDER_WAY: Final = frozenset({0, errno.EINPROGRESS, errno.EWOULDBLOCK, errno.EINTR})

_LOG = logging.getLogger(__name__)


class TcpClient(SinglePeerLink):
    """Implements `mavlink_broker.links.link.Link` with an outgoing connection."""

    def __init__(self, url: LinkUrl, number: int, on_found: Callable[[], None]) -> None:
        super().__init__(url, number, RetryTimer(url))
        self._host = HostName(url.host, on_found)
        self._socket: socket.socket | None = None
        self._connect_deadline = 0.0

    def writers(self) -> list[int]:
        """A connection that is being opened, or for which data is queued."""
        if self._stream is not None:
            return [self._stream.descriptor] if self._stream.has_backlog else []
        return [self._socket.fileno()] if self._socket else []

    def due_at(self) -> float | None:
        """When it connects again, or when connecting times out."""
        if self._stream is not None:
            return None
        return self._connect_deadline if self._socket else self._retry.at

    def radio_status(self, free_percent: int) -> None:
        """Ignored: TCP has flow control."""

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Connect when it is due, else read and write."""
        if self._socket is None:
            if now >= self._retry.at:
                self._connect(now)
            return []
        if self._stream is None:
            self._check_connecting(self._socket, ready, now)
            return []
        return self._transfer(self._stream, ready, now)

    def _release(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _connect(self, now: float) -> None:
        host = self._host.numeric(now)
        if host is None:
            self._retry.failed(now, f"the address of {self.url.host} is not known")
            return
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        _configure_socket(self._socket)
        self._connect_deadline = now + CONNECT_TIMEOUT_S
        result = self._socket.connect_ex((host, self.url.port))
        if result not in _UNDER_WAY:
            self._disconnect(os.strerror(result), now)

    def _check_connecting(
        self, connection: socket.socket, ready: frozenset[int], now: float
    ) -> None:
        if connection.fileno() in ready:
            result = connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if result:
                self._disconnect(os.strerror(result), now)
                return
            self._stream = Stream(connection.fileno(), QUEUE_BYTES)
            self._retry.opened()
        elif now >= self._connect_deadline:
            self._disconnect("no answer", now)


class TcpListener:
    """Implements `mavlink_broker.links.link.Link` for incoming connections."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Listen.

        Raises:
            LinkError: if it cannot listen there; PortBusyError if another program uses the port.
        """
        self.url = url
        self._number = number
        family = socket.AF_INET6 if ":" in url.host else socket.AF_INET
        self._listener = socket.socket(family, socket.SOCK_STREAM)
        self._listener.settimeout(0.0)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bind(self._listener, (url.host, url.port), url)
        self._listener.listen(MAX_CLIENTS)
        self._clients: dict[Address, tuple[socket.socket, Stream]] = {}
        self._dropped = 0

    @property
    def port(self) -> int:
        """Port that it listens on."""
        port: int = self._listener.getsockname()[1]
        return port

    @property
    def dropped(self) -> int:
        """Number of frames that clients did not take in time."""
        return self._dropped + sum(stream.dropped for _, stream in self._clients.values())

    def readers(self) -> list[int]:
        """The listener and its clients."""
        clients = [stream.descriptor for _, stream in self._clients.values()]
        return [self._listener.fileno(), *clients]

    def writers(self) -> list[int]:
        """Clients for which data is queued."""
        return [s.descriptor for _, s in self._clients.values() if s.has_backlog]

    def due_at(self) -> float | None:
        """None: it has no timer."""
        return None

    def radio_status(self, free_percent: int) -> None:
        """Ignored: TCP has flow control."""

    def contact_addresses(self) -> list[Address]:
        """All connected clients."""
        return list(self._clients)

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Accept new clients, read from and write to the connected ones."""
        if self._listener.fileno() in ready:
            self._accept()
        arrivals: list[Arrival] = []
        for address, (_, stream) in list(self._clients.items()):
            try:
                stream.flush()
                frames = stream.read(now, is_readable=stream.descriptor in ready)
            except StreamEndedError as error:
                self._disconnect(address, str(error))
                continue
            arrivals += [(address, frame) for frame in frames]
        return arrivals

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame to one client, now or when it takes more."""
        if address not in self._clients:
            return
        try:
            self._clients[address][1].send(frame)
        except StreamEndedError as error:
            self._disconnect(address, str(error))

    def close(self) -> None:
        """Close all connections and the listener."""
        for address in list(self._clients):
            self._disconnect(address, "the broker stops")
        self._listener.close()

    def _accept(self) -> None:
        try:
            client, place = self._listener.accept()
        except OSError:
            return  # The client has closed it again
        if len(self._clients) >= MAX_CLIENTS:
            _LOG.warning(
                "%s: refused %s, %d clients are connected", self.url, place[0], MAX_CLIENTS
            )
            client.close()
            return
        _configure_socket(client)
        address = Address(place[0], place[1], self._number)
        self._clients[address] = client, Stream(client.fileno(), QUEUE_BYTES)
        _LOG.info("%s: %s connected", self.url, address)

    def _disconnect(self, address: Address, reason: str) -> None:
        client, stream = self._clients.pop(address)
        self._dropped += stream.dropped
        client.close()
        _LOG.info("%s: %s disconnected: %s", self.url, address, reason)


def _configure_socket(connection: socket.socket) -> None:
    """Never block, send at once, notice an other side that has vanished."""
    connection.settimeout(0.0)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, USER_TIMEOUT_MS)
