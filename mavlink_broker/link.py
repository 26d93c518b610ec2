"""MAVLink over UDP: bound to one port, vehicles speak first. The only importer of socket.

`wake` may be called from any thread and ends a wait at once, so that work from the edge server
is taken up without polling.
"""

import errno
import select
import socket
from typing import Final, TypeAlias

Address: TypeAlias = tuple[str, int]

RECEIVE_BUFFER_BYTES: Final = 1 << 20
LARGEST_DATAGRAM_BYTES: Final = 4096
"""Longer ones are cut: no sender packs more frames than a network packet holds."""
DATAGRAMS_AT_ONCE: Final = 256
"""So that a flood cannot keep the loop from its other duties."""


class PortBusyError(Exception):
    """Another program listens on the port."""


class UdpLink:
    """One UDP socket for all vehicles."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            if error.errno == errno.EADDRINUSE:
                raise PortBusyError(f"UDP port {port} is in use by another program") from error
            raise
        self._waker, self._woken = socket.socketpair()
        self._waker.settimeout(0.0)
        self._woken.settimeout(0.0)

    @property
    def port(self) -> int:
        """Port that it is bound to."""
        port: int = self._socket.getsockname()[1]
        return port

    def wake(self) -> None:
        """End a wait in `receive`; a full pipe is already as awake as can be."""
        try:
            self._waker.send(b"\0")
        except (BlockingIOError, OSError):
            return

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """Wait for datagrams or a wake-up, at most so long, and give what is there."""
        readable, _, _ = select.select([self._socket, self._woken], [], [], timeout_s)
        if self._woken in readable:
            self._woken.recv(4096)
        return self._datagrams() if self._socket in readable else []

    def _datagrams(self) -> list[tuple[Address, bytes]]:
        datagrams: list[tuple[Address, bytes]] = []
        while len(datagrams) < DATAGRAMS_AT_ONCE:
            try:
                data, address = self._socket.recvfrom(LARGEST_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # The answer to an earlier datagram: that port is closed
            datagrams.append((address, data))
        return datagrams

    def send(self, address: Address, frame: bytes) -> None:
        """Send one frame; a datagram that cannot leave is a lost one, as on any radio."""
        try:
            self._socket.sendto(frame, address)
        except OSError:
            return

    def close(self) -> None:
        """Give the port back."""
        for one in (self._socket, self._waker, self._woken):
            one.close()
