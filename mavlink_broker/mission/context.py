"""What the phases of one mission share: the state of the mission, and who is in command.

Each attribute of the `MissionContext` has one owner: what only one phase needs belongs to that
phase.

`AuthorityMonitor` follows who is in command of the vehicle. Each phase claims the modes in which
the broker is (`mavlink_broker.vehicle.control_authority`); the monitor keeps what those claims
depend on from one phase to the next.
"""

import math
from typing import Final, NamedTuple

from afarcloud.enumerations import Status
from afarcloud.route import Spot
from mavlink_broker.edge.wire import MissionWork
from mavlink_broker.effects import Effects
from mavlink_broker.live.camera_state import SeriesMonitor
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.mission_protocol import FENCE, RALLY
from mavlink_broker.mission.flight_orders import (
    PAUSED,
    PAUSED_INSTEAD,
    RESUMED,
    PauseOrders,
    SoftAbort,
    SpeedChanges,
)
from mavlink_broker.mission.integrity import (
    MissionChangeMonitor,
    SkippedWaypointMonitor,
    fence_change_of,
    foreign_uploader,
    total_of,
)
from mavlink_broker.mission.progress_monitor import ProgressMonitor, has_landed_unseen
from mavlink_broker.mission.segments import Segments
from mavlink_broker.mission.states import Event
from mavlink_broker.planning.geofence import AreaCheck, fence_items, rally_items
from mavlink_broker.planning.mission import FlightPlan, LiveCommand
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import HOVERING, Authority, Claim
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

RESTARTED: Final = "the vehicle was restarted"
REPLACED_VEHICLE: Final = "another vehicle with its system id is received in its place"
RETURN_ENDED: Final = f"{RESTARTED} on its way home"


class AuthorityMonitor:
    """The broker's control authority over one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self.arming_mode: str | None = None  # In which the vehicle is armed, until it is left
        self.is_arming_ordered = False  # And no heartbeat has shown the vehicle armed since
        self.was_taken = False  # Another system had the vehicle while the broker attached to it

    def who(self, claim: Claim | None) -> Authority:
        """Decide who is in command; without a claim the broker orders nothing in this phase.

        While an event has paused the mission, the mode in which the vehicle holds is the broker's.
        """
        if claim is None:
            return Authority.BROKER
        if self._vehicle.recovery.paused is not None and claim.mode is None:
            claim = claim._replace(mode=self._vehicle.family.paused_mode)
        return control_authority.authority_of(self._vehicle.observed_mode, claim)

    def update(self, claim: Claim | None, *, is_attaching: bool) -> Authority:
        """Decide who is in command, and keep what later claims depend on."""
        who = self.who(claim)
        self._vehicle.armed_period.note_mode(is_others=who is Authority.OTHERS)
        if who is Authority.BROKER:
            self.was_taken &= bool(self._vehicle.snapshot.armed)
        else:
            self.was_taken |= is_attaching
        return who

    def observe_mode(self) -> None:
        """Read in which mode the vehicle is armed: the broker keeps that mode until it is left."""
        seen = self._vehicle.observed_mode
        self.is_arming_ordered &= not seen.armed
        if not seen.armed:
            self.arming_mode = seen.mode
        elif seen.mode != self.arming_mode:
            self.arming_mode = None

    def order_arming(self, now: float) -> None:
        """Note that the vehicle is ordered to arm, unless it is armed already."""
        self.is_arming_ordered = not self._vehicle.snapshot.armed
        if self.is_arming_ordered:
            self._vehicle.note_arming_order(now)
            self._vehicle.recovery.arming_s = self._vehicle.snapshot.time_s

    @property
    def is_lost(self) -> bool:
        """Whether its own failsafe or another system controls a vehicle that waits for an order."""
        return self.who(HOVERING) is not Authority.BROKER

    @property
    def loss_reason(self) -> str:
        """Name who controls a vehicle that waits for an order, for the mission's report."""
        return self.reason(self.who(HOVERING))

    def reason(self, who: Authority) -> str:
        """Name who is in command, for the mission's report."""
        return control_authority.reason(who, self._vehicle.observed_mode)


VEHICLE_WITHIN_S: Final = 60.0
"""How long a mission waits for its vehicle before it fails."""
PROGRESS_WITHIN_S: Final = 3.0
"""How long an abort waits for what the vehicle has flown while it was not followed.

`Phase.is_progress_unknown` covers it before the abort is ordered, `Aborting` behind a link that was
away during it.
"""
MOST_FENCE_CHANGES: Final = 4
"""That are reported: by two stations, for example, each of both kinds."""
TELEMETRY_WITHIN_S: Final = 5.0
"""How long a connected vehicle may take to send battery and attitude; some never do."""


class MissionContext:
    """One mission on one vehicle: its work item, its segments, its statuses, who is in command."""

    def __init__(self, work: MissionWork, vehicle: Vehicle, reporter: Reporter) -> None:
        self.work = work
        self.vehicle = vehicle
        self.reporter = reporter
        mission = work.mission
        self.ledger = MissionLedger(
            mission.mission_id,
            mission.command_array,
            name=work.name,
            work_id=work.work_id,
            plan_id=work.plan_ulid,
        )
        self.segments = Segments(mission, vehicle, work.name)
        self.area = None if work.geofence is None else AreaCheck(work.geofence)
        self.authority = AuthorityMonitor(vehicle)
        self.speeds = SpeedChanges(vehicle, self.segments)
        self.pauses = PauseOrders(vehicle, work.name)
        self.soft_abort = SoftAbort(vehicle, self.ledger)
        self.captures = PendingCaptures(work, vehicle)
        self.began_at = 0.0
        self.is_confirmed = work.was_accepted  # The edge server knows that this broker flies it
        self.is_hovering = False  # The vehicle holds in the air, for this mission or before it
        self.is_start_ordered = False
        self.foreign_uploader: int | None = None
        """System that has put a mission onto the vehicle since the items were verified."""
        self.verified_total: int | None = None
        """First number of items that the vehicle has sent since then."""
        self.was_running = False  # The present segment flew before this broker began to follow it
        self._fence_changes: list[str] = []  # Of other systems, that were reported

    def begin(self, now: float, *, hovering: bool, resumed: bool) -> None:
        """Begin, with what an earlier run has reported; if `resumed`, where it has left off."""
        work = self.work
        self.is_hovering, self.began_at = hovering, now
        if work.report is not None:
            self.ledger.restore(work.report)
        self.was_running = self.ledger.status == Status.RUNNING
        if self.was_running:
            self.speeds.resume()
            self.pauses.assume(self.ledger.pause_note)
        if resumed:
            self.vehicle.overrides.assume(FENCE, fence_items(work.geofence))
            self.vehicle.overrides.assume(RALLY, rally_items(work.rally_points))

    def is_expired(self, now: float) -> bool:
        """Whether it may not begin any more; what has begun is flown to its end."""
        return now >= self.expires_at

    @property
    def expires_at(self) -> float:
        """From when on it may not begin [s]; infinite once it has begun."""
        if self.is_start_ordered or self.was_reported_running or self.work.expires_at is None:
            return math.inf
        return self.work.expires_at

    def expire(self, effects: Effects) -> None:
        """Report that it is not flown, because it has expired."""
        self.abort("expired before take-off", effects)

    def abort(self, reason: str, effects: Effects) -> None:
        """Report that it is aborted."""
        self.ledger.abort(reason)
        self.report(effects)

    def fail(self, reason: str, effects: Effects) -> None:
        """Report that it has failed, unless it has ended; no soft abort waits for it any more."""
        if not self.ledger.status.is_terminal:
            self.ledger.fail(reason)
            self.report(effects)
        self.answer_failed(reason, effects)

    def answer_failed(self, reason: str, effects: Effects) -> None:
        """Answer a soft abort that waits, because the mission has failed."""
        self.soft_abort.answer("done", f"the mission has failed: {reason}", effects)

    def report_pause(self, effects: Effects) -> None:
        """Write into the report that the mission is paused, or not any more.

        A restarted broker reads it there. No soft abort waits during a pause.
        """
        is_paused = self.pauses.take_change()
        if is_paused is None:
            return
        if is_paused:
            self.soft_abort.answer("refused", PAUSED_INSTEAD, effects)
        self.ledger.note_open(PAUSED if is_paused else RESUMED)
        self.report(effects)

    def observe_items(self, message: Message) -> None:
        """Note what shows in flight that the vehicle holds another mission than was verified."""
        self.foreign_uploader = foreign_uploader(message, self.vehicle) or self.foreign_uploader
        if self.verified_total is None:
            self.verified_total = total_of(message)

    def observe_fence(self, message: Message, now: float, effects: Effects) -> None:
        """Report once what another system does to the vehicle's geofence in flight."""
        change = fence_change_of(message, self.vehicle, now)
        if change is None or change in self._fence_changes:
            return
        if len(self._fence_changes) < MOST_FENCE_CHANGES:
            self._fence_changes.append(change)
            self.ledger.note_open(change)
            self.report(effects)

    @property
    def plan(self) -> FlightPlan:
        """The mission items of the present segment."""
        return self.segments.plan

    @property
    def is_live(self) -> bool:
        """Whether the present segment is a live command."""
        return isinstance(self.segments.current, LiveCommand)

    def has_landed_unseen(self, *, was_sent_down: bool) -> bool:
        """Whether the vehicle has flown the mission, and nobody knows who has landed it.

        `was_sent_down` if the broker has ordered it to return or land, in this run.
        """
        vehicle = self.vehicle
        is_earlier = self.work.was_accepted and self.was_reported_running
        was_flown = is_earlier or self.is_start_ordered or self.was_running
        if not was_flown or not vehicle.armed_period.has_ended_unseen:
            return False
        is_at_end = self.ledger.status is Status.FINISHED
        was_sent_down |= vehicle.recovery.was_sent_down
        return has_landed_unseen(vehicle, is_at_end=is_at_end, was_sent_down=was_sent_down)

    @property
    def was_reported_running(self) -> bool:
        """Whether the mission has left NOT_STARTED in its reports."""
        return self.ledger.status != Status.NOT_STARTED

    @property
    def is_flying(self) -> bool:
        """Whether the vehicle holds in the air and is armed."""
        return self.is_hovering and bool(self.vehicle.snapshot.armed)

    @property
    def is_held_back(self) -> bool:
        """Whether the next segment waits, because an event has paused the mission."""
        return self.pauses.is_paused and not self.segments.is_last

    def report(self, effects: Effects) -> None:
        """Post a mission report."""
        effects.for_edge.append(self.reporter.mission(self.ledger))

    def translate(self) -> None:
        """Translate the mission for the vehicle as it is known now.

        Raises:
            RefusedError: for the first command that cannot be flown.
        """
        self.segments.translate()
        self.note_changes()

    def note_changes(self) -> None:
        """Write into the reports what the translation changed about each command."""
        for index, notes in enumerate(self.segments.notes):
            if not self.ledger.commands[index].is_terminal:
                self.ledger.note(index, notes)

    def check_area(self, own_limit_m: float | None = None) -> None:
        """Check the mission against its geofence, from the vehicle's position.

        `own_limit_m` is the vehicle's own height limit [m above home], None without one.

        Raises:
            RefusedError: for the first command that leads out.
        """
        segments = self.segments
        if self.area is None or segments.itinerary is None or not segments.is_first:
            return
        place = self.vehicle.snapshot.position
        self.area.check(
            self.work.mission,
            self.vehicle.family,
            start=None if place is None else Spot(*place[:3]),
            home=self.vehicle.snapshot.home,
            rally=self.work.rally_spots,
            own_limit_m=own_limit_m,
        )

    def event_of_segment(self) -> Event:
        """Name the event that begins the present segment."""
        if self.is_live:
            return Event.LIVE_NEXT
        return Event.ITEMS_NEXT if self.is_hovering else Event.GROUND_NEXT


class SegmentMonitors(NamedTuple):
    """What follows one segment."""

    progress: ProgressMonitor
    changes: MissionChangeMonitor
    skips: SkippedWaypointMonitor

    @classmethod
    def of(cls, mission: MissionContext) -> "SegmentMonitors":
        """Begin to follow the present segment of a mission."""
        vehicle = mission.vehicle
        progress = ProgressMonitor(
            mission.plan, mission.ledger, vehicle, mission.reporter, resumed=mission.was_running
        )
        changes = MissionChangeMonitor(
            mission.plan,
            vehicle,
            progress.reached_before,
            uploader=mission.foreign_uploader,
            total=mission.verified_total,
        )
        mission.foreign_uploader = mission.verified_total = None
        return cls(progress, changes, SkippedWaypointMonitor(mission.plan, vehicle))

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message about the mission."""
        self.progress.receive(message, now)
        effects.messages += self.changes.receive(message, now)
        self.skips.receive(message, now)

    def abort_skipped(self, ledger: MissionLedger) -> None:
        """Note the commands that another system has left out."""
        for index, reason in self.skips.take_skipped():
            if not ledger.commands[index].is_terminal:
                ledger.set_command(index, Status.ABORTED, reason)


class PendingCaptures:
    """Waits for the pictures of the command that ended last."""

    def __init__(self, work: MissionWork, vehicle: Vehicle) -> None:
        self._work = work
        self._vehicle = vehicle
        self._monitor: tuple[int, SeriesMonitor] | None = None  # Of the command with that index

    def receive(self, message: Message, now: float) -> None:
        """Handle a message of the vehicle's camera."""
        if self._monitor is not None:
            self._monitor[1].receive(message, now)

    def are_pending(self, command: int, now: float, effects: Effects) -> bool:
        """Whether a command that has ended still takes pictures, so that the next one waits."""
        if self._monitor is None or self._monitor[0] != command:
            commands = self._work.mission.command_array
            self._monitor = command, SeriesMonitor(commands[command], self._vehicle)
        monitor = self._monitor[1]
        effects.messages += monitor.tick(now)
        return not monitor.is_over(now)
