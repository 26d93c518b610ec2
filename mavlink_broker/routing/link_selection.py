"""By which of several ways a component of a vehicle is listened to and answered.

A vehicle may have a radio and wifi at once, and says everything on both. Only one way counts at
a time, so that nothing takes effect twice; the others only show that they are there. The way
that counts is kept until it has been silent for 1.5 s, so that two good ways are not changed
between at every message; a way by a link that was named earlier takes over when it has been heard
for 5 s without such a silence.
"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.links.url import Address

SILENT_AFTER_S: Final = 1.5
"""Below the 2 s after which a vehicle's link is stale: a spare way keeps it fresh."""
TRUSTED_AFTER_S: Final = 5.0
WAYS_KEPT: Final = 8
"""Per component; the one not heard for longest is forgotten first."""


@dataclass(slots=True)
class _Hearing:
    since: float  # Of the last silence's end
    last: float


class Ways:
    """The ways to one component."""

    def __init__(self) -> None:
        self._hearings: dict[Address, _Hearing] = {}
        self.active: Address | None = None

    def hear(self, address: Address, now: float) -> bool:
        """Note a message; true if it came by the way that counts, which this may have changed."""
        self._note(address, now)
        if self.active != address and self._is_better(address, now):
            self.active = address
        return self.active == address

    def is_silent(self, now: float, after_s: float = SILENT_AFTER_S) -> bool:
        """Whether nothing has come by the way that counts for so long."""
        return self.active is None or now - self._hearings[self.active].last > after_s

    def _note(self, address: Address, now: float) -> None:
        hearing = self._hearings.get(address)
        if hearing is None:
            if len(self._hearings) >= WAYS_KEPT:
                self._forget_stalest()
            self._hearings[address] = _Hearing(now, now)
            return
        if now - hearing.last > SILENT_AFTER_S:
            hearing.since = now
        hearing.last = now

    def _is_better(self, address: Address, now: float) -> bool:
        if self.active is None or self.is_silent(now):
            return True
        is_steady = now - self._hearings[address].since >= TRUSTED_AFTER_S
        return address.link < self.active.link and is_steady

    def _forget_stalest(self) -> None:
        others = [address for address in self._hearings if address != self.active]
        del self._hearings[min(others, key=lambda address: self._hearings[address].last)]
