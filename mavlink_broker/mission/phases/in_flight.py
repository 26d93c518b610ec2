"""RUNNING, FLYING_LIVE: the vehicle flies mission items, or the broker flies one command live.

The broker follows and reports the progress of mission items. Commands are flown live between
segments of mission items: an event that pauses the mission ends one that moves the vehicle, and
when the mission is resumed it begins anew. A command that does not move the vehicle goes on to its
end.
"""

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.flight_modes import LIVE_MODES, ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.live.executor import LiveCommandExecutor, LivePhase
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.context import PROGRESS_WITHIN_S, MissionContext, SegmentMonitors
from mavlink_broker.mission.integrity import MissionChangeMonitor
from mavlink_broker.mission.phases.phase import Fault, Phase, Request, Result
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import (
    AIRBORNE,
    AIRBORNE_MODES,
    DISARMED,
    LEFT_MISSION,
    TAKEOVER_AFTER_S,
    Authority,
    Claim,
)


class Running(Phase):
    """One segment of mission items in flight."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self.monitors: SegmentMonitors | None = None
        """What follows the items; None in another phase."""
        self._paused_at: float | None = None
        self._is_pause_reported = False
        self._entered_at = 0.0

    @property
    def claim(self) -> Claim | None:
        """Modes in which the vehicle flies the mission."""
        return None if self.monitors is None else self.monitors.progress.claim

    @property
    def has_items(self) -> bool:
        """Whether items of the segment are still to be flown."""
        return self.monitors is not None and not self.monitors.progress.is_finished

    @property
    def landed_by(self) -> Authority | None:
        """Who else had the vehicle when it was disarmed; None: nobody."""
        return None if self.monitors is None else self.monitors.progress.landed_by

    @property
    def was_given_up(self) -> bool:
        """Whether the vehicle has given up the mission, and waits where it is."""
        return self.monitors is not None and self.monitors.progress.has_given_up

    @property
    def flies_another(self) -> bool:
        """Whether the vehicle flies the mission of another system."""
        if self.monitors is None or self._vehicle.mode_role is not ModeRole.MISSION:
            return False
        return self.monitors.progress.holds_another or self.monitors.changes.holds_another

    def is_progress_unknown(self, now: float) -> bool:
        """Whether a vehicle that flew before it was followed has not sent its progress since."""
        lacks_progress = self.monitors is not None and self.monitors.progress.lacks_progress
        return lacks_progress and now - self._entered_at < PROGRESS_WITHIN_S

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin to follow the segment."""
        mission, vehicle = self._mission, self._vehicle
        self._paused_at, self._is_pause_reported, self._entered_at = None, False, now
        self.monitors = SegmentMonitors.of(mission)
        effects.for_edge += self.monitors.progress.begin(now)
        if vehicle.snapshot.armed:
            vehicle.recovery.note_flying(mission.ledger.name_of(mission.plan.first_command))
        return None

    def leave(self) -> None:
        """Stop following it."""
        self.monitors = None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message about the mission."""
        if self.monitors is not None:
            self.monitors.receive(message, now, effects)

    def tick(self, now: float, effects: Effects) -> Result:
        """Report progress; the segment ends, or another system has ended it."""
        mission = self._mission
        if self.monitors is None:
            return None
        progress, changes, _ = self.monitors
        self.monitors.abort_skipped(mission.ledger)
        last = mission.plan.commands[-1]
        if progress.is_finished and mission.captures.are_pending(last, now, effects):
            return Fault(mission.authority.loss_reason, last) if mission.authority.is_lost else None
        self._observe_pause(now, effects)
        effects.for_edge += progress.step(now)
        if self._flies_on and mission.authority.who(self.claim) is Authority.BROKER:
            mission.speeds.repeat(now, effects)
        if progress.is_finished:
            return self._await_resumption() if mission.is_held_back else Request.NEXT_SEGMENT
        self._observe_changes(changes, now, effects)
        reason = progress.loss_reason or changes.loss_reason
        return None if reason is None else Fault(reason)

    @property
    def _flies_on(self) -> bool:
        """Whether the vehicle flies its items, and holds for nobody."""
        vehicle = self._vehicle
        in_mission = vehicle.mode_role is ModeRole.MISSION or not vehicle.family.knows_modes
        return bool(vehicle.snapshot.armed) and in_mission and vehicle.foreign_order is None

    def _await_resumption(self) -> Result:
        """Wait behind the last item until the mission is resumed, if the vehicle still hovers."""
        mission = self._mission
        if mission.segments.is_on_ground:
            return None
        if mission.vehicle.snapshot.armed is False:
            return Fault(DISARMED)
        who = mission.authority.who(AIRBORNE)
        return None if who is Authority.BROKER else Fault(mission.authority.reason(who))

    def _observe_pause(self, now: float, effects: Effects) -> None:
        """Report that another system has paused the vehicle.

        The vehicle stays where it is until whoever paused it resumes the mission, also if an event
        had paused it before: a restarted broker without its journal knows that by the report. PX4
        also holds at the end of a mission, mostly before its last report of progress.
        """
        vehicle, ledger = self._vehicle, self._mission.ledger
        holds = vehicle.mode_role in {ModeRole.HOLD, ModeRole.PAUSED} and vehicle.family.knows_modes
        is_own = self._mission.pauses.is_paused and vehicle.foreign_order is None
        is_explained = is_own or vehicle.is_held_by_failsafe
        if not holds or not vehicle.snapshot.armed or is_explained:
            self._paused_at, self._is_pause_reported = None, False
            return
        self._paused_at = self._paused_at or now
        if now - self._paused_at >= TAKEOVER_AFTER_S and not self._is_pause_reported:
            self._is_pause_reported = True
            last = len(ledger.commands) - 1
            ledger.add_note(min(ledger.finished, last), self.pause)
            self._mission.report(effects)

    @property
    def pause(self) -> str:
        """Name who has paused the vehicle, as far as that is known."""
        order = self._vehicle.foreign_order
        who = "somebody else" if order is None else f"system {order.system}"
        return f"{who} paused the vehicle: mode {self._vehicle.mode}"

    def was_paused_after(self, since: float) -> bool:
        """Whether the vehicle is paused, and was not yet at that time."""
        return self._paused_at is not None and self._paused_at > since

    def _observe_changes(self, changes: MissionChangeMonitor, now: float, effects: Effects) -> None:
        """Report what another system has done to the mission."""
        effects.messages += changes.tick(now)
        note, changes.note = changes.note, None
        if note is not None:
            ledger = self._mission.ledger
            ledger.add_note(ledger.finished, note)
            self._mission.report(effects)


class FlyingLive(Phase):
    """One live command in flight."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._executor: LiveCommandExecutor | None = None

    @property
    def claim(self) -> Claim | None:
        """Modes of the live command; on the ground, where only a camera works, none."""
        if not self._mission.is_hovering:
            return None
        if self._executor is None:
            return LEFT_MISSION
        return self._executor.claim

    @property
    def landed_by(self) -> Authority | None:
        """Who else had a vehicle in the air when it was disarmed; None: nobody."""
        vehicle, claim = self._vehicle, self.claim
        if claim is None or vehicle.snapshot.armed is not False:
            return None
        claim = claim._replace(roles=claim.roles | AIRBORNE_MODES, is_exclusive=False)
        who = control_authority.authority_of(vehicle.flown_mode, claim)
        return None if who is Authority.BROKER else who

    @property
    def tracks(self) -> bool:
        """Whether the camera tracks a subject for the command."""
        return self._executor is not None and self._executor.tracks

    @property
    def was_taken(self) -> bool:
        """Whether another system has ended the command."""
        return self._executor is not None and self._executor.is_control_lost

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin the command, or continue it; not while the mission is paused."""
        mission, vehicle = self._mission, self._vehicle
        if mission.pauses.is_paused:
            return None
        live = mission.segments.live
        is_under_way = mission.was_running and live.action.moves and vehicle.mode in LIVE_MODES
        is_running = mission.ledger.commands[live.command] is Status.RUNNING
        self._begin(now, effects, is_under_way=is_under_way, was_reported=is_running)
        return None

    def _begin(
        self,
        now: float,
        effects: Effects,
        *,
        is_under_way: bool = False,
        was_reported: bool = False,
    ) -> LiveCommandExecutor:
        """Begin the command; behind a pause from its start."""
        action, vehicle = self._mission.segments.live.action, self._vehicle
        self._executor = LiveCommandExecutor(action, vehicle, self._name)
        effects.messages += self._executor.start(
            now, is_under_way=is_under_way, was_reported=was_reported
        )
        return self._executor

    @property
    def _name(self) -> str:
        return self._mission.ledger.name_of(self._mission.segments.live.command)

    def leave(self) -> None:
        """End the command."""
        self._executor = None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle."""
        if self._executor is not None and not self._is_interrupted:
            effects.messages += self._executor.receive(message, now)

    def tick(self, now: float, effects: Effects) -> Result:
        """Report the command; the next segment waits for its pictures."""
        mission, landed_by = self._mission, self.landed_by
        if landed_by is not None:
            return Fault(control_authority.reason(landed_by, mission.vehicle.flown_mode))
        if self._is_interrupted:
            return self._wait()
        executor = self._executor or self._begin(now, effects)
        effects.messages += executor.tick(now)
        index = mission.segments.live.command
        if executor.has_begun:
            if executor.note is not None:
                mission.ledger.note(index, (*mission.segments.notes[index], executor.note))
            begins = mission.ledger.set_mission(Status.RUNNING)
            if mission.ledger.set_command(index, Status.RUNNING) or begins:
                mission.report(effects)
        if executor.phase is LivePhase.FAILED:
            return Fault(executor.reason, index)
        is_done = executor.phase is LivePhase.DONE
        if not is_done or mission.captures.are_pending(index, now, effects):
            return None
        if mission.is_held_back:
            return None
        mission.ledger.set_command(index, Status.FINISHED)
        effects.for_edge += mission.reporter.results(self._name, now)
        if mission.segments.is_last:
            mission.ledger.set_mission(Status.FINISHED)
        mission.report(effects)
        return Request.NEXT_SEGMENT

    @property
    def _is_interrupted(self) -> bool:
        """Whether the mission is being paused, or is paused, while the command has to wait."""
        has_to_wait = self._executor is None or self._mission.segments.live.action.moves
        return self._mission.pauses.is_paused and has_to_wait

    def _wait(self) -> Result:
        """Drop the command that the vehicle has left; without an end it waits to be resumed."""
        mission = self._mission
        if not mission.pauses.has_obeyed:
            return None
        self._executor = None
        mission.vehicle.recovery.note_left(self._name)
        if mission.vehicle.snapshot.armed is False:
            return Fault(DISARMED)
        return None
