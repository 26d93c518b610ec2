"""PLACING_GEOFENCE to STARTING: the mission goes onto the vehicle, which arms and starts it.

The geofence is placed once for a mission, before the vehicle may fly. Each segment of mission
items is then uploaded, proved, and its first item selected.
"""

from typing import Final

from afarcloud.enumerations import Status
from afarcloud.route import highest_m
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.microservices.command import Accepted, Refused
from mavlink_broker.microservices.mission_download import Different, Verified
from mavlink_broker.microservices.mission_upload import NotStored, Stored, Uncertain
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.context import MissionContext
from mavlink_broker.mission.exchanges import Outcome
from mavlink_broker.mission.geofence_transfer import GeofenceTransfer, WantedGeofence
from mavlink_broker.mission.phases.phase import Fault, Phase, Result
from mavlink_broker.mission.states import Event
from mavlink_broker.planning.geofence import as_flown, rally_items
from mavlink_broker.planning.situation import RefusedError
from mavlink_broker.vehicle.control_authority import (
    AIRBORNE_MODES,
    DESCENT_MODES,
    HOVERING,
    ON_GROUND,
    Claim,
)


class _Transfer(Phase):
    """A phase in which the vehicle receives the mission: disarmed on the ground, or hovering."""

    @property
    def claim(self) -> Claim:
        """The vehicle is disarmed on the ground, or hovers."""
        return HOVERING if self._mission.is_hovering else ON_GROUND


class PlacingGeofence(_Transfer):
    """The state PLACING_GEOFENCE."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._transfer: GeofenceTransfer | None = None
        self._is_placed = False  # For the whole mission

    def forget(self) -> None:
        """Place the geofence again: the vehicle was restarted."""
        self._is_placed = False

    def enter(self, now: float, effects: Effects) -> Result:
        """Place the geofence, once for the whole mission; restore what an earlier plan replaced."""
        self._transfer = GeofenceTransfer(self._wanted(), self._vehicle)
        if self._is_placed or self._transfer.is_needless:
            return self._next()
        self.run(self._transfer, now, effects)
        return self.take_outcome(now)

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Go on within the geofence."""
        del now
        match outcome:
            case Accepted():
                return self._placed()
            case Refused(reason):
                return Fault(reason)
        return None

    def _wanted(self) -> WantedGeofence:
        work, vehicle = self._mission.work, self._vehicle
        height_m = highest_m(as_flown(work.mission.command_array, vehicle.family))
        return WantedGeofence(work.geofence, rally_items(work.rally_points), highest_m=height_m)

    def _placed(self) -> Result:
        """Check the mission again, for the vehicle may keep a lower height limit of its own."""
        self._is_placed = True
        if self._transfer is not None:
            self._mission.ledger.remark(self._transfer.notes)
            try:
                self._mission.check_area(own_limit_m=self._transfer.own_limit_m)
            except RefusedError as error:
                return Fault(error.reason, error.command_index)
        return self._next()

    def _next(self) -> Event:
        """Fly the next segment: live, by items from a hover, or by items from the ground."""
        if self._mission.is_live:
            return Event.LIVE_NEXT
        return Event.IN_AIR if self._mission.is_flying else Event.GEOFENCE_PLACED


class Holding(_Transfer):
    """A hovering vehicle leaves its mission mode, so that it does not fly items as they arrive."""

    def enter(self, now: float, effects: Effects) -> Result:
        """Order the hold mode."""
        vehicle = self._vehicle
        self.run(vehicle.sequence(vehicle.family.holding), now, effects)
        return None

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Go on when the vehicle has accepted."""
        del now
        match outcome:
            case Accepted():
                return Event.HELD
            case Refused(reason):
                return Fault(reason)
        return None


class Uploading(_Transfer):
    """The items go onto the vehicle."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self.opaque_id = 0  # That the vehicle gave to the upload; 0: none

    def enter(self, now: float, effects: Effects) -> Result:
        """Request the parameters of the segment, and begin the upload."""
        mission = self._mission
        mission.vehicle.override(tuple(override for _, override in mission.plan.overrides))
        self.run(exchanges.upload(mission.plan, mission.vehicle), now, effects)
        return None

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Have the vehicle prove what it stored, or translate again without what it refused."""
        del now
        match outcome:
            case Stored(opaque_id):
                self.opaque_id = opaque_id
                return Event.STORED
            case Uncertain():
                self.opaque_id = 0
                return Event.STORED
            case NotStored() as refusal:
                return self._refused(refusal)
        return None

    def _refused(self, refusal: NotStored) -> Result:
        """Find other items for what the vehicle does not support, or shorter segments."""
        mission, item = self._mission, refusal.item
        if item is None and refusal.is_too_long and mission.segments.shorten():
            mission.note_changes()
            part = len(mission.plan.items)
            mission.ledger.remark((f"flown in parts of up to {part} items: {refusal.reason}",))
            return Event.REFUSED
        if item is None:
            return Fault(refusal.reason)
        if refusal.is_unsupported and mission.segments.do_without(item):
            mission.note_changes()
            return Event.LIVE_NEXT if mission.is_live else Event.REFUSED
        return Fault(refusal.reason, mission.plan.command_of_item[item])


class Verifying(_Transfer):
    """The vehicle proves that it holds the items."""

    def __init__(self, context: MissionContext, uploading: Uploading) -> None:
        super().__init__(context)
        self._uploading = uploading

    def enter(self, now: float, effects: Effects) -> Result:
        """Ask for the opaque id of the upload, or read the items back."""
        mission = self._mission
        mission.foreign_uploader = mission.verified_total = None
        opaque_id = self._uploading.opaque_id
        verification = exchanges.verification(mission.plan, mission.vehicle, opaque_id)
        self.run(verification, now, effects)
        return None

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Fly only what is proved."""
        del now
        match outcome:
            case Verified():
                return Event.VERIFIED
            case Different(reason):
                return Fault(reason)
        return None


class Selecting(_Transfer):
    """The first item becomes the current one, and the vehicle has the parameters of the segment."""

    def enter(self, now: float, effects: Effects) -> Result:
        """Set the current item."""
        mission = self._mission
        self.run(exchanges.selection(mission.plan, mission.vehicle), now, effects)
        return None

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Go on when the parameters of the segment are set too."""
        del now
        match outcome:
            case Accepted():
                return Event.SELECTED if self._has_parameters() else None
            case Refused(reason):
                return Fault(reason)
        return None

    def _has_parameters(self) -> bool:
        """Whether the vehicle has the parameters that the segment needs, or has refused them.

        The first command of the segment names those that every mission needs.
        """
        mission = self._mission
        plan, parameters = mission.plan, mission.vehicle.parameters
        general = ((plan.first_command, one) for one in mission.vehicle.mission_overrides)
        overrides = (*general, *plan.overrides)
        for index in {index for index, _ in overrides} if parameters.refusals else ():
            names = (override[0].name for owner, override in overrides if owner == index)
            reasons = (parameters.refusals[name] for name in names if name in parameters.refusals)
            mission.ledger.note(index, (*mission.segments.notes[index], *reasons))
        return parameters.is_settled


FLYING_WITHIN_S: Final = 5.0
"""How long after its acceptance a start may take to show in a heartbeat."""
START_AGAIN_AFTER_S: Final = 1.0
ARM_AGAIN_AFTER_S: Final = 2.0


class Arming(Phase):
    """The vehicle is ordered to arm, for as long as its family needs."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._entered_at = 0.0
        self._again_at = 0.0
        self._is_noted = False

    @property
    def claim(self) -> Claim:
        """The mode in which it is armed is the broker's until it is left."""
        if self._mission.is_hovering:
            return HOVERING
        return Claim(AIRBORNE_MODES, mode=self._mission.authority.arming_mode, is_exclusive=True)

    def enter(self, now: float, effects: Effects) -> Result:
        """Order it."""
        self._entered_at, self._is_noted = now, False
        self._order_when_stored(now, effects)
        return None

    def _order_when_stored(self, now: float, effects: Effects) -> None:
        """Order it once the journal shows a restarted broker who has armed the vehicle."""
        vehicle = self._vehicle
        if not self._is_noted:
            self._mission.authority.order_arming(now)
        self._is_noted = not vehicle.recovery.is_stored
        if self._is_noted:
            return
        arming = vehicle.sequence(vehicle.family.arming, sends_until=self._mission.expires_at)
        self.run(arming, now, effects)

    def settle(self, outcome: Outcome, now: float) -> Result:
        """After a refusal that may pass order it again, unless it has expired; both after a pause.

        In the pause a heartbeat may show that the vehicle is armed, though its answer is lost.
        """
        if isinstance(outcome, Refused) and outcome.result is not None:
            self._vehicle.armed_period.refuse_arming()
            self._vehicle.recovery.arming_s = None
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
        return now - self._entered_at < self._vehicle.family.arming_retry_s

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
        self._order_when_stored(now, effects)
        return None


class Starting(Phase):
    """The vehicle is ordered to start; its heartbeat has to show that it flies."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
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
        self.run(self._vehicle.sequence(self._vehicle.family.starting), now, effects)

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Handle the answer; the vehicle then has `FLYING_WITHIN_S` to show that it flies."""
        match outcome:
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
