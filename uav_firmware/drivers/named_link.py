"""A UDP link whose peers are identified by host name, whatever their address is at the moment.

A peer's address changes when its container is recreated or its DHCP lease expires. So the name of
a peer that has been silent is resolved again. That may take seconds, hence a thread of its own;
the link never waits for it.
"""

import socket
import threading
from collections.abc import Callable, Sequence
from typing import Final

from uav_firmware.cal.link import Address
from uav_firmware.drivers.udp_link import UdpLink

RESOLVE_INTERVAL_S: Final = 5.0
"""Silence of a peer after which its name is resolved again; at most twice as long."""


class PeerResolver:
    """Translates between the addresses in the configuration and those of the network."""

    def __init__(
        self, peers: Sequence[Address], resolve: Callable[[str], str] = socket.gethostbyname
    ) -> None:
        """Set the peers as (name, port), none of them resolved yet."""
        self._peers = tuple(peers)
        self._resolve = resolve
        self._numeric: dict[Address, Address] = {}
        self._named: dict[Address, Address] = {}
        self._active: set[Address] = set()
        self._stopped = threading.Event()

    def numeric(self, address: Address) -> Address | None:
        """The numeric address of a peer; None while its name has never been resolved."""
        return self._numeric.get(address) if address in self._peers else address

    def named(self, address: Address) -> Address:
        """The peer at a numeric address, or that address if no peer has it."""
        return self._named.get(address, address)

    def mark_active(self, peer: Address) -> None:
        """Keep the address of a peer that has sent a datagram from there."""
        self._active.add(peer)

    def resolve(self) -> None:
        """Resolve every peer silent since the last call; a failure keeps the last address."""
        silent = [peer for peer in self._peers if peer not in self._active]
        self._active.clear()
        for peer in silent:
            host, port = peer
            try:
                self._numeric[peer] = (self._resolve(host), port)
            except OSError:
                continue  # The name may come back; until then the last address is the best guess
        self._named = {numeric: peer for peer, numeric in self._numeric.items()}

    def start(self) -> None:
        """Resolve now, and from now on in the background."""
        self.resolve()
        threading.Thread(target=self._run, name="peer-resolver", daemon=True).start()

    def close(self) -> None:
        """End the background thread."""
        self._stopped.set()

    def _run(self) -> None:
        while not self._stopped.wait(RESOLVE_INTERVAL_S):
            self.resolve()


class NamedLink(UdpLink):
    """Implements `uav_firmware.cal.link.Link`; the address of a peer is its name and port.

    Every other sender keeps its numeric address.
    """

    def __init__(self, host: str, port: int, resolver: PeerResolver) -> None:
        """Bind to `host` and `port`, and start to resolve the peers.

        Raises:
            OSError: if the address cannot be bound.
        """
        super().__init__(host, port)
        self._resolver = resolver
        resolver.start()

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """Datagrams that have arrived with their senders, at most 64 in a call."""
        return [(datagram, self._sender(address)) for datagram, address in super().receive()]

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; one to a name without an address is dropped and counted."""
        if (numeric := self._resolver.numeric(address)) is None:
            self.send_faults += 1
        else:
            super().send(datagram, numeric)

    def refused_addresses(self) -> Sequence[Address]:
        """Peers whose port was closed for a datagram since the last call."""
        return [self._resolver.named(address) for address in super().refused_addresses()]

    def close(self) -> None:
        """Release the socket and end the background thread."""
        self._resolver.close()
        super().close()

    def _sender(self, numeric: Address) -> Address:
        peer = self._resolver.named(numeric)
        if peer != numeric:
            self._resolver.mark_active(peer)
        return peer
