"""MAVLink datagrams over a UDP socket that never blocks."""

import select
import socket
import sys
from collections.abc import Sequence
from typing import Final

from uav_firmware.cal.link import Address

MAX_DATAGRAMS_PER_CALL: Final = 64
"""A flood is served in slices, so that the control loop keeps its step time."""
MAX_DATAGRAM_BYTES: Final = 4096
_BUFFER_BYTES: Final = 1 << 20
_IP_RECVERR: Final = 11
"""Linux's socket option (ip(7)): report destinations where no process listens."""
_ANCILLARY_BYTES: Final = 512


class UdpLink:
    """A bound UDP socket; implements `uav_firmware.cal.link.Link`.

    A datagram that cannot be sent is lost and counted, as on a radio: no process
    listens, no route, or the buffer is full. `refused_addresses` reports the first, on Linux.
    """

    def __init__(self, host: str, port: int) -> None:
        """Bind to `host` and `port`; port 0 lets the system choose.

        Raises:
            OSError: if the address cannot be bound.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.settimeout(0.0)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
            if sys.platform == "linux":
                self._socket.setsockopt(socket.IPPROTO_IP, _IP_RECVERR, 1)
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        # Asking a poll object costs a third of a failed recvfrom, and idle is the usual case.
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self.send_faults: int = 0
        self._refused: set[Address] = set()

    @property
    def address(self) -> Address:
        """Address that the socket is bound to."""
        host, port = self._socket.getsockname()
        return (host, port)

    def wait(self, timeout_s: float) -> bool:
        """Wait until a datagram has arrived or the time is over; True when one has.

        For the pacing of a loop that has nothing else to do until its next step.
        """
        # Not poll, which rounds up to whole milliseconds.
        return bool(select.select((self._socket,), (), (), max(timeout_s, 0.0))[0])

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """Datagrams that have arrived with their senders, at most 64 in a call."""
        if not self._poll.poll(0):
            return ()
        datagrams: list[tuple[bytes, Address]] = []
        for _ in range(MAX_DATAGRAMS_PER_CALL):
            try:
                datagrams.append(self._socket.recvfrom(MAX_DATAGRAM_BYTES))
            except BlockingIOError:
                break
            except OSError:
                # An error of a former destination where no process listens; not a datagram.
                self._note_refusals()
        return datagrams

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; an unreachable address is no error."""
        try:
            self._send(datagram, address)
        except OSError:
            self.send_faults += 1

    def refused_addresses(self) -> Sequence[Address]:
        """Addresses whose port was closed for a datagram since the last call."""
        self._note_refusals()
        refused, self._refused = tuple(self._refused), set()
        return refused

    def _send(self, datagram: bytes, address: Address) -> None:
        try:
            self._socket.sendto(datagram, address)
        except ConnectionRefusedError:
            # The error is of an earlier datagram; this one has not been sent yet.
            self._note_refusals()
            self._socket.sendto(datagram, address)

    def _note_refusals(self) -> None:
        """Empty the socket's queue of errors."""
        if sys.platform != "linux":
            return
        for _ in range(MAX_DATAGRAMS_PER_CALL):
            try:
                _, _, _, address = self._socket.recvmsg(1, _ANCILLARY_BYTES, socket.MSG_ERRQUEUE)
            except OSError:
                return  # Nothing is left in it
            if address:
                self._refused.add(address)

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()
