"""ARMING, STARTING: the vehicle arms and starts the mission."""

from typing import Final

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.families import ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.microservices.command import Accepted, Refused
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.context import HOVERING, MissionContext
from mavlink_broker.mission.phases.phase import Fault, Phase, Result
from mavlink_broker.mission.states import Event
from mavlink_broker.vehicle.control_authority import AIRBORNE_MODES, DESCENT_MODES, Claim

FLYING_WITHIN_S: Final = 5.0
"""How long after its acceptance a start may take to show in a heartbeat."""
START_AGAIN_AFTER_S: Final = 1.0
ARM_AGAIN_AFTER_S: Final = 2.0


class Arming(Phase):
    """The vehicle is ordered to arm, for as long as its family needs."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._entered_at = 0.0
        self._again_at = 0.0

    @property
    def claim(self) -> Claim:
        """The mode in which it is armed is the broker's until it is left."""
        if self._mission.is_hovering:
            return HOVERING
        return Claim(AIRBORNE_MODES, mode=self._mission.authority.arming_mode, is_exclusive=True)

    def enter(self, now: float, effects: Effects) -> Result:
        """Order it."""
        self._entered_at = now
        self._order(now, effects)
        return None

    def _order(self, now: float, effects: Effects) -> None:
        vehicle = self._mission.vehicle
        self._mission.authority.order_arming(now)
        self.exchange = exchanges.commands(
            vehicle.family.arming, vehicle, sends_until=self._mission.expires_at
        )
        effects.messages += self.exchange.start(now)

    def settle(self, now: float, effects: Effects) -> Result:
        """After a refusal that may pass order it again, unless it has expired; both after a pause.

        In the pause a heartbeat may show that the vehicle is armed, though its answer is lost.
        """
        del effects
        outcome = self.exchange.outcome if self.exchange else None
        if isinstance(outcome, Refused) and outcome.result is not None:
            self._mission.vehicle.armed_period.refuse_arming()
        match outcome:
            case Accepted():
                return Event.ARMED
            case Refused() if self._may_still_arm(now) or self._mission.is_expired(now):
                self.exchange = None
                self._again_at = now + ARM_AGAIN_AFTER_S
            case Refused(reason):
                return Fault(reason)
        return None

    def _may_still_arm(self, now: float) -> bool:
        """Whether a refusal may pass: the vehicle judges by itself, and sends its reasons."""
        return now - self._entered_at < self._mission.vehicle.family.arming_retry_s

    def tick(self, now: float, effects: Effects) -> Result:
        """Trust a heartbeat that shows the vehicle armed, though its answer is lost.

        A vehicle disarms by itself, mostly after 10 s, when it is not started until then.
        """
        mission = self._mission
        if mission.vehicle.snapshot.armed and not mission.is_hovering:
            return Event.ARMED
        if self.exchange is not None or now < self._again_at:
            return None
        if mission.is_expired(now):
            mission.expire(effects)
            effects.messages += exchanges.disarming(mission.vehicle)
            return Event.ENDED
        self._order(now, effects)
        return None


class Starting(Phase):
    """The vehicle is ordered to start; its heartbeat has to show that it flies."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._vehicle = context.vehicle
        self._was_in_mission_mode = False  # When it was ordered to start
        self._again_at = 0.0
        self._accepted_at: float | None = None

    @property
    def claim(self) -> Claim:
        """A segment that only lands or returns leaves the mission mode at once."""
        if not self._mission.is_hovering:
            return Claim(
                AIRBORNE_MODES, mode=self._mission.authority.arming_mode, is_exclusive=True
            )
        if self._mission.plan.comes_down_at_once:
            return Claim(DESCENT_MODES, is_exclusive=True)
        return HOVERING

    def enter(self, now: float, effects: Effects) -> Result:
        """Report that the segment runs before the vehicle is ordered to start it.

        The report may still wait for the edge server when a broker is killed. Without it a
        restarted broker would not know that the segment may have been flown.
        """
        mission, first = self._mission, self._mission.plan.first_command
        self._accepted_at = None
        mission.is_start_ordered = True
        self._vehicle.set_hovering(hovers=False)
        mission.ledger.set_mission(Status.RUNNING)
        mission.ledger.set_command(first, Status.RUNNING)
        mission.report(effects)
        self._was_in_mission_mode = self._vehicle.mode_role is ModeRole.MISSION
        time_s = self._vehicle.snapshot.time_s
        self._vehicle.recovery.note_segment(mission.ledger.name_of(first), time_s)
        self._order_when_stored(now, effects)
        return None

    def _order_when_stored(self, now: float, effects: Effects) -> None:
        """Order the start once the journal holds what a restarted broker has to know."""
        if not self._vehicle.recovery.is_stored:
            return
        self._again_at = now + START_AGAIN_AFTER_S
        self.exchange = exchanges.commands(self._vehicle.family.starting, self._vehicle)
        effects.messages += self.exchange.start(now)

    def settle(self, now: float, effects: Effects) -> Result:
        """Handle the answer; the vehicle then has `FLYING_WITHIN_S` to show that it flies."""
        del effects
        match self.exchange.outcome if self.exchange else None:
            case Accepted() if self._accepted_at is None:
                self._accepted_at = now
            case Refused(reason):
                return Fault(reason)
        return None

    def tick(self, now: float, effects: Effects) -> Result:
        """Go on when a heartbeat shows that it flies: armed, and in a mission mode.

        A mode that it has entered since the order to start proves as much as its answer. PX4
        leaves the mission mode for an item that returns before a heartbeat has shown it.
        """
        if self.exchange is None:
            self._order_when_stored(now, effects)
            return None
        vehicle, accepted_at = self._vehicle, self._accepted_at
        roles = {ModeRole.MISSION}
        if self._mission.is_hovering and self._mission.plan.comes_down_at_once:
            roles.add(ModeRole.ENDING)
        flies = bool(vehicle.snapshot.armed) and vehicle.mode_role in roles
        if flies and (accepted_at is not None or not self._was_in_mission_mode):
            return Event.FLYING
        if accepted_at is None:
            self._repeat(now, effects)
        elif now - accepted_at > FLYING_WITHIN_S:
            is_armed = vehicle.snapshot.armed
            seen = f"mode is {vehicle.mode}" if is_armed else "the vehicle is disarmed"
            return Fault(f"start accepted, but {seen}")
        return None

    def _repeat(self, now: float, effects: Effects) -> None:
        """Repeat the order over a slow link before its answer can have arrived."""
        if now >= self._again_at and self._vehicle.round_trip.timeout_s > START_AGAIN_AFTER_S:
            self._again_at = now + START_AGAIN_AFTER_S
            starting = self._vehicle.family.starting
            effects.messages.append(exchanges.repetition(starting, self._vehicle))
