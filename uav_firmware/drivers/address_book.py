"""Numeric addresses of the peers that are known by name.

A name outlives its address: a container that is made anew, or a laptop with a new lease, comes
back elsewhere. So a peer that has fallen silent is looked up again. A look-up may take seconds,
hence a thread of its own; the link never waits for it.
"""

import socket
import threading
from collections.abc import Callable, Sequence
from typing import Final

from uav_firmware.cal.link import Address

LOOK_UP_EVERY_S: Final = 5.0
"""How long a peer may be silent before its name is looked up, at most twice as long."""


class AddressBook:
    """Translates between the addresses that the configuration names and those of the network."""

    def __init__(
        self, peers: Sequence[Address], resolve: Callable[[str], str] = socket.gethostbyname
    ) -> None:
        """Take peers as (name, port); none of them is looked up yet."""
        self._peers = tuple(peers)
        self._resolve = resolve
        self._numeric: dict[Address, Address] = {}
        self._named: dict[Address, Address] = {}
        self._heard: set[Address] = set()
        self._stopped = threading.Event()

    def numeric(self, address: Address) -> Address | None:
        """Where a datagram for an address goes; None while the name has never had an address."""
        return self._numeric.get(address) if address in self._peers else address

    def named(self, address: Address) -> Address:
        """The peer at a numeric address, or that address where it is none's."""
        return self._named.get(address, address)

    def note_heard(self, peer: Address) -> None:
        """Leave the address of a peer as it is, since it has spoken from there."""
        self._heard.add(peer)

    def look_up(self) -> None:
        """Look up every peer that has been silent since the last time; keep what has no answer."""
        silent = [peer for peer in self._peers if peer not in self._heard]
        self._heard.clear()
        for peer in silent:
            host, port = peer
            try:
                self._numeric[peer] = (self._resolve(host), port)
            except OSError:
                continue  # The name may come back; until then the last address is the best guess
        self._named = {numeric: peer for peer, numeric in self._numeric.items()}

    def keep(self) -> None:
        """Look up now, and from now on in the background."""
        self.look_up()
        threading.Thread(target=self._keep, name="address-book", daemon=True).start()

    def close(self) -> None:
        """Look up no more."""
        self._stopped.set()

    def _keep(self) -> None:
        while not self._stopped.wait(LOOK_UP_EVERY_S):
            self.look_up()
