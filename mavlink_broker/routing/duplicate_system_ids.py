"""Two vehicles that were given the same system id, told from one vehicle with two ways.

One that is heard by radio and wifi says the same on both; two vehicles have clocks that began at
different times. Neither is spoken to by turns (`mavlink_broker.routing.link_selection`), but
somebody has to know.
"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.dialect import Message, source_of

DIFFERENT_MS: Final = 10_000
"""More than frames are late on any way, and than a fast simulation's clock runs meanwhile."""
COUNTER: Final = 1 << 32
"""Values of `time_boot_ms`, which begins at 0 again behind them."""
CONFIRMATIONS: Final = 3
TOLD_FOR_S: Final = 10.0


@dataclass(slots=True)
class _Other:
    address: Address
    since: float
    differing: int = 0


class Twins:
    """Watches the clocks of all systems."""

    def __init__(self) -> None:
        self._clocks: dict[int, tuple[int, float]] = {}
        self._others: dict[int, _Other] = {}

    def here(self, message: Message, now: float) -> None:
        """Take a message that came by the way that counts."""
        boot_ms: int | None = getattr(message, "time_boot_ms", None)
        if boot_ms is not None:
            self._clocks[source_of(message).system] = boot_ms, now

    def elsewhere(self, message: Message, address: Address, now: float) -> bool:
        """Take a message that came by another way; true when it proves another vehicle, once."""
        system = source_of(message).system
        boot_ms: int | None = getattr(message, "time_boot_ms", None)
        clock = self._clocks.get(system)
        if boot_ms is None or clock is None:
            return False
        other = self._others.get(system)
        if other is None or other.address != address:
            other = self._others[system] = _Other(address, now)
        expected_ms = clock[0] + 1000.0 * (now - clock[1])
        apart_ms = (boot_ms - expected_ms + COUNTER / 2) % COUNTER - COUNTER / 2
        differs = abs(apart_ms) > DIFFERENT_MS
        other.differing = other.differing + 1 if differs else 0
        if differs:
            other.since = now
        return other.differing == CONFIRMATIONS

    def forget(self, system: int) -> None:
        """Begin anew with a system."""
        self._clocks.pop(system, None)
        self._others.pop(system, None)

    def warning(self, system: int, now: float) -> str | None:
        """What somebody should know about a system, if anything."""
        other = self._others.get(system)
        if other is None or other.differing < CONFIRMATIONS or now - other.since > TOLD_FOR_S:
            return None
        return f"another vehicle at {other.address} has the same system id, {system}"
