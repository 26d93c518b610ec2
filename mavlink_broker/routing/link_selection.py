"""Selects the active link of a vehicle's component among several.

A vehicle may have a radio and a wifi link at once and sends everything on both. Messages of the
active link only are processed, so that nothing takes effect twice. The active link stays active
until it has been silent for 1.5 s, so that two good links do not alternate. A link that is
configured earlier takes over when it has been received for 5 s without such a gap.
"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.links.url import Address

SILENT_AFTER_S: Final = 1.5
"""Below the 2 s after which a vehicle's link is stale: a spare link takes over before that."""
STEADY_AFTER_S: Final = 5.0
ADDRESSES_KEPT: Final = 8
"""Per component; the one with the oldest message is forgotten first."""


@dataclass(slots=True)
class _Reception:
    since: float  # End of the last gap
    last: float  # Time of the last message


class LinkSelection:
    """The links on which one component is received."""

    def __init__(self) -> None:
        self._receptions: dict[Address, _Reception] = {}
        self.active: Address | None = None

    def receive(self, address: Address, now: float) -> bool:
        """Take a message; true if its link is, or has just become, the active one."""
        self._note(address, now)
        if self.active != address and self._is_better(address, now):
            self.active = address
        return self.active == address

    def is_silent(self, now: float, after_s: float = SILENT_AFTER_S) -> bool:
        """Whether nothing has been received on the active link for so long."""
        return self.active is None or now - self._receptions[self.active].last > after_s

    def _note(self, address: Address, now: float) -> None:
        reception = self._receptions.get(address)
        if reception is None:
            if len(self._receptions) >= ADDRESSES_KEPT:
                self._forget_stalest()
            self._receptions[address] = _Reception(now, now)
            return
        if now - reception.last > SILENT_AFTER_S:
            reception.since = now
        reception.last = now

    def _is_better(self, address: Address, now: float) -> bool:
        if self.active is None or self.is_silent(now):
            return True
        is_steady = now - self._receptions[address].since >= STEADY_AFTER_S
        return address.link < self.active.link and is_steady

    def _forget_stalest(self) -> None:
        others = [address for address in self._receptions if address != self.active]
        del self._receptions[min(others, key=lambda address: self._receptions[address].last)]
