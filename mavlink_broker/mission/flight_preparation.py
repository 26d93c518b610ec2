"""One mission up to its flight: waited for, uploaded, proved, armed, started."""

import logging
from typing import Final

from afarcloud.commands import FLYING
from afarcloud.enumerations import CommandType, Status
from afarcloud.route import highest_m as highest_of
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.microservices.command import Accepted, Refused
from mavlink_broker.microservices.mission_upload import NotStored, Stored, Uncertain
from mavlink_broker.microservices.mission_verify import Different, Verified
from mavlink_broker.mission import activities
from mavlink_broker.mission.flight_core import FlightCore
from mavlink_broker.mission.geofence_transfer import Fencing, Wanted
from mavlink_broker.mission.states import Event, State
from mavlink_broker.planning.geofence import rally_items
from mavlink_broker.planning.geofence_check import as_flown
from mavlink_broker.planning.mission import LiveCommand, RefusedError
from mavlink_broker.planning.situation import Spot
from mavlink_broker.vehicle import hover, prearm

FLYING_WITHIN_S: Final = 5.0
LOGGED_AFTER_S: Final = 3.0
"""How long a mission waits before its upload until the log names what for."""
START_AGAIN_AFTER_S: Final = 1.0
ARM_AGAIN_AFTER_S: Final = 2.0
MODE_EVERY_S: Final = 2.0
"""Longer than a mode takes to show."""
WHY_EVERY_S: Final = 14.0
"""Less often than what a vehicle waits for by itself, and often enough for its newest reason."""
_LOG = logging.getLogger(__name__)
_AFTER_ACCEPTANCE: Final = {
    State.FENCING: Event.FENCED,
    State.HOLDING: Event.HELD,
    State.SELECTING: Event.SELECTED,
    State.ARMING: Event.ARMED,
}


class FlightPreparation(FlightCore):
    """The states from WAITING to STARTING."""

    def _settle(self, now: float, effects: Effects) -> None:
        """Turn the outcome of the state's protocol into what happens next."""
        match self._activity.outcome if self._activity else None:
            case Stored(opaque_id):
                self._opaque_id = opaque_id
                self._move(Event.STORED, now, effects)
            case Uncertain():
                self._opaque_id = 0
                self._move(Event.STORED, now, effects)
            case Verified():
                self._move(Event.VERIFIED, now, effects)
            case Accepted() if self.state in _AFTER_ACCEPTANCE:
                self._accepted(_AFTER_ACCEPTANCE[self.state], now, effects)
            case Accepted() if self._accepted_at is None:
                self._accepted_at = now
            case NotStored() as refusal:
                self._not_stored(refusal, now, effects)
            case Refused() if self._may_still_arm(now):
                self._activity = None
                self._arm_again_at = now + ARM_AGAIN_AFTER_S
            case Different(reason) | Refused(reason):
                self._fail(reason, now, effects)

    def _not_stored(self, refusal: NotStored, now: float, effects: Effects) -> None:
        """Say otherwise what the vehicle does not know, if there is another way to say it."""
        item = refusal.item
        if item is None and refusal.is_too_long and self._stages.shorten():
            self._note_all()
            part = len(self._plan.items)
            self.ledger.remark((f"flown in parts of up to {part} items: {refusal.reason}",))
            self._move(Event.REFUSED, now, effects)
        elif item is None:
            self._fail(refusal.reason, now, effects)
        elif refusal.is_unsupported and self._stages.do_without(item):
            self._note_all()
            is_live = isinstance(self._stages.current, LiveCommand)
            self._move(Event.LIVE_NEXT if is_live else Event.REFUSED, now, effects)
        else:
            command = self._plan.command_of_item[item]
            self._fail(refusal.reason, now, effects, command)

    def _enter_fencing(self, now: float, effects: Effects) -> None:
        """Put the fence there, once for the whole mission; give an earlier plan's back."""
        self._fencing = Fencing(self._wanted_fence(), self._vehicle)
        if self._is_fenced or self._fencing.is_needless:
            self._go_on(now, effects)
            return
        self._start(self._fencing, now, effects)
        self._settle(now, effects)

    def _wanted_fence(self) -> Wanted:
        highest_m = highest_of(as_flown(self.work.mission.command_array, self._vehicle.family))
        rally = rally_items(self.work.rally_points)
        return Wanted(self.work.geofence, rally, highest_m=highest_m)

    def _accepted(self, event: Event, now: float, effects: Effects) -> None:
        if event is Event.FENCED:
            self._fenced(now, effects)
        elif event is not Event.SELECTED or self._has_borrowed():
            self._move(event, now, effects)

    def _has_borrowed(self) -> bool:
        """Whether the vehicle has the parameters that the stretch needs, or keeps its own."""
        parameters = self._vehicle.parameters
        for index in {index for index, _ in self._plan.loans} if parameters.refusals else ():
            names = (loan[0].name for owner, loan in self._plan.loans if owner == index)
            told = (parameters.refusals[name] for name in names if name in parameters.refusals)
            self.ledger.note(index, (*self._stages.notes[index], *told))
        return parameters.is_settled

    def _fenced(self, now: float, effects: Effects) -> None:
        """Go on within the fence, unless the vehicle keeps a lower one of its own."""
        self._is_fenced = True
        if self._fencing is not None:
            self.ledger.remark(self._fencing.notes)
            try:
                self._check_area(own_limit_m=self._fencing.own_limit_m)
            except RefusedError as error:
                self._fail(error.reason, now, effects, error.command_index)
                return
        self._go_on(now, effects)

    def _go_on(self, now: float, effects: Effects) -> None:
        """Fly the stage that comes: by items from the ground, by items from a hover, or live."""
        if isinstance(self._stages.current, LiveCommand):
            self._move(Event.LIVE_NEXT, now, effects)
        else:
            self._move(Event.HOVERS if self._flies else Event.FENCED, now, effects)

    @property
    def _flies(self) -> bool:
        return self._hovering and bool(self._vehicle.snapshot.armed)

    def _check_area(self, own_limit_m: float | None = None) -> None:
        """Hold the mission against its geofence, from where the vehicle is.

        Raises:
            RefusedError: for the first command that leads out.
        """
        if self._area is None or self._stages.itinerary is None or not self._stages.is_first:
            return
        place = self._vehicle.snapshot.position
        start = None if place is None else Spot(*place[:3])
        self._area.check(
            self.work.mission,
            self._vehicle.family,
            start=start,
            home=self._vehicle.snapshot.home,
            rally=self.work.rally_spots,
            own_limit_m=own_limit_m,
        )

    def _enter_holding(self, now: float, effects: Effects) -> None:
        ways = self._vehicle.family.holding
        self._start(activities.commands(ways, self._vehicle), now, effects)

    def _enter_uploading(self, now: float, effects: Effects) -> None:
        self._vehicle.borrow(tuple(loan for _, loan in self._plan.loans))
        self._start(activities.upload(self._plan, self._vehicle), now, effects)

    def _enter_verifying(self, now: float, effects: Effects) -> None:
        proof = activities.verification(self._plan, self._vehicle, self._opaque_id)
        self._start(proof, now, effects)

    def _enter_selecting(self, now: float, effects: Effects) -> None:
        self._start(activities.selection(self._plan, self._vehicle), now, effects)

    def _enter_arming(self, now: float, effects: Effects) -> None:
        self._activity = None
        if not self.is_confirmed:
            self._entered_at = now  # Its patience begins when it may arm
            return
        ways = self._vehicle.family.arming
        self._is_arming_ordered = not self._vehicle.snapshot.armed
        self._start(activities.commands(ways, self._vehicle), now, effects)

    def _may_still_arm(self, now: float) -> bool:
        """Whether a refusal to arm may pass; it is judged by the vehicle itself, and says why."""
        waited_s = now - self._entered_at
        return self.state is State.ARMING and waited_s < self._vehicle.family.arming_patience_s

    def _enter_starting(self, now: float, effects: Effects) -> None:
        """Write down that the stage runs before the vehicle is told to start it.

        A broker that is killed meanwhile would not know that it may have been flown: its report
        may still be waiting for the edge server.
        """
        self._told_to_start = True
        hover.end(self._vehicle)
        self.ledger.set_mission(Status.RUNNING)
        self.ledger.set_command(self._plan.first_command, Status.RUNNING)
        effects.for_edge.append(self._reporter.mission(self.ledger))
        self._was_in_mission_mode = self._vehicle.mode_role is ModeRole.MISSION
        self._vehicle.started = self.ledger.name_of(self._plan.first_command)
        self._start_when_noted(now, effects)

    def _start_when_noted(self, now: float, effects: Effects) -> None:
        if not self._vehicle.is_noted:
            return
        self._start_again_at = now + START_AGAIN_AFTER_S
        ways = self._vehicle.family.starting
        self._start(activities.commands(ways, self._vehicle), now, effects)

    def _step_waiting(self, now: float, effects: Effects) -> None:
        if self.is_expired(now):
            self.abort("expired before take-off", effects)
            self._move(Event.ENDED, now, effects)
            return
        waited_s = now - self._entered_at
        self._hovering |= self._vehicle.hovers  # It may not have been heard when this began
        obstacle = prearm.obstacle(self._vehicle, now, hovering=self._hovering, waited_s=waited_s)
        self._log_obstacle(obstacle, waited_s)
        if obstacle is None:
            if self.is_confirmed or not self._acts_at_once:
                self._set_out(now, effects)
            return
        self._ask_why_not(now, effects)
        if prearm.wants_another_mode(self._vehicle) and now >= self._mode_asked_at + MODE_EVERY_S:
            self._mode_asked_at = now
            effects.messages.append(activities.hold_on_ground(self._vehicle))
        if waited_s >= prearm.WITHIN_S:
            self._fail(f"not ready after {prearm.WITHIN_S:.0f} s: {obstacle}", now, effects)

    def _log_obstacle(self, obstacle: str | None, waited_s: float) -> None:
        """Log what a mission waits for, once it has waited, and whenever that changes."""
        if obstacle == self._obstacle or (obstacle is not None and waited_s < LOGGED_AFTER_S):
            return
        number, vehicle_id = self.work.mission.mission_id, self._vehicle.vehicle_id
        if obstacle is None:
            _LOG.info("mission %d goes on after %.0f s", number, waited_s)
        else:
            _LOG.warning("mission %d waits for vehicle %d: %s", number, vehicle_id, obstacle)
        self._obstacle = obstacle

    @property
    def _acts_at_once(self) -> bool:
        """Whether the vehicle does something before it is armed: one that hovers, or a camera.

        What nobody but us knows of must not be done; a transfer to a vehicle that stands may.
        """
        is_live = isinstance(self._stages.current, LiveCommand)
        return is_live or self._hovering

    def _ask_why_not(self, now: float, effects: Effects) -> None:
        """Have a vehicle that is not ready to arm say why: most told it before we listened."""
        is_ready = self._vehicle.ready_to_arm is not False or bool(self._vehicle.snapshot.armed)
        if is_ready or now - max(self._why_asked_at, self._entered_at) < WHY_EVERY_S:
            return
        self._why_asked_at = now
        effects.messages.append(activities.arming_checks(self._vehicle))

    def _set_out(self, now: float, effects: Effects) -> None:
        try:
            self._translate()
            self._check_area()
        except RefusedError as error:
            self._fail(error.reason, now, effects, error.command_index)
            return
        is_live = isinstance(self._stages.current, LiveCommand)
        if self._acts_at_once and not self.is_confirmed:
            return
        moves = self._stages.live.action.moves if is_live else self._begins_in_the_air
        if moves and not self._flies:
            self._fail("the vehicle is on the ground: a take-off has to come first", now, effects)
        else:
            self._move(Event.READY, now, effects)

    @property
    def _begins_in_the_air(self) -> bool:
        """Whether the mission begins with a landing or a return, which is for a hover."""
        kinds = (one.command_type_id for one in self.work.mission.command_array)
        first = next((kind for kind in kinds if kind in FLYING), None)
        is_for_air = first in {CommandType.NAV_LAND, CommandType.NAV_HOME}
        return is_for_air and self._stages.is_first and not self._vehicle.stays_on_ground

    def _step_arming(self, now: float, effects: Effects) -> None:
        """Believe a vehicle that shows itself armed, though its answer is lost.

        It disarms again by itself, mostly after 10 s, if it is not started until then.
        """
        if self._vehicle.snapshot.armed and not self._hovering and self.is_confirmed:
            self._move(Event.ARMED, now, effects)
        elif self._activity is None and now >= self._arm_again_at:
            self._enter_arming(now, effects)

    def _step_starting(self, now: float, effects: Effects) -> None:
        """Take it to fly when its heartbeat shows that: armed, and in a mission mode.

        A mode that it has taken since the order to start proves as much as its answer. PX4 leaves
        the mission mode for an item that returns before a heartbeat has shown it.
        """
        if self._activity is None:
            self._start_when_noted(now, effects)
            return
        vehicle, accepted_at = self._vehicle, self._accepted_at
        roles = {ModeRole.MISSION}
        if self._hovering and self._plan.comes_down_at_once:
            roles.add(ModeRole.ENDING)
        flies = bool(vehicle.snapshot.armed) and vehicle.mode_role in roles
        if flies and (accepted_at is not None or not self._was_in_mission_mode):
            self._move(Event.FLYING, now, effects)
        elif accepted_at is None:
            self._hurry(now, effects)
        elif not vehicle.snapshot.armed and now - accepted_at > FLYING_WITHIN_S:
            self._fail("start accepted, but the vehicle is disarmed", now, effects)
        elif now - accepted_at > FLYING_WITHIN_S:
            self._fail(f"start accepted, but mode is {vehicle.mode}", now, effects)

    def _hurry(self, now: float, effects: Effects) -> None:
        """Over a slow link say it again before the answer can be there: the time is short."""
        if now >= self._start_again_at and self._vehicle.round_trip.timeout_s > START_AGAIN_AFTER_S:
            self._start_again_at = now + START_AGAIN_AFTER_S
            starting = self._vehicle.family.starting
            effects.messages.append(activities.repetition(starting, self._vehicle))
