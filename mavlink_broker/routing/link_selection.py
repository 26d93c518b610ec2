"""Selects the active link of a vehicle's component among several.

A vehicle may have a radio and a wifi link at once and sends everything on both. Messages of the
active link only are processed, so that nothing takes effect twice. The active link stays active
until it has been silent for 1.5 s, so that two good links do not alternate. A link that is
configured earlier takes over when it has been received for 5 s without such a gap.

Two vehicles with the same system id look like one vehicle on two links. One vehicle sends the same
on its radio and its wifi link; the clocks (`time_boot_ms`) of two vehicles started at different
times. Only one link is active at a time, so commands do not alternate between the vehicles, but an
operator has to be warned.

"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.dialect import Message, source_of

SILENT_AFTER_S: Final = 1.5
"""Below the 2 s after which a vehicle's link is stale: a spare link takes over before that."""
STEADY_AFTER_S: Final = 5.0
ADDRESSES_KEPT: Final = 8
"""Per component; the one with the oldest message is forgotten first."""
CLOCK_DIFFERENCE_MS: Final = 10_000
"""More than any link delays frames, and more than a fast simulation's clock gains meanwhile."""
COUNTER_SIZE: Final = 1 << 32
"""Number of values of `time_boot_ms`, after which it starts at 0 again."""
CONFIRMATIONS: Final = 3
WARNING_DURATION_S: Final = 10.0


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
        """Handle a message; true if its link is, or has just become, the active one."""
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


@dataclass(slots=True)
class _Other:
    address: Address
    since: float
    differing: int = 0


class DuplicateSystemIds:
    """Compares the clocks of all systems."""

    def __init__(self) -> None:
        self._clocks: dict[int, tuple[int, float]] = {}
        self._others: dict[int, _Other] = {}

    def receive_active(self, message: Message, now: float) -> None:
        """Handle a message from the active link."""
        boot_ms: int | None = getattr(message, "time_boot_ms", None)
        if boot_ms is not None:
            self._clocks[source_of(message).system] = boot_ms, now

    def receive_other(self, message: Message, address: Address, now: float) -> bool:
        """Handle a message from another link; true, once, when it proves a second vehicle."""
        system = source_of(message).system
        boot_ms: int | None = getattr(message, "time_boot_ms", None)
        clock = self._clocks.get(system)
        if boot_ms is None or clock is None:
            return False
        other = self._others.get(system)
        if other is None or other.address != address:
            other = self._others[system] = _Other(address, now)
        expected_ms = clock[0] + 1000.0 * (now - clock[1])
        apart_ms = (boot_ms - expected_ms + COUNTER_SIZE / 2) % COUNTER_SIZE - COUNTER_SIZE / 2
        differs = abs(apart_ms) > CLOCK_DIFFERENCE_MS
        other.differing = other.differing + 1 if differs else 0
        if differs:
            other.since = now
        return other.differing == CONFIRMATIONS

    def forget(self, system: int) -> None:
        """Forget a system."""
        self._clocks.pop(system, None)
        self._others.pop(system, None)

    def warning(self, system: int, now: float) -> str | None:
        """Warning about a system for the operator; None if there is none."""
        other = self._others.get(system)
        if (
            other is None
            or other.differing < CONFIRMATIONS
            or now - other.since > WARNING_DURATION_S
        ):
            return None
        return f"another vehicle at {other.address} has the same system id, {system}"
