"""Follows a mission that flies: what has been done, and whether the vehicle still flies it.

A paused mission (a hold mode) stays RUNNING: whoever paused it may resume it. A mission whose
vehicle is flown by another hand, goes home by a failsafe, was disarmed early or was given
another mission has failed, once that has lasted longer than a lost message would explain.
A lost link is no failure: the vehicle flies on, and is asked when it is back.
"""

from typing import Final

from afarcloud.enumerations import Status
from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import Told
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission.progress import Progress
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import IN_MISSION, Claim, InCommand
from mavlink_broker.vehicle.mission_ledger import Ledger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.takeover_debounce import HELD_BY_FAILSAFE, Departure
from mavlink_broker.vehicle.vehicle import Vehicle

REPORT_EVERY_S: Final = 30.0
AT_THE_END_M: Final = 30.0
"""How far from its place a vehicle may land: home is moved when it arms, a return is not exact."""

_GIVES_UP: Final = "No valid mission available"
"""PX4's words for a mission in flight that a new fence forbids."""
_UNDER_WAY: Final = frozenset({mavlink.MISSION_STATE_ACTIVE, mavlink.MISSION_STATE_PAUSED})


def last_leg(plan: FlightPlan) -> int:
    """Give the last item that a vehicle navigates by; the first of the mission if there is none."""
    own = range(plan.first_item, len(plan.items))
    legs = [seq for seq in own if plan.items[seq].command <= mavlink.MAV_CMD_NAV_LAST]
    return legs[-1] if legs else plan.first_item


class Follower:
    """One mission on its way; `resumed` if it was started by an earlier run of the broker."""

    def __init__(
        self,
        plan: FlightPlan,
        ledger: Ledger,
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
        self._mission_id: int | None = None  # The vehicle's own, once it has told it
        self._under_way = self._resumed = resumed
        self._reported_at = 0.0
        self._departed = Departure()
        self._given_up: str | None = None
        self.departure: str | None = None

    @property
    def is_finished(self) -> bool:
        """Whether every command is."""
        return self._progress.is_finished

    @property
    def has_given_up(self) -> bool:
        """Whether the vehicle waits where it is, for a mission that it does not go on with."""
        return self._given_up is not None

    @property
    def claim(self) -> Claim:
        """Modes in which the vehicle flies the mission; its last command may land it."""
        lands = self._progress.plan.ends_on_ground and self._progress.last_command_has_begun
        return Claim(IN_MISSION | {ModeRole.ENDING} if lands else IN_MISSION)

    def begin(self, now: float) -> list[Told]:
        """Say that it flies, unless that was said when the vehicle was told to start."""
        begins = self._ledger.set_mission(Status.RUNNING)
        goes_on = self._run_next()
        if self._vehicle.snapshot.mission is not None:
            self._mission_id = self._vehicle.snapshot.mission.mission_id
        self._reported_at = now
        return self._report(now) if begins or goes_on or self._under_way else []

    def receive(self, message: Message) -> None:
        """Take what the vehicle says about the mission."""
        match message.get_type():
            case "MISSION_CURRENT":
                self._current(message)
            case "MISSION_ITEM_REACHED":
                self._progress = self._progress.with_reached(message.seq)
            case "STATUSTEXT" if message.text.startswith(_GIVES_UP):
                self._given_up = "the vehicle has given up the mission"

    def step(self, now: float) -> list[Told]:
        """Judge where things stand; gives results and reports to post."""
        if self._vehicle.snapshot.is_on_ground and self._vehicle.is_heard(now):
            if self._resumed and self._has_landed_meanwhile():
                self._progress = self._progress.with_complete()
            self._progress = self._progress.with_landing()
        self._watch(now)
        before = self._ledger.commands
        reports = self._finish_commands(now)
        self._run_next()
        has_changed = self._ledger.commands != before
        if has_changed or now - self._reported_at >= REPORT_EVERY_S:
            reports += self._report(now)
        return reports

    def _has_landed_meanwhile(self) -> bool:
        """Whether a vehicle that has run its mission stands where that ends."""
        vehicle, last = self._vehicle, self._plan.items[-1]
        place, home = vehicle.snapshot.position, vehicle.snapshot.home
        end = (last.latitude_deg, last.longitude_deg) if last.is_positional else home
        if place is None or end is None or not vehicle.has_run_its_mission:
            return False
        return self._plan.ends_on_ground and distance_m(*place[:2], *end[:2]) <= AT_THE_END_M

    def _current(self, message: Message) -> None:
        if self._mission_id is None:
            self._mission_id = message.mission_id
        if message.mission_id != self._mission_id:
            return
        if message.mission_state in _UNDER_WAY:
            self._under_way, self._given_up = True, None
        self._progress = self._progress.with_current(message.seq)
        if message.mission_state == mavlink.MISSION_STATE_COMPLETE and self._under_way:
            self._ended(message.seq)

    def _ended(self, seq: int) -> None:
        """Believe a vehicle that has come to the end; PX4 says the same of what it gives up."""
        begins_anew = seq == 0 < self._progress.current
        if begins_anew or self._progress.current >= last_leg(self._plan):
            self._progress = self._progress.with_complete()
            if self._vehicle.stays_on_ground:
                self._progress = self._progress.with_landing()
        else:
            self._given_up = f"the vehicle has given up the mission at item {seq}"

    def _finish_commands(self, now: float) -> list[Told]:
        reports: list[Told] = []
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

    def _report(self, now: float) -> list[Told]:
        self._reported_at = now
        return [self._reporter.mission(self._ledger)]

    def _watch(self, now: float) -> None:
        reason = None
        if self._vehicle.is_heard(now) and not self.is_finished:
            held = self._vehicle.is_held_by_failsafe
            reason = HELD_BY_FAILSAFE if held else self._reason_to_doubt()
        self.departure = self._departed.judge(reason, now)

    def _reason_to_doubt(self) -> str | None:
        vehicle, snapshot = self._vehicle, self._vehicle.snapshot
        role = vehicle.mode_role
        if snapshot.armed is False:
            return "the vehicle disarmed before the end of the mission"
        seen = vehicle.seen
        survives = self.claim._replace(roles=self.claim.roles | {ModeRole.PAUSED})
        who = control_authority.in_command(seen, survives)
        if who is not InCommand.BROKER:
            return control_authority.reason(who, seen)
        told = snapshot.mission.mission_id if snapshot.mission else None
        if self._mission_id is not None and told != self._mission_id:
            return "another mission was put onto the vehicle"
        return self._given_up if role is ModeRole.MISSION else None
