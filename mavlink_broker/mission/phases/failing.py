"""FAILING: something was refused or went wrong, and the vehicle may still send its reasons."""

from typing import Final

from mavlink_broker.effects import Effects
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.context import HOVERING, TAKEN, MissionContext
from mavlink_broker.mission.phases.phase import Fault, Phase, Request, Result
from mavlink_broker.mission.states import ARMED_BY_BROKER, ASKING, IN_FLIGHT, Event, State
from mavlink_broker.vehicle.alarms import is_navigation_failure, mission_error
from mavlink_broker.vehicle.control_authority import (
    AIRBORNE_MODES,
    FAILSAFE_AFTER_S,
    TAKEOVER_AFTER_S,
    Authority,
    Claim,
)

REASONS_WITHIN_S: Final = 0.5
"""How long a vehicle that refused something may take to send its reason."""
REASONS_BEFORE_S: Final = 3.0
"""How long before a vehicle changes its mode it may say why."""


class Failing(Phase):
    """The end of a mission that has failed."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._vehicle = context.vehicle
        self._entered_at = 0.0
        self._fault = Fault("")
        self._stops_propellers = False  # The broker armed the vehicle, and it does not take off
        self._was_in_flight = False
        self._raises_alarm = False
        self._is_left_to_failsafe = False
        self._is_taken = False  # Another system, or a failsafe, has the vehicle
        self._waits_in_air = False  # And no other system flies it
        self._may_take_off = False  # It was ordered to start; in the air it refuses to disarm
        self._waiting: Claim | None = None  # What shows that it still waits; None: it does not

    @property
    def claim(self) -> Claim | None:
        """The mode in which the broker has armed the vehicle, until it is left.

        None of a vehicle that was taken: an abort that comes now must not order it.
        """
        if self._is_taken:
            return TAKEN
        if not self._stops_propellers:
            return None
        return Claim(AIRBORNE_MODES, mode=self._mission.authority.arming_mode)

    def prepare(self, fault: Fault, state: State, phase: Phase, effects: Effects) -> None:
        """Judge a fault in the phase in which it occurs; the transition to this one ends that."""
        mission, vehicle = self._mission, self._vehicle
        who = mission.authority.who(phase.claim)
        is_taken, was_taken = who is not Authority.BROKER, phase.was_taken
        self._fault = fault
        self._is_taken = is_taken or (was_taken and bool(vehicle.snapshot.armed))
        if self._is_taken:
            vehicle.take_away()
        armed_by_broker = state in ARMED_BY_BROKER and not mission.is_hovering
        self._stops_propellers = armed_by_broker and not is_taken
        if self._stops_propellers:
            effects.messages += exchanges.disarming(vehicle)
        self._may_take_off = self._stops_propellers and mission.is_start_ordered
        held, self._was_in_flight = vehicle.is_held_by_failsafe, state in IN_FLIGHT
        # What a failsafe does is no alarm (its cause may be one), nor is what another system does
        self._raises_alarm = self._was_in_flight and not is_taken and not held
        self._is_left_to_failsafe = held or who is Authority.FAILSAFE
        is_begun = mission.is_hovering and mission.was_reported_running
        waits = state in ASKING and is_begun and not was_taken
        self._waits_in_air = (waits or phase.was_given_up) and not is_taken
        is_free = not self._is_taken and not mission.authority.is_lost
        still = HOVERING._replace(mode=vehicle.mode)  # Also that in which an event has paused it
        self._waiting = still if is_free and not phase.flies_another else None

    def forget_vehicle(self) -> None:
        """Give no further order: the vehicle was restarted."""
        self._waits_in_air = self._stops_propellers = self._may_take_off = False
        self._waiting = None

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle waits in the air, and no other system has taken it."""
        vehicle = self._vehicle
        if self._waiting is None or not vehicle.snapshot.armed or vehicle.is_standing_armed:
            return False
        return self._mission.authority.who(self._waiting) is Authority.BROKER

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin to wait for the vehicle's reasons."""
        del effects
        self._entered_at = now
        return None

    @property
    def _reasons_since(self) -> float:
        """The time from which on the vehicle has sent reasons; before a flight, its beginning.

        What it has said earlier in a flight belongs to something else, such as another system's
        order that it has refused.
        """
        began_at = self._mission.began_at
        if not self._was_in_flight:
            return began_at
        noticed_s = FAILSAFE_AFTER_S if self._is_left_to_failsafe else TAKEOVER_AFTER_S
        return max(began_at, self._entered_at - noticed_s - REASONS_BEFORE_S)

    def tick(self, now: float, effects: Effects) -> Result:
        """Report the failure with the vehicle's reasons.

        A vehicle that waits in the air returns; one that may take off disarms, or lands.
        """
        if now - self._entered_at < REASONS_WITHIN_S:
            return None
        mission, vehicle = self._mission, self._vehicle
        if self._stops_propellers and mission.authority.who(self.claim) is Authority.BROKER:
            effects.messages += exchanges.disarming(vehicle)  # The first order may be lost
        reasons = vehicle.status_texts_since(self._reasons_since)
        text = f"{self._fault.reason} ({reasons})" if reasons else self._fault.reason
        left = self._is_left_to_failsafe and is_navigation_failure(reasons or "")
        if self._raises_alarm or left:
            mission_id = mission.work.mission.mission_id
            effects.for_edge.append(mission.reporter.alarm(mission_error(text), mission_id))
        mission.ledger.fail(text, self._fault.command)
        mission.report(effects)
        is_free = not vehicle.is_taken and not mission.authority.is_lost
        may_fly = self._waits_in_air or self._may_take_off
        comes_home = may_fly and is_free and vehicle.snapshot.armed
        return Request.RETURN_HOME if comes_home else Event.ENDED
