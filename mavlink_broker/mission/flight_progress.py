"""One mission in flight: stretches of items are followed, live commands performed."""

from abc import ABC, abstractmethod

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.flight_modes import LIVE_MODES, ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.live.executor import Performer, Phase
from mavlink_broker.live.series_monitor import SeriesWatch
from mavlink_broker.mission import activities
from mavlink_broker.mission.event_execution import SpeedOrders
from mavlink_broker.mission.flight_attachment import FlightAttachment
from mavlink_broker.mission.mission_change_monitor import ForeignWatch
from mavlink_broker.mission.progress_monitor import Follower
from mavlink_broker.mission.skipped_waypoint_monitor import SkipWatch
from mavlink_broker.mission.states import Event
from mavlink_broker.vehicle.control_authority import InCommand
from mavlink_broker.vehicle.takeover_debounce import GRACE_S


class FlightProgress(FlightAttachment, ABC):
    """The states RUNNING and PERFORMING, and the way from stage to stage."""

    _speeds: SpeedOrders
    _foreign: ForeignWatch  # There whenever a follower is
    _skips: SkipWatch
    _paused_at: float | None = None  # When items that fly were first seen to be held
    _is_pause_reported = False
    _series: tuple[int, SeriesWatch] | None = None  # Behind the command of that index

    @abstractmethod
    def _ends_here(self, now: float, effects: Effects) -> bool:
        """Whether the mission has been ended before its next stage."""

    def _next_stage(self, now: float, effects: Effects) -> None:
        """Go on behind a stretch or a live command, or end."""
        landed = self._stages.is_on_ground if self._stages.has_moved else not self._hovering
        if not self._stages.is_last and self._ends_here(now, effects):
            return
        if not self._stages.advance():
            effects.messages += activities.parking(self._vehicle) if landed else []
            self._follower = self._performer = None
            self._move(Event.ENDED, now, effects)
            return
        self._follower = self._performer = None
        self._was_running = False
        self._hovering = not landed
        self._move(self._event_of_stage(), now, effects)

    def _enter_running(self, now: float, effects: Effects) -> None:
        self._paused_at, self._is_pause_reported = None, False
        self._foreign = ForeignWatch(self._plan, self._vehicle)
        self._skips = SkipWatch(self._plan, self._vehicle)
        self._follower = Follower(
            self._plan,
            self.ledger,
            self._vehicle,
            self._reporter,
            resumed=self._was_running,
        )
        effects.for_edge += self._follower.begin(now)

    def _enter_performing(self, now: float, effects: Effects) -> None:
        live, vehicle = self._stages.live, self._vehicle
        is_under_way = self._was_running and live.action.moves and vehicle.mode in LIVE_MODES
        resumed = self.ledger.commands[live.command] is Status.RUNNING or is_under_way
        name = self.ledger.name_of(live.command)
        self._performer = Performer(live.action, self._vehicle, name)
        effects.messages += self._performer.start(now, resumed=resumed)

    def _step_running(self, now: float, effects: Effects) -> None:
        if self._follower is None:
            return
        for index, reason in self._skips.take_skipped():
            if not self.ledger.commands[index].is_terminal:
                self.ledger.set_command(index, Status.ABORTED, reason)
        last = self._plan.commands[-1]
        if self._follower.is_finished and self._takes_pictures(last, now, effects):
            if self._is_taken_away:
                self._fail(self._departure, now, effects, last)
            return
        self._watch_pause(now, effects)
        effects.for_edge += self._follower.step(now)
        if self._who is InCommand.BROKER:
            self._speeds.hold(self._plan, self._stages.speed_m_s, now, effects)
        if self._follower.is_finished:
            self._next_stage(now, effects)
            return
        self._watch_others(now, effects)
        departure = self._follower.departure or self._foreign.departure
        if departure is not None:
            self._fail(departure, now, effects)

    def _watch_pause(self, now: float, effects: Effects) -> None:
        """Report that somebody else holds the vehicle: the broker orders no hold of a mission.

        It stays where it is for as long as that lasts; whoever paused it resumes it. PX4 holds at
        the end of a mission too, mostly before its last report of progress.
        """
        vehicle = self._vehicle
        holds = vehicle.mode_role in {ModeRole.HOLD, ModeRole.PAUSED} and vehicle.family.knows_modes
        if not holds or not vehicle.snapshot.armed or vehicle.is_held_by_failsafe:
            self._paused_at, self._is_pause_reported = None, False
            return
        self._paused_at = self._paused_at or now
        if now - self._paused_at >= GRACE_S and not self._is_pause_reported:
            self._is_pause_reported = True
            last = len(self.ledger.commands) - 1
            self.ledger.add_note(min(self.ledger.finished, last), self._pause)
            effects.for_edge.append(self._reporter.mission(self.ledger))

    @property
    def _pause(self) -> str:
        """Name who has paused the vehicle, as far as that is known."""
        order = self._vehicle.ordered
        who = "somebody else" if order is None else f"system {order.system}"
        return f"{who} paused the vehicle: mode {self._vehicle.mode}"

    def _was_paused_after(self, since: float) -> bool:
        """Whether it is paused, and was not yet at that time."""
        return self._paused_at is not None and self._paused_at > since

    def _takes_pictures(self, index: int, now: float, effects: Effects) -> bool:
        """Whether a command that has ended still takes pictures, so that the next one waits."""
        if self._series is None or self._series[0] != index:
            command = self.work.mission.command_array[index]
            self._series = index, SeriesWatch(command, self._vehicle)
        watch = self._series[1]
        effects.messages += watch.tick(now)
        return not watch.is_over(now)

    def _watch_others(self, now: float, effects: Effects) -> None:
        """Find out what somebody else has done to the mission, and report it."""
        effects.messages += self._foreign.tick(now)
        note, self._foreign.note = self._foreign.note, None
        if note is not None:
            self.ledger.add_note(self.ledger.finished, note)
            effects.for_edge.append(self._reporter.mission(self.ledger))

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
        if performer.phase is Phase.DONE and not self._takes_pictures(index, now, effects):
            self.ledger.set_command(index, Status.FINISHED)
            effects.for_edge += self._reporter.results(self.ledger.name_of(index), now)
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
