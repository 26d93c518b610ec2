"""Who is in command of the vehicle during one mission.

Each phase claims the modes in which the broker is in command
(`mavlink_broker.vehicle.control_authority`). This monitor keeps what those claims depend on from
one phase to the next.
"""

from typing import Final

from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import AIRBORNE_MODES, DESCENT_MODES, Authority, Claim
from mavlink_broker.vehicle.vehicle import Vehicle

DESCENDING: Final = Claim(DESCENT_MODES)
ON_GROUND: Final = Claim(frozenset(), may_be_armed=False)
TAKEN: Final = Claim(frozenset(), may_be_armed=False)
"""A vehicle that another system has taken, until it is disarmed."""
HOVERING: Final = Claim(AIRBORNE_MODES, is_exclusive=True)
"""A vehicle in the air that waits for its next order."""


class AuthorityMonitor:
    """The broker's control authority over one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self.arming_mode: str | None = None  # In which the vehicle is armed, until it is left
        self.is_arming_ordered = False  # And no heartbeat has shown the vehicle armed since
        self.was_taken = False  # Another system had the vehicle while the broker attached to it

    def who(self, claim: Claim | None) -> Authority:
        """Decide who is in command; without a claim the broker orders nothing in this phase.

        While an event has paused the mission, the mode in which the vehicle holds is the broker's.
        """
        if claim is None:
            return Authority.BROKER
        if self._vehicle.recovery.paused is not None and claim.mode is None:
            claim = claim._replace(mode=self._vehicle.family.paused_mode)
        return control_authority.authority_of(self._vehicle.observed_mode, claim)

    def update(self, claim: Claim | None, *, is_attaching: bool) -> Authority:
        """Decide who is in command, and keep what later claims depend on."""
        who = self.who(claim)
        if who is Authority.BROKER:
            self.was_taken &= bool(self._vehicle.snapshot.armed)
        else:
            self.was_taken |= is_attaching
        return who

    def observe_mode(self) -> None:
        """Read in which mode the vehicle is armed: the broker keeps that mode until it is left."""
        seen = self._vehicle.observed_mode
        self.is_arming_ordered &= not seen.armed
        if not seen.armed:
            self.arming_mode = seen.mode
        elif seen.mode != self.arming_mode:
            self.arming_mode = None

    def order_arming(self) -> None:
        """Note that the vehicle is ordered to arm."""
        self.is_arming_ordered = not self._vehicle.snapshot.armed

    @property
    def is_lost(self) -> bool:
        """Whether its own failsafe or another system controls a vehicle that waits for an order."""
        return self.who(HOVERING) is not Authority.BROKER

    @property
    def loss_reason(self) -> str:
        """Name who controls a vehicle that waits for an order, for the mission's report."""
        return self.reason(self.who(HOVERING))

    def reason(self, who: Authority) -> str:
        """Name who is in command, for the mission's report."""
        return control_authority.reason(who, self._vehicle.observed_mode)
