"""Follows a mission that flies: what has been done, and whether the vehicle still flies it.

`Progress` never goes back. Three sources show it and each may be lost: MISSION_ITEM_REACHED shows
that item k was reached, MISSION_CURRENT beyond k proves it, and a complete mission proves all. A
repeated MISSION_ITEM_REACHED of the mission before differs by MISSION_CURRENT: nothing can be
reached that was not current first.

A paused mission (a hold mode) stays RUNNING: whoever paused it may resume it. A mission has failed
when another system flies its vehicle, a failsafe returns it, it was disarmed early or holds another
mission, and that has lasted longer than a lost message would explain. A lost link is no failure:
the vehicle flies on, and reports when the link is back.
"""

from dataclasses import dataclass, replace
from typing import Final, Self

from afarcloud.enumerations import Status
from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.effects import EdgeReport
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission.integrity import CLEARED
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import (
    DISARMED,
    HELD_BY_FAILSAFE,
    MISSION_MODES,
    Authority,
    Claim,
    ObservedMode,
    TakeoverDebounce,
)
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

NOTHING: Final = -1
REPORT_EVERY_S: Final = 30.0
END_WITHIN_M: Final = 30.0
"""How far from its place a vehicle may land: home is moved when it arms, a return is not exact."""
_UNDER_WAY: Final = frozenset({mavlink.MISSION_STATE_ACTIVE, mavlink.MISSION_STATE_PAUSED})


@dataclass(frozen=True, slots=True)
class Progress:
    """The farthest that is known of one segment; its commands are counted from its own first."""

    plan: FlightPlan
    current: int = NOTHING  # Highest item that was current
    reached: int = NOTHING  # Highest item that was reached
    on_ground: bool = False  # Landed and disarmed after the last command had begun

    @classmethod
    def after(cls, plan: FlightPlan, finished_commands: int) -> Self:
        """Resume a flight of which so many commands were finished before."""
        if finished_commands == 0:
            return cls(plan)
        done = plan.done_item[finished_commands - 1]
        return cls(plan, current=done, reached=done)

    def with_current(self, seq: int) -> Self:
        """Handle MISSION_CURRENT: everything before it has been reached."""
        if not self.current < seq < len(self.plan.items):
            return self
        return replace(self, current=seq, reached=max(self.reached, seq - 1))

    def with_reached(self, seq: int) -> Self:
        """Handle MISSION_ITEM_REACHED."""
        if not self.reached < seq <= self.current:
            return self
        return replace(self, reached=seq)

    def with_complete(self) -> Self:
        """Note that the vehicle reports the mission as complete."""
        last = len(self.plan.items) - 1
        return replace(self, current=last, reached=last)

    def with_landing(self) -> Self:
        """Note that the vehicle is on the ground and disarmed; early, it proves nothing."""
        return replace(self, on_ground=True) if self.last_command_has_begun else self

    @property
    def last_command_has_begun(self) -> bool:
        """Whether the last command's items are being flown, or have been."""
        owners = self.plan.command_of_item
        return self.current >= owners.index(owners[-1])

    @property
    def finished_commands(self) -> int:
        """How many commands, counted from the first, are finished.

        A last command that lands is finished on the ground and disarmed, not before.
        """
        count = sum(done <= self.reached for done in self.plan.done_item)
        if not self.plan.ends_on_ground:
            return count
        total = len(self.plan.done_item)
        return total if self.on_ground else min(count, total - 1)

    @property
    def is_finished(self) -> bool:
        """Whether every command is."""
        return self.finished_commands == len(self.plan.done_item)


def has_landed_unseen(vehicle: Vehicle, *, is_at_end: bool, was_sent_down: bool) -> bool:
    """Whether nobody knows who has landed a vehicle that flew a mission.

    It was disarmed while it was not received, or before the broker was started, and does not show
    by its mode and its progress that it has run its mission to the end. `is_at_end` if it was seen
    on the last leg: that counts where it sends no state of its mission. `was_sent_down` if the
    broker has ordered it to return or land.
    """
    if not vehicle.armed_period.has_ended_unseen:
        return False
    role, current = vehicle.mode_role, vehicle.snapshot.mission
    if was_sent_down:
        return role in {ModeRole.OTHER, ModeRole.PAUSED}
    state = mavlink.MISSION_STATE_UNKNOWN if current is None else current.state
    is_complete = state == mavlink.MISSION_STATE_COMPLETE
    is_complete |= state == mavlink.MISSION_STATE_UNKNOWN and is_at_end
    is_in_other_mode = role is ModeRole.ENDING and vehicle.mode != vehicle.family.return_item_mode
    return not (vehicle.has_run_its_mission or (is_complete and not is_in_other_mode))


class ProgressMonitor:
    """One segment in flight; `resumed` if an earlier run of the broker started it."""

    def __init__(
        self,
        plan: FlightPlan,
        ledger: MissionLedger,
        vehicle: Vehicle,
        reporter: Reporter,
        *,
        resumed: bool,
    ) -> None:
        self._ledger = ledger
        self._vehicle = vehicle
        self._reporter = reporter
        self._progress = Progress.after(plan, max(0, ledger.finished - plan.first_command))
        self._plan = plan
        self.reached_before = self._progress.reached
        """The last item that an earlier run of the broker has reported, -1 if there is none."""
        self._mission_id: int | None = None  # The vehicle's own, once received
        self._under_way = self._resumed = resumed
        self.lacks_progress = resumed
        """Whether it flew before it was followed, and has not sent its progress since."""
        self._reported_at = 0.0
        self._debounce = TakeoverDebounce()
        self._given_up: str | None = None
        self.loss_reason: str | None = None

    @property
    def is_finished(self) -> bool:
        """Whether every command is."""
        return self._progress.is_finished

    @property
    def has_given_up(self) -> bool:
        """Whether the vehicle holds its position and does not continue its mission."""
        return self._given_up is not None

    @property
    def landed_by(self) -> Authority | None:
        """Who else had the vehicle when it was disarmed before the end; None: nobody."""
        is_down = self._vehicle.snapshot.armed is False and not self.is_finished
        return self._flown_by if is_down and self._flown_by is not Authority.BROKER else None

    @property
    def lands_itself(self) -> bool:
        """Whether the last command, which lands the vehicle, has begun."""
        return self._plan.ends_on_ground and self._progress.last_command_has_begun

    @property
    def claim(self) -> Claim:
        """Modes in which the vehicle flies the mission; a last command that returns may have one.

        A vehicle that lands otherwise than by its mission is landed by somebody else.
        """
        returns = self.lands_itself and self._plan.returns_home
        mode = self._vehicle.family.return_item_mode if returns else None
        is_theirs = self._vehicle.armed_period.was_theirs_in(mode)
        return Claim(MISSION_MODES, mode=None if is_theirs else mode)

    def begin(self, now: float) -> list[EdgeReport]:
        """Report that it flies, unless that was reported with the order to start."""
        begins = self._ledger.set_mission(Status.RUNNING)
        goes_on = self._run_next()
        if self._vehicle.snapshot.mission is not None:
            self._mission_id = self._vehicle.snapshot.mission.mission_id
        self._reported_at = now
        return self._report(now) if begins or goes_on or self._under_way else []

    def receive(self, message: Message, now: float) -> None:
        """Handle a message about the mission; it counts once the vehicle has shown itself."""
        if self._vehicle.may_be_restarted(now):
            return
        match message.get_type():
            case "MISSION_CURRENT":
                self._current(message)
            case "MISSION_ITEM_REACHED":
                self._progress = self._progress.with_reached(message.seq)
            case "STATUSTEXT" if means(message.text, TextMeaning.MISSION_INVALID):
                self._given_up = "the vehicle has given up the mission"

    def step(self, now: float) -> list[EdgeReport]:
        """Update the progress; gives results and reports to post."""
        may_be_another = not self._vehicle.is_reachable(now) or self._vehicle.may_be_restarted(now)
        if self._vehicle.snapshot.is_on_ground and not may_be_another:
            if self._resumed and self._has_landed_meanwhile():
                self._progress = self._progress.with_complete()
            # On the ground in another mode, no later mode proves that it has run its mission
            self._resumed &= self._vehicle.has_run_its_mission
            if self._flown_by is Authority.BROKER:  # Else somebody has landed it on its last leg
                self._progress = self._progress.with_landing()
        self._detect_takeover(now)
        before = self._ledger.commands
        reports = self._finish_commands(now)
        self._run_next()
        has_changed = self._ledger.commands != before
        if has_changed or now - self._reported_at >= REPORT_EVERY_S:
            reports += self._report(now)
        return reports

    def _has_landed_meanwhile(self) -> bool:
        """Whether a vehicle that has run its mission has landed where that ends.

        One that has disarmed without a take-off stands there too, and a late order to start puts it
        into its mission mode: if the order is noted, it counts once it was seen to fly. A journal
        that could not be written, on a full disk, may have lacked either.
        """
        vehicle, last = self._vehicle, self._plan.items[-1]
        place, home = vehicle.snapshot.position, vehicle.snapshot.home
        end = (last.latitude_deg, last.longitude_deg) if last.is_positional else home
        if place is None or end is None or not vehicle.has_run_its_mission:
            return False
        is_there = distance_m(*place[:2], *end[:2]) <= END_WITHIN_M
        name, recovery = self._ledger.name_of(self._plan.first_command), vehicle.recovery
        is_of_journal = recovery.segment in {name, None} and recovery.tracker.in_use
        may_be_flown = not is_of_journal or recovery.has_flown(name)
        return self._plan.ends_on_ground and is_there and self._had_time and may_be_flown

    @property
    def _had_time(self) -> bool:
        """Whether it can have flown the items since they were ordered; so if nobody knows."""
        name = self._ledger.name_of(self._plan.first_command)
        began_s, now_s = self._vehicle.recovery.began_s([name]), self._vehicle.snapshot.time_s
        if began_s is None or now_s is None or now_s < began_s:
            return True
        return now_s - began_s >= self._plan.least_time_s

    def _current(self, message: Message) -> None:
        if self._mission_id is None:
            self._mission_id = message.mission_id
        if message.mission_id != self._mission_id:
            return
        self.lacks_progress = False
        if message.mission_state in _UNDER_WAY:
            self._under_way, self._given_up = True, None
        self._progress = self._progress.with_current(message.seq)
        if message.mission_state == mavlink.MISSION_STATE_COMPLETE and self._under_way:
            self._ended(message.seq)

    def _ended(self, seq: int) -> None:
        """Accept a mission as complete at its end only: PX4 reports the same when it gives up."""
        begins_anew = seq == 0 < self._progress.current
        if begins_anew or self._progress.current >= self._plan.last_leg:
            self._progress = self._progress.with_complete()
            if self._vehicle.stays_on_ground:
                self._progress = self._progress.with_landing()
        else:
            self._given_up = f"the vehicle has given up the mission at item {seq}"

    def _finish_commands(self, now: float) -> list[EdgeReport]:
        reports: list[EdgeReport] = []
        for index in self._plan.commands[: self._progress.finished_commands]:
            if not self._ledger.commands[index].is_terminal:
                self._ledger.set_command(index, Status.FINISHED)
                reports += self._reporter.results(self._ledger.name_of(index), now)
        if all(status.is_terminal for status in self._ledger.commands):
            self._ledger.set_mission(Status.FINISHED)
        return reports

    def _run_next(self) -> bool:
        index = self._plan.first_command + self._progress.finished_commands
        if index not in self._plan.commands or self._ledger.commands[index].is_terminal:
            return False
        return self._ledger.set_command(index, Status.RUNNING)

    def _report(self, now: float) -> list[EdgeReport]:
        self._reported_at = now
        return [self._reporter.mission(self._ledger)]

    def _detect_takeover(self, now: float) -> None:
        reason = None
        if self._vehicle.is_reachable(now) and not self.is_finished:
            held = self._vehicle.is_held_by_failsafe
            reason = HELD_BY_FAILSAFE if held else self._takeover_reason()
        self.loss_reason = self._debounce.update(reason, now)

    def _takeover_reason(self) -> str | None:
        who = self._flown_by
        if who is not Authority.BROKER:
            return control_authority.reason(who, self._flown_mode)
        if self._vehicle.snapshot.armed is False:
            return DISARMED
        if self._held_id != self._mission_id and self._mission_id is not None:
            replaced = "another mission was put onto the vehicle"
            return replaced if self.holds_another else f"somebody else {CLEARED}"
        return self._given_up if self._vehicle.mode_role is ModeRole.MISSION else None

    @property
    def _flown_by(self) -> Authority:
        """Who has the vehicle; of one that is disarmed, who had it until then.

        A mission survives that somebody pauses it, until he lands the vehicle.
        """
        vehicle, claim = self._vehicle, self.claim
        if vehicle.armed_period.was_disarmed_by_others:
            return Authority.OTHERS
        if vehicle.snapshot.armed:
            claim = claim._replace(roles=claim.roles | {ModeRole.PAUSED})
        elif vehicle.recovery.paused is not None:
            claim = claim._replace(mode=vehicle.family.paused_mode)
        return control_authority.authority_of(self._flown_mode, claim)

    @property
    def _flown_mode(self) -> ObservedMode:
        """The mode in which it was flown last; the present one, if it came down in that unseen."""
        vehicle = self._vehicle
        is_theirs = vehicle.mode_role in {ModeRole.OTHER, ModeRole.ENDING} and has_landed_unseen(
            vehicle, is_at_end=self.lands_itself, was_sent_down=vehicle.recovery.was_sent_down
        )
        seen = vehicle.observed_mode
        return seen._replace(armed=True) if is_theirs else vehicle.flown_mode

    @property
    def holds_another(self) -> bool:
        """Whether the vehicle holds the mission of another system, by its id."""
        return self._mission_id is not None and self._held_id not in {self._mission_id, 0}

    @property
    def _held_id(self) -> int | None:
        mission = self._vehicle.snapshot.mission
        return None if mission is None else mission.mission_id
