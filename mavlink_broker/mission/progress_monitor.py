"""Follows a mission that flies: what has been done, and whether the vehicle still flies it.

A paused mission (a hold mode) stays RUNNING: whoever paused it may resume it. A mission has failed
when another system flies its vehicle, a failsafe returns it, it was disarmed early or holds another
mission, and that has lasted longer than a lost message would explain. A lost link is no failure:
the vehicle flies on, and reports when the link is back.

What other systems do to the mission is followed too: a change of its items, skipped items. Vehicles
that give ids to their missions show a change at once. Of the others only signs are seen: another
count of items, the acknowledgement of somebody's upload, the vehicle's STATUSTEXT, an item number
that goes back. None of them proves anything, so the mission is read back and compared. The same
mission with an earlier item current was set back by another ground station: it flies on, its report
notes it. PX4 does so by itself when it resumes a mission that has taken pictures: it begins again
at the place before. An earlier run of the broker has reported which items were reached, so a
vehicle that was set back while no broker ran is found too.

A skipped item: MISSION_CURRENT beyond an item shows that it is done, but not how. A vehicle that
was near its waypoints, and then passes one that it was nowhere near, was ordered to. Nothing
follows where positions are missing, or before the vehicle was near a waypoint.
"""

import math
from typing import Final

from afarcloud.enumerations import Status
from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.effects import EdgeReport
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.mission_download import Different, MissionVerify, Verified
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.segments import Progress
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import (
    DISARMED,
    HELD_BY_FAILSAFE,
    MISSION_MODES,
    Authority,
    Claim,
    TakeoverDebounce,
)
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

QUIET_S: Final = 1.5
"""After the last frame of a transfer the mission is read back."""
BACK_FOR_S: Final = 1.5
"""How long an earlier item must be current: frames arrive out of order."""
READS: Final = 3
"""How often the mission is read back; a vehicle that does not answer is taken to fly on."""
NO_TOTALS: Final = frozenset({0, 0xFFFF})
CLEARED: Final = "cleared the mission from the vehicle"
_TRANSFER: Final = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"})
NEAR_M: Final = 50.0
NEAR_S: Final = 3.0
"""Of flight at its speed: a plane turns early, and its positions are late."""
GAP_S: Final = 2.5
"""Without positions for so long the vehicle may have been anywhere."""


def foreign_uploader(message: Message, vehicle: Vehicle) -> int | None:
    """Give the system whose mission a vehicle takes, by its requests and answers; else None."""
    if message.get_type() not in _TRANSFER or vehicle.route.is_for_us(message):
        return None
    is_mission = getattr(message, "mission_type", 0) == mavlink.MAV_MISSION_TYPE_MISSION
    is_end = message.get_type() == "MISSION_ACK"
    if not is_mission or (is_end and message.type != mavlink.MAV_MISSION_ACCEPTED):
        return None
    return int(message.target_system)


def total_of(message: Message) -> int | None:
    """Give the number of items that a vehicle says it holds; None if it says none."""
    is_known = message.get_type() == "MISSION_CURRENT" and message.total not in NO_TOTALS
    return int(message.total) if is_known else None


class MissionChangeMonitor:
    """Monitors one segment in flight."""

    def __init__(
        self,
        plan: FlightPlan,
        vehicle: Vehicle,
        reached: int = -1,
        *,
        uploader: int | None = None,
        total: int | None = None,
    ) -> None:
        """Begin behind the last item that is known to be `reached`; -1: none.

        `uploader` has put a mission onto the vehicle since the items were verified; `total` is
        the first that the vehicle has sent since then. None: none.
        """
        self._plan = plan
        self._vehicle = vehicle
        self._total = total
        self._highest = reached
        self._back_since: float | None = None
        self._back_at = -1
        self._was_left = reached >= 0  # The mission mode, since its farthest item was current
        self._is_back_reported = False
        self._suspected_at: float | None = None if uploader is None else -math.inf
        self._uploader = uploader
        self._reads = 0
        self._reading: MissionVerify | None = None
        self.loss_reason: str | None = None
        self.holds_another = False  # It holds the mission of another system, rather than none
        self.note: str | None = None  # What somebody has changed of a mission that still flies

    @property
    def is_suspicious(self) -> bool:
        """Whether the mission may have changed, and was not read back yet."""
        return self._suspected_at is not None or self._reading is not None

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle, to the broker or to other systems."""
        kind = message.get_type()
        self._was_left |= self._vehicle.mode_role is not ModeRole.MISSION
        uploader = foreign_uploader(message, self._vehicle)
        if uploader is not None:
            self._uploader, self._suspected_at = uploader, now
        elif kind == "MISSION_CURRENT":
            self._see_current(message, now)
        elif kind == "STATUSTEXT" and means(message.text, TextMeaning.MISSION_UPLOADED):
            self._suspected_at = now
        if self._reading is None:
            return []
        return [*self._reading.receive(message, now), *self._settle(now)]

    def tick(self, now: float) -> list[Message]:
        """Read the mission back when it may have changed."""
        if self._reading is not None:
            return [*self._reading.tick(now), *self._settle(now)]
        is_due = self._suspected_at is not None and now - self._suspected_at >= QUIET_S
        if not is_due or not self._vehicle.is_reachable(now):
            return []
        self._suspected_at = None
        self._reads += 1
        self._reading = exchanges.recognition(self._plan, self._vehicle)
        return self._reading.start(now)

    def _see_current(self, message: Message, now: float) -> None:
        if self._total is not None or message.total not in NO_TOTALS:  # Else it sends none
            if self._total not in {None, message.total}:
                self._suspected_at = now
            self._total = message.total
        self._see_resumption(message.seq)
        self._highest = max(self._highest, message.seq)
        snapshot = self._vehicle.snapshot
        on_ground = snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        flies = self._vehicle.mode_role is ModeRole.MISSION and snapshot.armed and not on_ground
        is_over = message.mission_state == mavlink.MISSION_STATE_COMPLETE
        if message.seq >= self._highest or not flies or is_over:
            self._back_since = None
        elif self._back_since is None:
            self._back_since, self._back_at = now, message.seq
        elif now - self._back_since >= BACK_FOR_S and not self._is_back_reported:
            self._is_back_reported = True
            self._suspected_at = now - QUIET_S

    def _see_resumption(self, seq: int) -> None:
        """Follow a vehicle that begins again at the place before the farthest item."""
        if self._vehicle.mode_role is not ModeRole.MISSION:
            return
        if seq > self._highest:
            self._was_left = False
        elif self._was_left and seq == self._place_before:
            self._was_left, self._highest = False, seq

    @property
    def _place_before(self) -> int | None:
        """The item at which a vehicle that repeats its pictures resumes; None: where it was."""
        before = range(self._plan.first_item, min(self._highest, len(self._plan.items)))
        items = self._plan.items
        shoots = any(items[seq].command == mavlink.MAV_CMD_IMAGE_START_CAPTURE for seq in before)
        if not self._vehicle.family.repeats_pictures or not shoots:
            return None
        return max((seq for seq in before if items[seq].is_positional), default=None)

    def _settle(self, now: float) -> list[Message]:
        """Judge what was read."""
        match self._reading.outcome if self._reading else None:
            case Verified():
                self._reading, self._reads = None, 0
                if self._back_since is not None:
                    self.note = f"somebody else set the vehicle back to item {self._back_at}"
                    self._highest = self._back_at
            case Different(count=None):
                self._reading = None
                self._suspected_at = now if self._reads < READS else None
            case Different(reason, int(count)):
                self._reading = None
                who = "somebody else" if self._uploader is None else f"system {self._uploader}"
                self.holds_another = count > self._plan.first_item
                self.loss_reason = (
                    f"{who} put another mission onto the vehicle: {reason}"
                    if self.holds_another
                    else f"{who} {CLEARED}"
                )
        return []


class SkippedWaypointMonitor:
    """Monitors one segment in flight."""

    def __init__(self, plan: FlightPlan, vehicle: Vehicle) -> None:
        self._plan = plan
        self._vehicle = vehicle
        self._unseen = {
            seq: item
            for seq, item in enumerate(plan.items)
            if seq >= plan.first_item and item.command == mavlink.MAV_CMD_NAV_WAYPOINT
        }
        self._current: int | None = None
        self._placed_at: float | None = None
        self._is_proven = False
        self._skipped: list[tuple[int, str]] = []

    def receive(self, message: Message, now: float) -> None:
        """Handle a message of the vehicle."""
        match message.get_type():
            case "GLOBAL_POSITION_INT" if (message.lat, message.lon) != (0, 0):
                self._see_position(now)
            case "MISSION_ITEM_REACHED":
                self._unseen.pop(message.seq, None)
            case "MISSION_CURRENT":
                self._see_current(message.seq, now)

    def take_skipped(self) -> list[tuple[int, str]]:
        """Give, once, the commands that were not flown to their end, and why."""
        skipped, self._skipped = self._skipped, []
        return skipped

    def _see_position(self, now: float) -> None:
        if self._placed_at is not None and now - self._placed_at > GAP_S:
            self._lose_track()
        self._placed_at = now
        for seq in [seq for seq, item in self._unseen.items() if self._is_near(item)]:
            self._is_proven = self._is_proven or seq == self._current
            del self._unseen[seq]

    def _is_near(self, item: MissionItem) -> bool:
        position = self._vehicle.snapshot.position
        if position is None:
            return False
        away = distance_m(
            position.latitude_deg, position.longitude_deg, item.latitude_deg, item.longitude_deg
        )
        return away <= max(NEAR_M, item.parameters[1]) + NEAR_S * position.speed_m_s

    def _lose_track(self) -> None:
        """Count the current item as flown."""
        if self._current is not None:
            self._unseen.pop(self._current, None)
        self._current = None

    def _see_current(self, seq: int, now: float) -> None:
        if self._placed_at is None or now - self._placed_at > GAP_S:
            self._lose_track()
        before, self._current = self._current, seq
        if before is None or seq <= before or not self._vehicle.snapshot.armed:
            return
        left = [item for item in self._unseen if before <= item < seq]
        for item in left:
            del self._unseen[item]
        if self._is_proven and left:
            why = f"not flown: somebody else set the vehicle on from item {before} to item {seq}"
            commands = {self._plan.command_of_item[item] for item in left}
            self._skipped += [
                (command, why) for command in sorted(commands) if self._is_behind(command, seq)
            ]

    def _is_behind(self, command: int, seq: int) -> bool:
        return self._plan.done_item[command - self._plan.first_command] < seq


REPORT_EVERY_S: Final = 30.0
END_WITHIN_M: Final = 30.0
"""How far from its place a vehicle may land: home is moved when it arms, a return is not exact."""

_UNDER_WAY: Final = frozenset({mavlink.MISSION_STATE_ACTIVE, mavlink.MISSION_STATE_PAUSED})


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
    def claim(self) -> Claim:
        """Modes in which the vehicle flies the mission; its last command may land it."""
        lands = self._plan.ends_on_ground and self._progress.last_command_has_begun
        return Claim(MISSION_MODES | {ModeRole.ENDING} if lands else MISSION_MODES)

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
            return control_authority.reason(who, self._vehicle.flown_mode)
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
        if vehicle.snapshot.armed:
            claim = claim._replace(roles=claim.roles | {ModeRole.PAUSED})
        elif vehicle.recovery.paused is not None:
            claim = claim._replace(mode=vehicle.family.paused_mode)
        return control_authority.authority_of(vehicle.flown_mode, claim)

    @property
    def holds_another(self) -> bool:
        """Whether the vehicle holds the mission of another system, by its id."""
        return self._mission_id is not None and self._held_id not in {self._mission_id, 0}

    @property
    def _held_id(self) -> int | None:
        mission = self._vehicle.snapshot.mission
        return None if mission is None else mission.mission_id
