"""Detects two vehicles with the same system id, as opposed to one vehicle on two links.

One vehicle sends the same on its radio and its wifi link; the clocks (`time_boot_ms`) of two
vehicles started at different times. Only one link is active at a time
(`mavlink_broker.routing.link_selection`), so commands do not alternate between the vehicles, but
an operator has to be warned.
"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.dialect import Message, source_of

CLOCK_DIFFERENCE_MS: Final = 10_000
"""More than any link delays frames, and more than a fast simulation's clock gains meanwhile."""
COUNTER_SIZE: Final = 1 << 32
"""Number of values of `time_boot_ms`, after which it starts at 0 again."""
CONFIRMATIONS: Final = 3
WARNING_DURATION_S: Final = 10.0


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
        """Take a message from the active link."""
        boot_ms: int | None = getattr(message, "time_boot_ms", None)
        if boot_ms is not None:
            self._clocks[source_of(message).system] = boot_ms, now

    def receive_other(self, message: Message, address: Address, now: float) -> bool:
        """Take a message from another link; true, once, when it proves a second vehicle."""
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
