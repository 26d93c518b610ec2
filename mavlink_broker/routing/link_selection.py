"""On which link a vehicle is received, and whether another vehicle has its system id.

`LinkSelection` selects the active link of a vehicle's component among several. A vehicle may have a
radio and a wifi link at once and sends everything on both. Messages of the active link only are
processed, so that nothing takes effect twice. The active link stays active until it has been silent
for 1.5 s, so that two good links do not alternate. A link that is configured earlier takes over
when it has been received for 5 s without such a gap.

Two vehicles with the same system id look like one vehicle on two links. One vehicle sends the same
on its radio and its wifi link; the clocks (`time_boot_ms`) of two vehicles' autopilots started at
different times. Only one link is active at a time, so commands do not alternate between the
vehicles, but an operator has to be warned. While the broker has a mission on the vehicle, a link
becomes active only if its clock goes on, or began after the last message of the active one: a
vehicle that was restarted. A clock that ran before already is another vehicle's, which is received
a minute later and does not go on with the mission. A link that becomes active without a clock
proves nothing: until its clock is received the vehicle may be another one.
"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.dialect import BOOT_MS_VALUES, Message, boot_ms_of, source_of
from mavlink_broker.microservices.link_state import CLOCK_WITHIN_S

SILENT_AFTER_S: Final = 1.5
"""Below the 2 s after which a vehicle's link is stale: a spare link takes over before that."""
STEADY_AFTER_S: Final = 5.0
ADDRESSES_KEPT: Final = 8
"""Per component; the one with the oldest message is forgotten first."""
CLOCK_DIFFERENCE_MS: Final = 10_000
"""More than any link delays frames, and more than a fast simulation's clock gains meanwhile."""
OTHERS_KEPT: Final = 256
REPLACED_AFTER_S: Final = 60.0
"""Silence during a mission after which another vehicle with the system id is received instead."""
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

    def receive(self, address: Address, now: float, *, may_lead: bool = True) -> bool:
        """Handle a message; true if its link is, or has just become, the active one.

        It becomes so only if it `may_lead`.
        """
        self._note(address, now)
        if self.active != address and may_lead and self._is_better(address, now):
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
        self._same: dict[tuple[int, Address], bool] = {}  # By the last clock received there
        self._without_clock: dict[tuple[int, Address], float] = {}  # Since when it is received

    def receive_active(self, message: Message, address: Address, now: float) -> bool:
        """Handle a message from the active link; true when its first clock is another vehicle's."""
        boot_ms = boot_ms_of(message)
        if boot_ms is None:
            return False
        system = source_of(message).system
        is_first = (system, address) in self._without_clock
        is_another = is_first and not self.is_same(message, address, now)
        self._clocks[system] = boot_ms, now
        return is_another

    def is_same(
        self, message: Message, address: Address, now: float, *, is_autopilot: bool = True
    ) -> bool:
        """Whether a message from another link is of the vehicle on the active one.

        Its clock goes on, or has begun since that was received last. Without a clock it is, when
        that has been silent for `CLOCK_WITHIN_S` and this one has been received for so long. The
        clock of a camera or another part proves nothing: it may have begun at any time.
        """
        system = source_of(message).system
        clock = self._clocks.get(system)
        if clock is None:
            return True
        boot_ms = boot_ms_of(message) if is_autopilot else None
        if boot_ms is not None:
            if len(self._same) >= OTHERS_KEPT:
                self._same.clear()
            self._without_clock.pop((system, address), None)
            has_begun = boot_ms < 1000.0 * (now - clock[1])
            self._same[system, address] = has_begun or not self._differs(boot_ms, clock, now)
        if (system, address) in self._same:
            return self._same[system, address]
        if len(self._without_clock) >= OTHERS_KEPT:
            self._without_clock.clear()
        since = self._without_clock.setdefault((system, address), now)
        return now - max(since, clock[1]) >= CLOCK_WITHIN_S

    def lacks_clock(self, system: int, address: Address) -> bool:
        """Whether a system is received from another link that has not sent a clock yet."""
        return (system, address) in self._without_clock

    def is_another(self, system: int, address: Address) -> bool:
        """Whether the last clock that was received from another link is another vehicle's."""
        return not self._same.get((system, address), True)

    def receive_other(self, message: Message, address: Address, now: float) -> bool:
        """Handle a message from another link; true, once, when it proves a second vehicle."""
        system = source_of(message).system
        boot_ms = boot_ms_of(message)
        clock = self._clocks.get(system)
        if boot_ms is None or clock is None:
            return False
        other = self._others.get(system)
        if other is None or other.address != address:
            other = self._others[system] = _Other(address, now)
        differs = self._differs(boot_ms, clock, now)
        other.differing = other.differing + 1 if differs else 0
        if differs:
            other.since = now
        return other.differing == CONFIRMATIONS

    @staticmethod
    def _differs(boot_ms: int, clock: tuple[int, float], now: float) -> bool:
        expected_ms, half = clock[0] + 1000.0 * (now - clock[1]), BOOT_MS_VALUES / 2
        apart_ms = (boot_ms - expected_ms + half) % BOOT_MS_VALUES - half
        return abs(apart_ms) > CLOCK_DIFFERENCE_MS

    def forget(self, system: int) -> None:
        """Forget a system."""
        self._clocks.pop(system, None)
        self._others.pop(system, None)
        self._same = {key: same for key, same in self._same.items() if key[0] != system}
        self._without_clock = {
            key: since for key, since in self._without_clock.items() if key[0] != system
        }

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
