"""One mission on one vehicle, from the work item to its terminal report.

Drives the table of `session_states`: every state has at most one protocol running, whose outcome
is the event that leads on. Knows neither clock nor network.
"""

import logging
from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

from afarcloud import plan as documents
from afarcloud.enumerations import EventType, Status
from mavlink_broker import activities, readiness
from mavlink_broker.activities import Activity
from mavlink_broker.dialect import Message
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.ending import Ending, coming_home
from mavlink_broker.follower import Follower
from mavlink_broker.interruption import PATIENCE_S, REASONS, SoftAbort, SpeedOrders
from mavlink_broker.performer import Performer, Phase
from mavlink_broker.protocol.command import Accepted, Refused
from mavlink_broker.protocol.mission_upload import NotStored, Stored, Uncertain
from mavlink_broker.protocol.mission_verify import Different, Verified
from mavlink_broker.readiness import Attachment
from mavlink_broker.reporter import Reporter
from mavlink_broker.session_states import Event, State, follow
from mavlink_broker.stages import Stages
from mavlink_broker.translation.ledger import Ledger
from mavlink_broker.translation.mission import FlightPlan, LiveCommand, RefusedError
from mavlink_broker.translation.modes import ModeRole
from mavlink_broker.vehicle import Vehicle
from mavlink_broker.work import EventWork, MissionWork

FLYING_WITHIN_S: Final = 5.0
LAST_WORDS_S: Final = 0.5
"""How long a vehicle that refused something may take to say why."""

_LOG = logging.getLogger(__name__)
_BEFORE_TAKEOFF: Final = frozenset(
    {State.HOLDING, State.UPLOADING, State.VERIFYING, State.SELECTING, State.ARMING, State.STARTING}
)
_IN_FLIGHT: Final = frozenset({State.RUNNING, State.PERFORMING})
_AFTER_ACCEPTANCE: Final = {
    State.HOLDING: Event.HELD,
    State.SELECTING: Event.SELECTED,
    State.ARMING: Event.ARMED,
}


class Flight:
    """One mission."""

    def __init__(self, work: MissionWork, vehicle: Vehicle, reporter: Reporter) -> None:
        self.work = work
        self.state = State.IDLE
        self.ledger = Ledger(work.mission.mission_id, work.mission.command_array)
        self._vehicle = vehicle
        self._reporter = reporter
        self._hovering = False
        self._told_to_start = False
        self._flies_another = False  # Somebody else's mission; ours waits for the landing
        self._activity: Activity | None = None
        self._stages = Stages(work.mission, vehicle)
        self._follower: Follower | None = None
        self._performer: Performer | None = None
        self._speeds = SpeedOrders(vehicle)
        self._soft_abort: SoftAbort | None = None
        self._ending: Ending | None = None
        self._ending_work: int | None = None  # None: an alarm has ended the mission
        self._was_running = False  # An earlier run of the broker has seen it fly
        self._opaque_id = 0
        self._began_at = 0.0
        self._entered_at = 0.0
        self._accepted_at: float | None = None
        self._fault: tuple[str, int | None] = ("", None)

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle hovers afterwards: at the end, or still where it did before."""
        if self._ending is not None:
            return self._ending.leaves_hovering
        if self.ledger.status == Status.FINISHED:
            return not self._stages.ends_on_ground
        return self._hovering and not self._told_to_start

    def is_expired(self, now: float) -> bool:
        """Whether it may not be begun any more."""
        return self.work.expires_at is not None and now >= self.work.expires_at

    def begin(self, now: float, effects: Effects, *, hovering: bool, resumed: bool) -> None:
        """Take up the mission: from its start, or (`resumed`) from where an earlier run left it.

        `hovering` if the vehicle holds in the air where a mission of ours left it.
        """
        self._hovering = hovering
        self._began_at = now
        if self.work.report is not None:
            self.ledger.restore(self.work.report)
        self._was_running = self.ledger.status == Status.RUNNING
        self._move(Event.MISSION_RESUMED if resumed else Event.MISSION_TAKEN, now, effects)

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Take a message of the vehicle's autopilot."""
        if self._follower is not None:
            self._follower.receive(message)
        if self._performer is not None:
            effects.messages += self._performer.receive(message, now)
        if self._ending is not None:
            effects.messages += self._ending.receive(message, now)
        self._speeds.receive(message, now, effects)
        if self._activity is not None:
            effects.messages += self._activity.receive(message, now)
            self._settle(now, effects)

    def step(self, now: float, effects: Effects) -> None:
        """Let time pass."""
        if self._activity is not None:
            effects.messages += self._activity.tick(now)
            self._settle(now, effects)
        self._speeds.tick(now, effects)
        if self.state in _STEPS:
            _STEPS[self.state](self, now, effects)
        if self._soft_abort is not None:
            self._abort_softly(self._soft_abort, now, effects)

    def interrupt(self, work: EventWork, now: float, effects: Effects) -> None:
        """Carry out an event: abort now, abort behind the running command, or change the speed."""
        effects.for_edge.append(Acknowledgement(work.work_id, "accepted"))
        if work.event.maximum_speed is not None:
            self._stages.set_speed(work.event.maximum_speed)
            if self.state in _IN_FLIGHT:
                self._speeds.give(work, work.event.maximum_speed, now, effects)
            else:
                effects.for_edge.append(Acknowledgement(work.work_id, "done"))
        elif work.event.event_type_id is EventType.ABORT_MISSION:
            self._abort_now(work, now, effects)
        else:
            command = self.ledger.finished if self.state in _IN_FLIGHT else None
            patience = self._vehicle_time_s(now) + PATIENCE_S
            self._soft_abort = SoftAbort(work, command, patience)
            self._abort_softly(self._soft_abort, now, effects)

    def alarm(self, reason: str, now: float, effects: Effects) -> None:
        """Fail a mission that flies; the vehicle comes home, or lands if it cannot."""
        if self.state not in _IN_FLIGHT or not self._vehicle.snapshot.armed:
            return
        self.ledger.fail(reason)
        effects.for_edge.append(self._reporter.mission(self.ledger))
        if self._soft_abort is not None:
            work_id, self._soft_abort = self._soft_abort.work.work_id, None
            effects.for_edge.append(Acknowledgement(work_id, "done"))
        self._leave(coming_home(self._vehicle.vehicle_id), None, now, effects)

    def _leave(
        self, event: documents.Event, work_id: int | None, now: float, effects: Effects
    ) -> None:
        """Send the vehicle where the event says."""
        self._follower = self._performer = None
        self._ending, self._ending_work = Ending(event, self._vehicle), work_id
        self._move(Event.ABORTED, now, effects)
        effects.messages += self._ending.start(now)

    def _abort_softly(self, abort: SoftAbort, now: float, effects: Effects) -> None:
        statuses = self.ledger.commands
        ended = abort.command is not None and statuses[abort.command].is_terminal
        if self.state is State.IDLE:  # It came to its end meanwhile
            self._soft_abort = None
            effects.for_edge.append(Acknowledgement(abort.work.work_id, "done"))
        elif abort.is_due(command_ended=ended, now_s=self._vehicle_time_s(now)):
            self._abort_now(abort.work, now, effects)

    def _abort_now(self, work: EventWork, now: float, effects: Effects) -> None:
        """End the mission; a vehicle that is armed is told where to go."""
        self._soft_abort = None
        if self.state is State.UPLOADING:
            effects.messages.append(activities.cancellation(self._vehicle))
        if not self.ledger.status.is_terminal:
            self.ledger.abort(REASONS[work.event.event_type_id])
            effects.for_edge.append(self._reporter.mission(self.ledger))
        self._follower = self._performer = None
        self._acknowledge_ending(effects)
        if not self._vehicle.snapshot.armed:
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))
            self._move(Event.ENDED, now, effects)
            return
        self._leave(work.event, work.work_id, now, effects)

    def _acknowledge_ending(self, effects: Effects) -> None:
        """Say that an event has been carried out, once."""
        if self._ending is not None and self._ending_work is not None:
            effects.for_edge.append(Acknowledgement(self._ending_work, "done"))
            self._ending_work = None

    def _step_leaving(self, now: float, effects: Effects) -> None:
        if self._ending is None:
            return
        effects.messages += self._ending.tick(now)
        if self._ending.is_over:
            self._acknowledge_ending(effects)
            self._move(Event.ENDED, now, effects)

    def _vehicle_time_s(self, now: float) -> float:
        told = self._vehicle.snapshot.time_s
        return now if told is None else told

    def rebooted(self, now: float, effects: Effects) -> None:
        """Take that the vehicle was restarted."""
        preparing = self.state in _BEFORE_TAKEOFF
        flying = self.state in {State.RUNNING, State.PERFORMING}
        if flying or (preparing and self._hovering):
            self._fail("the vehicle was restarted", now, effects)
        elif preparing:
            self._move(Event.REBOOTED, now, effects)
        elif self.state is State.ATTACHING:
            self._activity = None

    def abort(self, reason: str, effects: Effects) -> None:
        """End a mission that has not taken off."""
        self.ledger.abort(reason)
        effects.for_edge.append(self._reporter.mission(self.ledger))

    def refuse(self, error: RefusedError, effects: Effects) -> None:
        """End a mission that cannot be flown, before anything is sent."""
        self.ledger.fail(error.reason, error.command_index)
        effects.for_edge.append(self._reporter.mission(self.ledger))

    def _move(self, event: Event, now: float, effects: Effects) -> None:
        before = self.state
        self.state = follow(before, event)
        mission_id = self.work.mission.mission_id
        names = before.name, event.name, self.state.name
        _LOG.info("mission %d: %s, %s -> %s", mission_id, *names)
        self._entered_at = now
        self._accepted_at = None
        self._activity = None
        if self.state in _ENTRIES:
            _ENTRIES[self.state](self, now, effects)

    def _start(self, activity: Activity, now: float, effects: Effects) -> None:
        self._activity = activity
        effects.messages += activity.start(now)

    def _fail(self, reason: str, now: float, effects: Effects, command: int | None = None) -> None:
        self._fault = reason, command
        self._follower = self._performer = None
        self._move(Event.FAULT, now, effects)

    def _settle(self, now: float, effects: Effects) -> None:
        """Turn the outcome of the state's protocol into what happens next."""
        match self._activity.outcome if self._activity else None:
            case Stored(opaque_id):
                self._opaque_id = opaque_id
                self._move(Event.STORED, now, effects)
            case Uncertain():
                self._opaque_id = 0
                self._move(Event.STORED, now, effects)
            case Verified() | Different() if self._is_between_stages:
                self._hovering = not self._vehicle.snapshot.is_on_ground
                self._was_running = False
                self._move(self._event_of_stage(), now, effects)
            case Verified():
                attaching = self.state is State.ATTACHING
                self._move(Event.FLYING if attaching else Event.VERIFIED, now, effects)
            case Accepted() if self.state in _AFTER_ACCEPTANCE:
                self._move(_AFTER_ACCEPTANCE[self.state], now, effects)
            case Accepted() if self._accepted_at is None:
                self._accepted_at = now
            case NotStored() as refusal:
                self._not_stored(refusal, now, effects)
            case Different() if self.state is State.ATTACHING and not self._has_flown:
                self._activity = None
                self._flies_another = True
            case Different(reason) | Refused(reason):
                self._fail(reason, now, effects)

    @property
    def _is_between_stages(self) -> bool:
        """Whether an earlier run ended behind one stage and before the next one flew."""
        if self.state is not State.ATTACHING or self._stages.is_first:
            return False
        begun = self.ledger.commands[self._plan.first_command] is not Status.NOT_STARTED
        same = isinstance(self._activity.outcome if self._activity else None, Verified)
        return not begun and not (same and self._vehicle.mode_role is ModeRole.MISSION)

    @property
    def _has_flown(self) -> bool:
        """Whether the mission has been reported to run."""
        return self.ledger.status != Status.NOT_STARTED

    @property
    def _plan(self) -> FlightPlan:
        """The stretch of items that is flown now."""
        return self._stages.plan

    def _not_stored(self, refusal: NotStored, now: float, effects: Effects) -> None:
        """Say otherwise what the vehicle does not know, if there is another way to say it."""
        item = refusal.item
        if item is None:
            self._fail(refusal.reason, now, effects)
        elif refusal.is_unsupported and self._stages.do_without(item):
            self._note_all()
            self._move(Event.REFUSED, now, effects)
        else:
            command = self._plan.command_of_item[item]
            self._fail(refusal.reason, now, effects, command)

    def _translate(self) -> None:
        self._stages.translate()
        self._note_all()

    def _note_all(self) -> None:
        for index, notes in enumerate(self._stages.notes):
            self.ledger.note(index, notes)

    def _next_stage(self, now: float, effects: Effects) -> None:
        """Go on behind a stretch or a live command, or end."""
        landed = self._stages.is_on_ground
        if self._soft_abort is not None and not self._stages.is_last:
            self._abort_now(self._soft_abort.work, now, effects)
            return
        if not self._stages.advance():
            self._follower = self._performer = None
            self._move(Event.ENDED, now, effects)
            return
        self._follower = self._performer = None
        self._was_running = False
        self._hovering = not landed
        self._move(self._event_of_stage(), now, effects)

    def _event_of_stage(self) -> Event:
        if isinstance(self._stages.current, LiveCommand):
            return Event.LIVE_NEXT
        return Event.ITEMS_NEXT if self._hovering else Event.GROUND_NEXT

    # What a state begins with.

    def _enter_holding(self, now: float, effects: Effects) -> None:
        ways = self._vehicle.family.holding
        self._start(activities.commands(ways, self._vehicle), now, effects)

    def _enter_uploading(self, now: float, effects: Effects) -> None:
        self._start(activities.upload(self._plan, self._vehicle), now, effects)

    def _enter_verifying(self, now: float, effects: Effects) -> None:
        proof = activities.verification(self._plan, self._vehicle, self._opaque_id)
        self._start(proof, now, effects)

    def _enter_selecting(self, now: float, effects: Effects) -> None:
        self._start(activities.selection(self._plan, self._vehicle), now, effects)

    def _enter_arming(self, now: float, effects: Effects) -> None:
        ways = self._vehicle.family.arming
        self._start(activities.commands(ways, self._vehicle), now, effects)

    def _enter_starting(self, now: float, effects: Effects) -> None:
        self._told_to_start = True
        ways = self._vehicle.family.starting
        self._start(activities.commands(ways, self._vehicle), now, effects)

    def _enter_running(self, now: float, effects: Effects) -> None:
        self._follower = Follower(
            self._plan,
            self.ledger,
            self._vehicle,
            self._reporter,
            resumed=self._was_running,
        )
        effects.for_edge += self._follower.begin(now)

    def _enter_performing(self, now: float, effects: Effects) -> None:
        live = self._stages.live
        resumed = self.ledger.commands[live.command] is Status.RUNNING
        self._performer = Performer(live.action, self._vehicle)
        effects.messages += self._performer.start(now, resumed=resumed)

    # What a state does as time passes.

    def _step_attaching(self, now: float, effects: Effects) -> None:
        if self._activity is not None:
            return
        waited_s = now - self._entered_at
        match readiness.attachment(self._vehicle, now, started=self._has_flown, waited_s=waited_s):
            case Attachment.BEGIN:
                self._move(Event.NOT_STARTED, now, effects)
            case Attachment.COMPARE if not self._flies_another:
                self._attach(now, effects)

    def _attach(self, now: float, effects: Effects) -> None:
        """Find the stage that was being flown; a live command shows in the vehicle's mode."""
        self._translate()
        self._stages.go_to(self.ledger.finished)
        if not isinstance(self._stages.current, LiveCommand):
            self._start(activities.recognition(self._plan, self._vehicle), now, effects)
            return
        self._hovering = True
        self._move(Event.LIVE_NEXT, now, effects)

    def _step_waiting(self, now: float, effects: Effects) -> None:
        if self.is_expired(now):
            self.abort("expired before take-off", effects)
            self._move(Event.ENDED, now, effects)
            return
        obstacle = readiness.obstacle(self._vehicle, now, hovering=self._hovering)
        if obstacle is None:
            self._set_out(now, effects)
        elif now - self._entered_at >= readiness.WITHIN_S:
            self._fail(f"not ready after {readiness.WITHIN_S:.0f} s: {obstacle}", now, effects)

    def _set_out(self, now: float, effects: Effects) -> None:
        try:
            self._translate()
        except RefusedError as error:
            self._fail(error.reason, now, effects, error.command_index)
            return
        flying = self._hovering and bool(self._vehicle.snapshot.armed)
        if not isinstance(self._stages.current, LiveCommand):
            self._move(Event.HOVERS if flying else Event.READY, now, effects)
        elif flying or not self._stages.live.action.moves:
            self._move(Event.LIVE_NEXT, now, effects)
        else:
            self._fail("the vehicle is on the ground: a take-off has to come first", now, effects)

    def _step_starting(self, now: float, effects: Effects) -> None:
        """Believe that it flies when it says so: armed, and in a mission mode."""
        if self._accepted_at is None:
            return
        vehicle = self._vehicle
        if vehicle.snapshot.armed and vehicle.mode_role is ModeRole.MISSION:
            self._move(Event.FLYING, now, effects)
        elif now - self._accepted_at > FLYING_WITHIN_S:
            self._fail(f"start accepted, but mode is {vehicle.mode}", now, effects)

    def _step_running(self, now: float, effects: Effects) -> None:
        if self._follower is None:
            return
        effects.for_edge += self._follower.step(now)
        if self._follower.is_finished:
            self._next_stage(now, effects)
        elif self._follower.departure is not None:
            self._fail(self._follower.departure, now, effects)

    def _step_performing(self, now: float, effects: Effects) -> None:
        performer = self._performer
        if performer is None:
            return
        effects.messages += performer.tick(now)
        index = self._stages.live.command
        if performer.has_begun:
            self._note_way(index, performer.note)
            if self._run(index):
                effects.for_edge.append(self._reporter.mission(self.ledger))
        if performer.phase is Phase.DONE:
            self.ledger.set_command(index, Status.FINISHED)
            effects.for_edge += self._reporter.results()
            if self._stages.is_last:
                self.ledger.set_mission(Status.FINISHED)
            effects.for_edge.append(self._reporter.mission(self.ledger))
            self._next_stage(now, effects)
        elif performer.phase is Phase.FAILED:
            self._fail(performer.reason, now, effects, index)

    def _run(self, index: int) -> bool:
        begins = self.ledger.set_mission(Status.RUNNING)
        return self.ledger.set_command(index, Status.RUNNING) or begins

    def _note_way(self, index: int, note: str | None) -> None:
        if note is not None:
            self.ledger.note(index, (*self._stages.notes[index], note))

    def _step_failing(self, now: float, effects: Effects) -> None:
        if now - self._entered_at < LAST_WORDS_S:
            return
        reason, command = self._fault
        words = self._vehicle.words_since(self._began_at)
        self.ledger.fail(f"{reason} ({words})" if words else reason, command)
        effects.for_edge.append(self._reporter.mission(self.ledger))
        self._move(Event.ENDED, now, effects)


_Handler: TypeAlias = Callable[[Flight, float, Effects], None]

# The class's own tables, below it because they hold its functions.
_ENTRIES: Final[Mapping[State, _Handler]] = {
    State.HOLDING: Flight._enter_holding,  # noqa: SLF001
    State.UPLOADING: Flight._enter_uploading,  # noqa: SLF001
    State.VERIFYING: Flight._enter_verifying,  # noqa: SLF001
    State.SELECTING: Flight._enter_selecting,  # noqa: SLF001
    State.ARMING: Flight._enter_arming,  # noqa: SLF001
    State.STARTING: Flight._enter_starting,  # noqa: SLF001
    State.RUNNING: Flight._enter_running,  # noqa: SLF001
    State.PERFORMING: Flight._enter_performing,  # noqa: SLF001
}

_STEPS: Final[Mapping[State, _Handler]] = {
    State.ATTACHING: Flight._step_attaching,  # noqa: SLF001
    State.WAITING: Flight._step_waiting,  # noqa: SLF001
    State.STARTING: Flight._step_starting,  # noqa: SLF001
    State.RUNNING: Flight._step_running,  # noqa: SLF001
    State.PERFORMING: Flight._step_performing,  # noqa: SLF001
    State.LEAVING: Flight._step_leaving,  # noqa: SLF001
    State.FAILING: Flight._step_failing,  # noqa: SLF001
}
