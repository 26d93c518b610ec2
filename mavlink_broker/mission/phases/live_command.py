"""FLYING_LIVE: the broker flies one command live, between segments of mission items.

An event that pauses the mission ends a command that moves the vehicle; when the mission is resumed
it begins anew. A command that does not move the vehicle goes on to its end.
"""

from typing import Final

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.families import LIVE_MODES, ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.live.executor import LiveCommandExecutor, LivePhase
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.context import MissionContext
from mavlink_broker.mission.phases.phase import Fault, Phase, Request, Result
from mavlink_broker.vehicle.control_authority import AIRBORNE_MODES, Claim

_PAUSED: Final = Claim(AIRBORNE_MODES - {ModeRole.MISSION}, is_exclusive=True)
"""A vehicle that has left its command: only another system puts it into its mission mode."""


class FlyingLive(Phase):
    """One live command in flight."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._executor: LiveCommandExecutor | None = None

    @property
    def claim(self) -> Claim | None:
        """Modes of the live command; on the ground, where only a camera works, none."""
        if not self._mission.is_hovering:
            return None
        if self._executor is None:
            return _PAUSED
        return self._executor.claim

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
        mission, vehicle = self._mission, self._mission.vehicle
        if mission.pauses.is_paused:
            return None
        live = mission.segments.live
        is_under_way = mission.was_running and live.action.moves and vehicle.mode in LIVE_MODES
        is_running = mission.ledger.commands[live.command] is Status.RUNNING
        self._executor = LiveCommandExecutor(
            live.action, vehicle, mission.ledger.name_of(live.command)
        )
        effects.messages += self._executor.start(
            now, is_under_way=is_under_way, was_reported=is_running
        )
        return None

    def leave(self) -> None:
        """End the command."""
        self._executor = None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle."""
        if self._executor is not None and not self._is_interrupted:
            effects.messages += self._executor.receive(message, now)

    def tick(self, now: float, effects: Effects) -> Result:
        """Report the command; the next segment waits for its pictures."""
        mission = self._mission
        if self._is_interrupted:
            return self._wait()
        executor = self._executor or self._begin_anew(now, effects)
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
        effects.for_edge += mission.reporter.results(mission.ledger.name_of(index), now)
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
        name = mission.ledger.name_of(mission.segments.live.command)
        mission.vehicle.recovery.note_left(name)
        if mission.vehicle.snapshot.armed is False:
            return Fault("the vehicle disarmed before the end of the mission")
        return None

    def _begin_anew(self, now: float, effects: Effects) -> LiveCommandExecutor:
        """Begin the command from its start, behind a pause."""
        live = self._mission.segments.live
        name = self._mission.ledger.name_of(live.command)
        self._executor = LiveCommandExecutor(live.action, self._mission.vehicle, name)
        effects.messages += self._executor.start(now)
        return self._executor
