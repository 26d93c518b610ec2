"""What all phases of one mission on one vehicle share: its state, its stages, its ledger.

Drives the table of `states`: every state has at most one protocol running, whose outcome
is the event that leads on. Knows neither clock nor network.
"""

import logging
import math
from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.families import Family
from mavlink_broker.edge.work import MissionWork
from mavlink_broker.effects import Effects
from mavlink_broker.live.executor import Performer
from mavlink_broker.microservices.heartbeat import LinkState
from mavlink_broker.mission import activities
from mavlink_broker.mission.activities import Activity
from mavlink_broker.mission.geofence_transfer import Fencing
from mavlink_broker.mission.progress_monitor import Follower
from mavlink_broker.mission.segments import Stages
from mavlink_broker.mission.states import BEFORE_TAKEOFF, Event, State, follow
from mavlink_broker.planning.geofence_check import AreaCheck
from mavlink_broker.planning.mission import (
    FlightPlan,
    LiveCommand,
    RefusedError,
)
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.alarms import is_navigation_failure, mission_error
from mavlink_broker.vehicle.control_authority import ON_THE_WAY, Claim, InCommand
from mavlink_broker.vehicle.mission_ledger import Ledger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

_ASKING: Final = BEFORE_TAKEOFF | {State.PERFORMING}
"""States in which the vehicle is asked for something, so that a link that is away shows as no."""
MOST_LOOKS: Final = 5
"""How often a mission may begin such a state again: links come and go, but not for ever."""
_ARMED_BY_US: Final = frozenset({State.ARMING, State.STARTING})
_COMING_DOWN: Final = Claim(control_authority.COMING_DOWN)
_STANDING: Final = Claim(frozenset(), may_be_armed=False)
_WAITING_IN_THE_AIR: Final = Claim(ON_THE_WAY, is_exclusive=True)
LAST_WORDS_S: Final = 0.5
"""How long a vehicle that refused something may take to say why."""
Handler: TypeAlias = Callable[[float, Effects], None]

_LOG = logging.getLogger(__name__)


class FlightCore:
    """One mission, without what its phases do."""

    def __init__(self, work: MissionWork, vehicle: Vehicle, reporter: Reporter) -> None:
        self.work = work
        self.state = State.IDLE
        mission = work.mission
        self.ledger = Ledger(
            mission.mission_id,
            mission.command_array,
            name=work.name,
            work_id=work.work_id,
            plan_id=work.plan_ulid,
        )
        self.is_confirmed = work.was_accepted  # The edge server knows that we fly it
        self._vehicle = vehicle
        self._reporter = reporter
        self._hovering = False
        self._told_to_start = False
        self._was_in_mission_mode = False  # When it was told to start
        self._start_again_at = 0.0
        self._arm_again_at = 0.0
        self._is_arming_ordered = False  # And no heartbeat has shown the vehicle armed since
        self._flies_another = False  # Somebody else's mission; ours waits for the landing
        self._activity: Activity | None = None
        self._stages = Stages(work.mission, vehicle)
        self._follower: Follower | None = None
        self._performer: Performer | None = None
        self._looks = 0  # So often the link was away when something was asked
        self._saw_others = False  # Somebody else had the vehicle while its mission was looked for
        self._armed_in: str | None = None  # Mode in which the vehicle is armed, until it is left
        self._part_guesses = 0  # At the parts that it was given in
        self._whole_items = 0  # Of its longest stretch, unparted; 0: not counted yet
        self._guesses = 0  # At what the vehicle refused in an earlier run of the broker
        self._was_running = False  # An earlier run of the broker has seen it fly
        self._area = None if work.geofence is None else AreaCheck(work.geofence)
        self._fencing: Fencing | None = None
        self._is_fenced = False  # Once for the whole mission
        self._opaque_id = 0
        self._mode_asked_at = -math.inf  # Of a vehicle that is not ready in the mode that it is in
        self._why_asked_at = -math.inf
        self._obstacle: str | None = None  # That was logged last, while it waits
        self._began_at = 0.0
        self._heard_at: float | None = None  # Its vehicle, for the first time since it is attached
        self._entered_at = 0.0
        self._accepted_at: float | None = None
        self._fault: tuple[str, int | None] = ("", None)
        self._stops_propellers = False  # They turn because we armed it, and it does not take off
        self._is_alarming = False
        self._is_left_to_failsafe = False
        self._waits_for_orders = False  # It failed in the air, and nobody else flies it
        self._entries: Mapping[State, Handler] = {}  # What a state begins with
        self._steps: Mapping[State, Handler] = {}  # What it does as time passes

    @property
    def has_failed_in_flight(self) -> bool:
        """Whether it was flown, and ended otherwise than it was meant to."""
        was_flown = self._told_to_start or self._was_running
        return was_flown and self.ledger.status in {Status.FAILED, Status.ABORTED}

    def is_expired(self, now: float) -> bool:
        """Whether it may not be begun any more."""
        return self.work.expires_at is not None and now >= self.work.expires_at

    def check_area(self, family: Family) -> None:
        """Hold a mission against its geofence before anything is known of its vehicle.

        One that an earlier run of the broker accepted may be flying: it is not judged anew.

        Raises:
            RefusedError: for the first command that leads out.
        """
        if self._area is not None and not self.work.was_accepted:
            self._area.check(
                self.work.mission, family, start=None, home=None, rally=self.work.rally_spots
            )

    def abort(self, reason: str, effects: Effects) -> None:
        """End a mission that has not taken off."""
        self.ledger.abort(reason)
        effects.for_edge.append(self._reporter.mission(self.ledger))

    def fail_again(self, reason: str, now: float, effects: Effects) -> None:
        """Tell of a failure that an earlier run has seen, and may not have told of."""
        if self.state is State.ATTACHING:
            self._move(Event.ENDED, now, effects)
        elif self.work.report is not None:
            self.ledger.restore(self.work.report)
        self.ledger.fail(reason)
        effects.for_edge.append(self._reporter.mission(self.ledger))

    def refuse(self, error: RefusedError, effects: Effects) -> None:
        """End a mission that cannot be flown, before anything is sent."""
        self.ledger.fail(error.reason, error.command_index)
        effects.for_edge.append(self._reporter.mission(self.ledger))

    @property
    def _has_flown(self) -> bool:
        """Whether the mission has been reported to run."""
        return self.ledger.status != Status.NOT_STARTED

    @property
    def _plan(self) -> FlightPlan:
        """The stretch of items that is flown now."""
        return self._stages.plan

    @property
    def _claim(self) -> Claim | None:
        """Modes in which the broker is in command in this state; None: it orders nothing."""
        claim = None
        match self.state:
            case State.RUNNING if self._follower is not None:
                claim = self._follower.claim
            case State.PERFORMING if self._performer is not None and self._hovering:
                claim = self._performer.claim
            case State.WAITING if not self._hovering:
                claim = _COMING_DOWN if self._told_to_start else _STANDING
            case State.ATTACHING:
                claim = _WAITING_IN_THE_AIR if self._saw_others else _COMING_DOWN
            case State.ARMING | State.STARTING if not self._hovering:
                claim = Claim(ON_THE_WAY, mode=self._armed_in, is_exclusive=True)
            case State.STARTING if self._plan.comes_down_at_once:
                claim = Claim(control_authority.COMING_DOWN, is_exclusive=True)
            case State.FAILING if self._stops_propellers:
                claim = Claim(ON_THE_WAY, mode=self._armed_in)
            case state if state in BEFORE_TAKEOFF | {State.WAITING}:
                claim = _WAITING_IN_THE_AIR if self._hovering else _STANDING
        return claim

    @property
    def _who(self) -> InCommand:
        """Who is in command of the vehicle now."""
        claim = self._claim
        if claim is None:
            return InCommand.BROKER
        return control_authority.in_command(self._vehicle.seen, claim)

    @property
    def _is_taken_away(self) -> bool:
        """Whether its own failsafe or somebody else has a vehicle that waits for its next order."""
        seen = self._vehicle.seen
        return control_authority.in_command(seen, _WAITING_IN_THE_AIR) is not InCommand.BROKER

    @property
    def _departure(self) -> str:
        seen = self._vehicle.seen
        return control_authority.reason(
            control_authority.in_command(seen, _WAITING_IN_THE_AIR), seen
        )

    def _yields(self, now: float, effects: Effects) -> bool:
        """Fail at once when somebody else takes the vehicle; whether no order may be given.

        While items fly the follower judges whether the mission has ended: a pilot may have it
        back in its mission within seconds. On the ground it waits for who has armed it.
        """
        self._see_mode_of_arming()
        who = self._who
        if who is InCommand.BROKER:
            self._saw_others &= bool(self._vehicle.snapshot.armed)
            return False
        self._saw_others |= self.state is State.ATTACHING
        if self.state in BEFORE_TAKEOFF | {State.PERFORMING} or self._hovers_waiting:
            self._fail_surely(control_authority.reason(who, self._vehicle.seen), now, effects)
        return True

    def _see_mode_of_arming(self) -> None:
        """Learn in which mode the vehicle is armed: that one is ours until it is left."""
        seen = self._vehicle.seen
        self._is_arming_ordered &= not seen.armed
        if not seen.armed:
            self._armed_in = seen.mode
        elif seen.mode != self._armed_in:
            self._armed_in = None

    @property
    def _hovers_waiting(self) -> bool:
        return self.state is State.WAITING and self._hovering

    def _event_of_stage(self) -> Event:
        if isinstance(self._stages.current, LiveCommand):
            return Event.LIVE_NEXT
        return Event.ITEMS_NEXT if self._hovering else Event.GROUND_NEXT

    def _translate(self) -> None:
        self._stages.translate()
        self._note_all()

    def _note_all(self) -> None:
        for index, notes in enumerate(self._stages.notes):
            if not self.ledger.commands[index].is_terminal:
                self.ledger.note(index, notes)

    def _move(self, event: Event, now: float, effects: Effects) -> None:
        before = self.state
        self.state = follow(before, event)
        mission_id = self.work.mission.mission_id
        names = before.name, event.name, self.state.name
        _LOG.info("mission %d: %s, %s -> %s", mission_id, *names)
        self._entered_at = now
        self._accepted_at = None
        self._activity = None
        if self.state in self._entries:
            self._entries[self.state](now, effects)

    def _start(self, activity: Activity, now: float, effects: Effects) -> None:
        self._activity = activity
        effects.messages += activity.start(now)

    def _fail(self, reason: str, now: float, effects: Effects, command: int | None = None) -> None:
        """Fail the mission, unless nothing but a link that is away speaks against it."""
        if self._is_unheard(now):
            self._look_again(now, effects)
        else:
            self._fail_surely(reason, now, effects, command)

    def _is_unheard(self, now: float) -> bool:
        is_away = self._vehicle.link.state(now) is not LinkState.CONNECTED
        return self.state in _ASKING and is_away and self._looks < MOST_LOOKS

    def _look_again(self, now: float, effects: Effects) -> None:
        """Wait for the vehicle, as a restarted broker does, and see how far it has come."""
        self._looks += 1
        self._was_running = self._has_flown
        self._heard_at = None
        self._flies_another = False
        self._follower = self._performer = None
        self._move(Event.UNHEARD, now, effects)

    def _fail_surely(
        self, reason: str, now: float, effects: Effects, command: int | None = None
    ) -> None:
        self._fault = reason, command
        is_taken = self._who is not InCommand.BROKER
        departed = self._performer is not None and self._performer.has_departed
        self._vehicle.is_taken |= is_taken or (departed and bool(self._vehicle.snapshot.armed))
        armed_by_us = self.state in _ARMED_BY_US and not self._hovering
        self._stops_propellers = armed_by_us and not is_taken
        if self._stops_propellers:
            effects.messages += activities.disarming(self._vehicle)
        self._is_alarming = self._vehicle_cannot_go_on()
        held = self._vehicle.is_held_by_failsafe
        self._is_left_to_failsafe = held or self._who is InCommand.FAILSAFE
        gives_up = self._follower is not None and self._follower.has_given_up
        is_begun = self._hovering and self._has_flown  # Else it is left to the next mission
        waits = self.state in _ASKING and is_begun and not departed
        self._waits_for_orders = (waits or gives_up) and not is_taken
        self._follower = self._performer = None
        self._move(Event.FAULT, now, effects)

    def _vehicle_cannot_go_on(self) -> bool:
        """Whether the mission itself has gone wrong in flight: an alarm, by the table of alarms.

        What a failsafe does is none (its cause may be one), nor is what somebody else does.
        """
        in_flight = self.state in {State.RUNNING, State.PERFORMING}
        held = self._vehicle.is_held_by_failsafe
        return in_flight and self._who is InCommand.BROKER and not held

    def _step_failing(self, now: float, effects: Effects) -> None:
        if now - self._entered_at < LAST_WORDS_S:
            return
        if self._stops_propellers and self._who is InCommand.BROKER:
            effects.messages += activities.disarming(self._vehicle)  # The first may be lost
        reason, command = self._fault
        words = self._vehicle.words_since(self._began_at)
        text = f"{reason} ({words})" if words else reason
        if self._is_alarming or (self._is_left_to_failsafe and is_navigation_failure(words or "")):
            alarm = self._reporter.alarm(mission_error(text), self.work.mission.mission_id)
            effects.for_edge.append(alarm)
        self.ledger.fail(text, command)
        effects.for_edge.append(self._reporter.mission(self.ledger))
        self._leave_failed(now, effects)

    def _leave_failed(self, now: float, effects: Effects) -> None:
        """Have done with a mission that has failed."""
        self._move(Event.ENDED, now, effects)
