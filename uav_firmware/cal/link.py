"""A datagram link that carries MAVLink frames, whatever it is made of."""

from collections.abc import Sequence
from typing import Protocol, TypeAlias

Address: TypeAlias = tuple[str, int]


class Link(Protocol):
    """Never blocks; loses rather than waits."""

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """All datagrams that have arrived, with their senders."""

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; an unreachable address is no error."""

    def refused_addresses(self) -> Sequence[Address]:
        """Addresses that have refused datagrams since the last call: no process listens there.

        A link that cannot know gives none.
        """

    def close(self) -> None:
        """Release the socket."""
