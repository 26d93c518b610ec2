"""A datagram link that carries MAVLink frames, over any medium."""

from collections.abc import Sequence
from typing import Protocol, TypeAlias

Address: TypeAlias = tuple[str, int]


class Link(Protocol):
    """Never blocks; drops datagrams instead."""

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """All datagrams that have arrived, with their senders."""

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; an unreachable address is no error."""

    def refused_addresses(self) -> Sequence[Address]:
        """Addresses that have refused datagrams since the last call: no process listens there.

        A link that cannot detect this returns none.
        """

    def close(self) -> None:
        """Release the socket."""
