"""FLYING_LIVE: the broker flies one command live, between segments of mission items."""

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.flight_modes import LIVE_MODES
from mavlink_broker.effects import Effects
from mavlink_broker.live.executor import LiveCommandExecutor
from mavlink_broker.live.executor import Phase as LivePhase
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.context import MissionContext
from mavlink_broker.mission.phases.phase import Fault, Phase, Request, Result
from mavlink_broker.vehicle.control_authority import Claim


class FlyingLive(Phase):
    """One live command in flight."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._executor: LiveCommandExecutor | None = None

    @property
    def claim(self) -> Claim | None:
        """Modes of the live command; on the ground, where only a camera works, none."""
        if self._executor is None or not self._mission.is_hovering:
            return None
        return self._executor.claim

    @property
    def was_taken(self) -> bool:
        """Whether another system has ended the command."""
        return self._executor is not None and self._executor.has_departed

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin the command, or go on with it."""
        mission, vehicle = self._mission, self._mission.vehicle
        live = mission.segments.live
        is_under_way = mission.was_running and live.action.moves and vehicle.mode in LIVE_MODES
        is_running = mission.ledger.commands[live.command] is Status.RUNNING
        self._executor = LiveCommandExecutor(
            live.action, vehicle, mission.ledger.name_of(live.command)
        )
        effects.messages += self._executor.start(now, resumed=is_running or is_under_way)
        return None

    def leave(self) -> None:
        """End the command."""
        self._executor = None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Take a message of the vehicle."""
        if self._executor is not None:
            effects.messages += self._executor.receive(message, now)

    def tick(self, now: float, effects: Effects) -> Result:
        """Report the command; the next segment waits for its pictures."""
        mission, executor = self._mission, self._executor
        if executor is None:
            return None
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
        mission.ledger.set_command(index, Status.FINISHED)
        effects.for_edge += mission.reporter.results(mission.ledger.name_of(index), now)
        if mission.segments.is_last:
            mission.ledger.set_mission(Status.FINISHED)
        mission.report(effects)
        return Request.NEXT_SEGMENT
