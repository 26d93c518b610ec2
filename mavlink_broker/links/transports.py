"""The kinds of links: MAVLink over UDP, TCP and serial lines.

UDP: one socket that listens, or one that sends first. TCP: a client that reconnects without end,
and a listener for several clients. A TCP connection whose other side has vanished without closing
it ends when sent data has not been acknowledged for 10 s (TCP_USER_TIMEOUT); heartbeats make sure
that data is sent. A name server may take long, so host names are resolved on a thread.

A serial line is a telemetry radio, a cable, or a pseudo-terminal: 8 data bits, no parity, one stop
bit, no flow control, by the standard library's termios. A missing or unplugged device is opened
again every second.
"""

import errno
import fcntl
import logging
import os
import socket
import termios
import threading
from collections.abc import Callable
from ipaddress import ip_address
from typing import Any, Final

from mavlink_broker.links.link import (
    Arrival,
    Link,
    LinkError,
    PortBusyError,
    RateLimiter,
    RetryTimer,
    SinglePeerLink,
    Stream,
    StreamEndedError,
)
from mavlink_broker.links.url import ANY_ADDRESS, Address, LinkKind, LinkUrl

LOOKUP_INTERVAL_S: Final = 30.0
"""Interval at which a known name is resolved again: a vehicle may return with another address."""
UNKNOWN_LOOKUP_INTERVAL_S: Final = 2.0
"""Interval while the name is unknown."""
RECEIVE_BUFFER_BYTES: Final = 1 << 20
MAX_DATAGRAM_BYTES: Final = 4096
"""Longer ones are truncated: no sender packs more frames than a network packet holds."""
MAX_DATAGRAMS_PER_READ: Final = 256
"""Limit of one step, so that a flood cannot block the loop."""
CONNECT_TIMEOUT_S: Final = 5.0
USER_TIMEOUT_MS: Final = 10_000
TCP_QUEUE_BYTES: Final = 65_536
MAX_CLIENTS: Final = 16
"""More connections are closed at once."""
DEVICE_RETRY_S: Final = 1.0
"""Longest pause before a serial device is opened again."""
_CHARACTERS: Final = 6
"""Index in the result of tcgetattr, after the four modes, input speed and output speed."""
_UNDER_WAY: Final = frozenset({0, errno.EINPROGRESS, errno.EWOULDBLOCK, errno.EINTR})

_LOG = logging.getLogger(__name__)


class HostName:
    """A host, given as an address or a name."""

    def __init__(
        self, host: str, on_found: Callable[[], None], family: int = socket.AF_UNSPEC
    ) -> None:
        """Look up a host; `on_found` is called from a thread after each successful lookup."""
        self._host = host
        self._family = family
        self._on_found = on_found
        self._thread: threading.Thread | None = None
        self._next_at = 0.0
        self._numeric = host if _is_numeric(host) else None

    def numeric(self, now: float) -> str | None:
        """Latest numeric address; None while none is known."""
        if not _is_numeric(self._host) and now >= self._next_at and not self._is_resolving:
            self._next_at = now + (
                UNKNOWN_LOOKUP_INTERVAL_S if self._numeric is None else LOOKUP_INTERVAL_S
            )
            self._thread = threading.Thread(target=self._resolve, name="host-name", daemon=True)
            self._thread.start()
        return self._numeric

    @property
    def _is_resolving(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _resolve(self) -> None:
        try:
            found = socket.getaddrinfo(self._host, None, self._family, socket.SOCK_DGRAM)
        except (OSError, UnicodeError):  # UnicodeError: the name is not a valid host name
            return
        self._numeric = str(found[0][4][0])
        self._on_found()


def _is_numeric(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


class UdpLink(Link):
    """One socket for all peers."""

    def __init__(self, url: LinkUrl, number: int, on_found: Callable[[], None]) -> None:
        """Bind a socket.

        Raises:
            LinkError: if it cannot listen there; PortBusyError if another program uses the port.
        """
        super().__init__(url, number)
        family = _family_of(url.host)
        self._target: HostName | None = None
        here = (url.host, url.port)
        if url.kind is LinkKind.UDP_OUT:
            self._target = HostName(url.host, on_found, family)
            here = ("::" if family is socket.AF_INET6 else ANY_ADDRESS, 0)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.settimeout(0.0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)  # Some modems need it
        _bind(self._socket, here, url)
        self._now = 0.0

    @property
    def port(self) -> int:
        """Port that it is bound to."""
        port: int = self._socket.getsockname()[1]
        return port

    def readers(self) -> list[int]:
        """The socket."""
        return [self._socket.fileno()]

    def contact_addresses(self) -> list[Address]:
        """The target of this link, once its address is known."""
        host = self._target.numeric(self._now) if self._target else None
        return [] if host is None else [Address(host, self.url.port, self._number)]

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Return the received datagrams."""
        self._now = now
        return self._datagrams() if self._socket.fileno() in ready else []

    def send(self, address: Address, frame: bytes) -> None:
        """Send one frame; a datagram that cannot be sent is lost, as on any radio."""
        try:
            self._socket.sendto(frame, (address.host, address.port))
        except OSError:
            return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _datagrams(self) -> list[Arrival]:
        arrivals: list[Arrival] = []
        while len(arrivals) < MAX_DATAGRAMS_PER_READ:
            try:
                data, place = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # ICMP answer to an earlier datagram: that port is closed
            except OSError as error:
                _LOG.warning("%s: %s", self.url, error)
                break
            arrivals.append((Address(place[0], place[1], self._number), data))
        return arrivals


class TcpClient(SinglePeerLink):
    """An outgoing connection."""

    def __init__(self, url: LinkUrl, number: int, on_found: Callable[[], None]) -> None:
        super().__init__(url, number, RetryTimer(url))
        self._host = HostName(url.host, on_found)
        self._socket: socket.socket | None = None
        self._connect_deadline = 0.0

    def writers(self) -> list[int]:
        """A connection that is being opened, or for which data is queued."""
        if self._socket is not None and self._stream is None:
            return [self._socket.fileno()]
        return super().writers()

    def due_at(self) -> float | None:
        """When it connects again, or when connecting times out."""
        if self._socket is not None and self._stream is None:
            return self._connect_deadline
        return super().due_at()

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
        self._socket = socket.socket(_family_of(host), socket.SOCK_STREAM)
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
            self._stream = Stream(connection.fileno(), TCP_QUEUE_BYTES)
            self._retry.opened()
        elif now >= self._connect_deadline:
            self._disconnect("no answer", now)


class TcpListener(Link):
    """Incoming connections."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Listen.

        Raises:
            LinkError: if it cannot listen there; PortBusyError if another program uses the port.
        """
        super().__init__(url, number)
        self._listener = socket.socket(_family_of(url.host), socket.SOCK_STREAM)
        self._listener.settimeout(0.0)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        _bind(self._listener, (url.host, url.port), url)
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
        self._clients[address] = client, Stream(client.fileno(), TCP_QUEUE_BYTES)
        _LOG.info("%s: %s connected", self.url, address)

    def _disconnect(self, address: Address, reason: str) -> None:
        client, stream = self._clients.pop(address)
        self._dropped += stream.dropped
        client.close()
        _LOG.info("%s: %s disconnected: %s", self.url, address, reason)


class SerialLink(SinglePeerLink):
    """A serial device."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Prepare a line; `step` opens it.

        Raises:
            LinkError: if the system does not support that speed.
        """
        if not hasattr(termios, f"B{url.port}"):
            raise LinkError(f"{url}: {url.port} is not a supported baud rate")
        super().__init__(url, number, RetryTimer(url, DEVICE_RETRY_S))
        self._rate_limiter = RateLimiter(url.port)

    def radio_status(self, free_percent: int) -> None:
        """Write more slowly while the radio's buffer is full."""
        self._rate_limiter.report(free_percent)

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Open the device when it is due, else read and write."""
        if self._stream is None:
            if now >= self._retry.at:
                self._open(now)
            return []
        return self._transfer(self._stream, ready, now)

    def _release(self) -> None:
        if self._stream is not None:
            os.close(self._stream.descriptor)

    def _open(self, now: float) -> None:
        try:
            descriptor = _open_line(self.url.host, self.url.port)
        except (OSError, termios.error) as error:
            self._retry.failed(now, str(error.args[-1] if error.args else error))
            return
        self._stream = Stream(descriptor, rate_limiter=self._rate_limiter)
        self._retry.opened()


def _family_of(host: str) -> socket.AddressFamily:
    """Family of a numeric address; names and other texts count as version 4."""
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def _bind(one: socket.socket, here: tuple[Any, ...], url: LinkUrl) -> None:
    """Bind a socket; closes it if that fails.

    Raises:
        LinkError: if it cannot listen there; PortBusyError if another program uses the port.
    """
    try:
        one.bind(here)
    except OSError as error:
        one.close()
        protocol = "UDP" if url.kind in {LinkKind.UDP_IN, LinkKind.UDP_OUT} else "TCP"
        if error.errno == errno.EADDRINUSE:
            text = f"{protocol} port {url.port} is in use by another program"
            raise PortBusyError(text) from error
        hint = "; use udpout:// or tcp:// to connect to another machine"
        reason = f"{error.strerror}{hint if error.errno == errno.EADDRNOTAVAIL else ''}"
        raise LinkError(f"{url}: cannot listen there: {reason}") from error


def _configure_socket(connection: socket.socket) -> None:
    """Never block, send at once, notice an other side that has vanished."""
    connection.settimeout(0.0)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, USER_TIMEOUT_MS)


def _lock(descriptor: int) -> None:
    """Lock a device: two readers would each get a part of its bytes.

    Raises:
        OSError: if another program has locked it.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(errno.EBUSY, "another program uses it") from error


def _open_line(path: str, baud: int) -> int:
    """Open a device in raw mode, locked for this program.

    Raises:
        OSError: if it cannot be opened.
        termios.error: if it is not a terminal.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        _lock(descriptor)
        characters = termios.tcgetattr(descriptor)[_CHARACTERS]
        characters[termios.VMIN] = 1  # An empty read then means that the device is gone
        characters[termios.VTIME] = 0
        speed = getattr(termios, f"B{baud}")
        control = termios.CS8 | termios.CREAD | termios.CLOCAL
        raw = [0, 0, control, 0, speed, speed, characters]
        termios.tcsetattr(descriptor, termios.TCSANOW, raw)
        termios.tcflush(descriptor, termios.TCIFLUSH)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor
