"""What a restarted broker has to know of one vehicle, and whether the disk has it.

Whoever learns something of it writes it into the `RecoveryState`. The journal
(`mavlink_broker.journal`) stores the whole as one `RecoveryRecord` of plain values: the vehicle's
overridden configuration, the position where it hovers, a command that it has not obeyed yet, and
the progress of a live command. The broker gets all other state again: the missions from the edge
server, the rest from the vehicle.

`RecordTracker` knows whether the newest record is on the disk. A command that changes a vehicle
waits until its record is stored; so do the messages to the edge server that follow from it. After a
refusal of the disk nothing waits, after two seconds without an answer neither: a bad disk ends no
flight.
"""

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from mavlink_broker.microservices.config_overrides import (
    OverriddenParameter,
    OverriddenPlan,
    ParameterOverrider,
    VehicleOverrides,
)
from mavlink_broker.planning.situation import Pose
from mavlink_broker.vehicle.armed_period import ArmedPeriod
from mavlink_broker.vehicle.control_authority import (
    ForeignOrderMonitor,
    Hover,
    NotedOrder,
    OwnDescent,
)
from mavlink_broker.vehicle.lost_mission import LostMission


class VehicleIdentity(NamedTuple):
    """Identifies the record of a vehicle; other hardware has another one."""

    system: int
    uid: str  # Hexadecimal, of AUTOPILOT_VERSION; empty if the vehicle sends none

    def __str__(self) -> str:
        """Give it as text for the log."""
        return f"system {self.system}" + (f" ({self.uid})" if self.uid else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class PendingReturn:
    """A return home after an alarm has failed a mission; the vehicle has not begun it yet."""

    mission: str  # Name of the work
    reason: str
    noted_s: float | None = None  # [s] By the vehicle's clock since boot


@dataclass(frozen=True, slots=True, kw_only=True)
class PendingAbort:
    """An abort that was accepted, and that the vehicle has not obeyed yet."""

    work_id: int  # Of the event
    identity: str | None = None  # With it; None: of a broker or edge server before this field
    event_type: int  # The `event_type_id` of one that ends missions
    point: Pose | None = None  # Where the vehicle is to go first
    noted_s: float | None = None  # [s] By the vehicle's clock since boot


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveCommandProgress:
    """The progress of a live command. Times are by the vehicle's clock since boot [s]."""

    name: str  # Of the command, unique
    is_accepted: bool = False  # Else the command is about to be sent, and may have been
    began_s: float | None = None  # When it began; None: the vehicle sends no time
    accepted_s: float | None = None  # When the vehicle accepted it
    start: Pose | None = None  # Where its first step begins
    start_s: float | None = None  # When it was there; None: not recorded
    steps: int = 0  # Completed: turns, pictures, points of a circle
    was_left: bool = False  # For a pause: it begins anew, and was not sent since


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryRecord:
    """The record of one vehicle; the keys of `plans` are MAV_MISSION_TYPEs."""

    plans: Mapping[int, OverriddenPlan] = field(default_factory=dict)
    values: Mapping[str, OverriddenParameter] = field(default_factory=dict)  # Guarding a fence
    borrowed: Mapping[str, OverriddenParameter] = field(default_factory=dict)  # For a command
    hover: Pose | None = None  # Where it waits for its next mission
    hover_mode: str | None = None  # In which it waits there
    descent: str | None = None  # Mode in which it returns or lands by order of the broker
    descent_s: float | None = None  # When that was ordered, by the vehicle's clock since boot
    pending_return: PendingReturn | None = None
    abort: PendingAbort | None = None
    live: LiveCommandProgress | None = None
    segment: str | None = None  # First command of the mission items that it was last ordered to fly
    segment_s: float | None = None  # When that was, by the vehicle's clock since boot
    has_flown: bool = False  # It was seen to fly them
    paused: str | None = None  # Name of the work that an event has paused
    is_tracking: bool = False  # Its camera may have been ordered to track a subject
    has_camera: bool = False  # A camera was received in this flight
    healthy: tuple[str, ...] = ()  # Signals of parts that were healthy in this flight
    armed_s: float | None = None  # When it was armed, by its clock since boot
    arming_s: float | None = None  # When it was ordered to arm, and to start nothing since
    foreign_order: NotedOrder | None = None  # Of another system, by which it holds
    is_disarmed_by_others: bool = False  # By another system's order
    taken_mode: str | None = None  # In which somebody else has it, or had when it was disarmed
    shows_manual: bool = False  # Its heartbeats show by standard bits whether a pilot steers


EMPTY_RECORD: Final = RecoveryRecord()


def merge_records(earlier: RecoveryRecord, later: RecoveryRecord) -> RecoveryRecord:
    """Merge two records of one vehicle.

    The original values are those of the earlier record; the placed values are those of both.
    """
    plans = {
        kind: OverriddenPlan(earlier.plans[kind].before, plan.placed)
        for kind, plan in later.plans.items()
        if kind in earlier.plans
    }
    return RecoveryRecord(
        plans={**earlier.plans, **later.plans, **plans},
        values=_merged_values(earlier.values, later.values),
        borrowed=_merged_values(earlier.borrowed, later.borrowed),
        hover=later.hover or earlier.hover,
        hover_mode=later.hover_mode if later.hover else earlier.hover_mode,
        descent=later.descent or earlier.descent,
        descent_s=later.descent_s if later.descent else earlier.descent_s,
        pending_return=later.pending_return or earlier.pending_return,
        abort=later.abort or earlier.abort,
        live=later.live or earlier.live,
        segment=later.segment or earlier.segment,
        segment_s=later.segment_s if later.segment else earlier.segment_s,
        has_flown=later.has_flown if later.segment else earlier.has_flown,
        paused=later.paused or earlier.paused,
        is_tracking=later.is_tracking or earlier.is_tracking,
        has_camera=later.has_camera or earlier.has_camera,
        healthy=tuple(sorted({*later.healthy, *earlier.healthy})),
        armed_s=earlier.armed_s if later.armed_s is None else later.armed_s,
        arming_s=earlier.arming_s if later.arming_s is None else later.arming_s,
        foreign_order=later.foreign_order or earlier.foreign_order,
        is_disarmed_by_others=later.is_disarmed_by_others or earlier.is_disarmed_by_others,
        taken_mode=later.taken_mode or earlier.taken_mode,
        shows_manual=later.shows_manual or earlier.shows_manual,
    )


def _merged_values(
    earlier: Mapping[str, OverriddenParameter], later: Mapping[str, OverriddenParameter]
) -> dict[str, OverriddenParameter]:
    both = dict(earlier)
    for name, borrowed in later.items():
        both[name] = borrowed
        if name in earlier:
            placed = (*earlier[name].placed, *borrowed.placed)
            both[name] = OverriddenParameter(earlier[name].before, tuple(dict.fromkeys(placed)))
    return both


WRITE_TIMEOUT_S: Final = 2.0
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RecordUpdate:
    """A record to be written; if it is empty, its row is removed."""

    identity: VehicleIdentity
    number: int
    record: RecoveryRecord


class RecordTracker:
    """The records of one vehicle. A tracker that is not in use stores and delays nothing."""

    def __init__(self, *, in_use: bool = False) -> None:
        self.in_use = in_use  # There is a disk to write to
        self._newest = EMPTY_RECORD
        self._number = 0
        self._settled = 0  # The newest record that is on the disk, or was refused
        self._waits_since: float | None = None
        self._is_slow = False  # An answer of the disk is overdue
        self.identity: VehicleIdentity | None = None  # None: not known yet

    @property
    def is_loaded(self) -> bool:
        """Whether the record of an earlier run is known by now."""
        return not self.in_use or self.identity is not None

    def load(self, identity: VehicleIdentity, record: RecoveryRecord) -> None:
        """Start with the vehicle's identity and the record that is on the disk."""
        self.identity = identity
        self._newest = record
        self._settled = self._number
        self._waits_since = None

    def update(self, record: RecoveryRecord, now: float) -> RecordUpdate | None:
        """Compare with the newest record; gives the update to write, if it differs."""
        if self.identity is None:
            return None
        self._check_timeout(now)
        if record == self._newest:
            return None
        self._number += 1
        self._newest = record
        if self._waits_since is None:
            self._waits_since = now
        return RecordUpdate(self.identity, self._number, record)

    def confirm(self, number: int) -> None:
        """Mark an update as written, or as refused by the disk."""
        self._is_slow = False
        self._settled = max(self._settled, min(number, self._number))
        if self._settled == self._number:
            self._waits_since = None

    @property
    def is_settled(self) -> bool:
        """Whether no update has to be waited for."""
        return not self.in_use or self._is_slow or self._settled == self._number

    def is_stored(self, record: RecoveryRecord) -> bool:
        """Whether this record is on the disk, as far as the disk takes it."""
        if not self.in_use:
            return True
        return self.identity is not None and self.is_settled and record == self._newest

    def _check_timeout(self, now: float) -> None:
        if self._is_slow or self._waits_since is None:
            return
        if now - self._waits_since >= WRITE_TIMEOUT_S:
            self._is_slow = True
            _LOG.warning(
                "%s: its recovery record is not on the disk after %.0f s; commands are sent "
                "without it",
                self.identity,
                WRITE_TIMEOUT_S,
            )


class RecoveryState:
    """Of one vehicle: whoever learns something of it writes it here."""

    def __init__(self, tracker: RecordTracker | None = None) -> None:
        """Begin with nothing; without a tracker nothing is stored, and nothing waited for."""
        self.tracker = tracker or RecordTracker()
        self.overrides = VehicleOverrides()  # By the geofence of a plan
        self.parameters = ParameterOverrider()
        self.hover = Hover()
        self.descent = OwnDescent()
        self.pending_return: PendingReturn | None = None
        """A return that an alarm has ordered, until the vehicle has obeyed."""
        self.abort: PendingAbort | None = None
        """An abort that was accepted, until the vehicle has obeyed."""
        self.held_abort: PendingAbort | None = None
        """An abort that is done, but for missions that may be handed out again."""
        self.live: LiveCommandProgress | None = None
        """The live command that was ordered last."""
        self.segment: str | None = None
        """Name of the first command of the items that the vehicle was ordered to fly last."""
        self._segment_s: float | None = None
        self._has_flown = False
        self.lost_mission = LostMission()
        """What an earlier run has begun, while no mission is known."""
        self.was_restarted_since = False
        """Whether the vehicle was restarted since an earlier run has ordered these commands."""
        self.paused: str | None = None
        """Name of the work that an event has paused, until it flies again or has ended."""
        self.is_tracking = False
        """Whether the camera may have been ordered to track a subject, and not to stop."""
        self._is_of_earlier_run = False  # That tracking
        self.has_camera = False
        """Whether a camera was received in this flight: a restarted broker expects it."""
        self.healthy: tuple[str, ...] = ()
        """Signals of parts that were healthy in this flight, and whose alarm was not raised."""
        self.armed_s: float | None = None
        """When it was armed for the flight, by its clock since boot; its log began then."""
        self.arming_s: float | None = None
        """When it was ordered to arm, by its clock since boot; None once it is ordered to start."""
        self.armed_period = ArmedPeriod()
        """Who has the vehicle, and whether it stands for somebody else."""
        self.foreign_orders = ForeignOrderMonitor()
        """What another system has ordered, while the vehicle is in the mode that it led to."""
        self._was_sent_down = False  # By an earlier run
        self.shows_manual = False
        """Whether one in flight, whose modes are not known, has shown that a pilot would show."""

    def note_segment(self, first_command: str, time_s: float | None) -> None:
        """Note that the vehicle is about to be ordered to fly items, at a time of its clock."""
        self.segment, self._segment_s, self._has_flown = first_command, time_s, False
        self.arming_s = None

    def note_flying(self, first_command: str) -> None:
        """Note that the vehicle was seen to fly these items."""
        self._has_flown |= first_command == self.segment

    def has_flown(self, first_command: str) -> bool:
        """Whether the vehicle was seen to fly these items since it was ordered to."""
        return self._has_flown and first_command == self.segment

    def began_s(self, names: Collection[str]) -> float | None:
        """Give when the newest of these commands was ordered, by the vehicle's clock since boot."""
        live, times = self.live, []
        if self.segment in names and self._segment_s is not None:
            times.append(self._segment_s)
        if live is not None and live.name in names and live.began_s is not None:
            times.append(live.began_s)
        return max(times, default=None)

    @property
    def may_resume_tracking(self) -> bool:
        """Whether an earlier run has ordered it, whose command may be continued."""
        return self.is_tracking and self._is_of_earlier_run

    def note_tracking(self) -> None:
        """Note that the camera is about to be ordered to track a subject."""
        self.is_tracking, self._is_of_earlier_run = True, False

    def note_left(self, name: str) -> None:
        """Note that the vehicle has left a live command for a pause: it begins anew."""
        self.live = LiveCommandProgress(name=name, was_left=True)

    def clear_commands(self) -> None:
        """Forget live command, segment and pause: none is flown, or those of another mission."""
        self.live = self.segment = self._segment_s = self.arming_s = self.paused = None
        self._has_flown = self.was_restarted_since = False

    @property
    def was_sent_down(self) -> bool:
        """Whether the broker has ordered the vehicle to return or land, also in an earlier run."""
        ordered = (self.abort, self.held_abort, self.pending_return, self.descent.mode)
        return self._was_sent_down or any(order is not None for order in ordered)

    @property
    def record(self) -> RecoveryRecord:
        """All of it, as the journal stores it."""
        return RecoveryRecord(
            plans=dict(self.overrides.plans),
            values=dict(self.overrides.values),
            borrowed=self.parameters.overridden,
            hover=self.hover.place,
            hover_mode=self.hover.mode,
            descent=self.descent.mode,
            descent_s=self.descent.began_s if self.descent.mode else None,
            pending_return=self.pending_return,
            abort=self.abort or self.held_abort,
            live=self.live,
            segment=self.segment,
            segment_s=self._segment_s,
            has_flown=self._has_flown,
            paused=self.paused,
            is_tracking=self.is_tracking,
            has_camera=self.has_camera,
            healthy=self.healthy,
            armed_s=self.armed_s,
            arming_s=self.arming_s,
            foreign_order=self.foreign_orders.noted,
            is_disarmed_by_others=self.armed_period.was_disarmed_by_others,
            taken_mode=self.armed_period.noted_mode,
            shows_manual=self.shows_manual,
        )

    @property
    def is_stored(self) -> bool:
        """Whether a broker that is killed now knows all of it again."""
        return self.tracker.is_stored(self.record)

    def recall(self, record: RecoveryRecord, now: float) -> None:
        """Restore what an earlier run of the broker has noted."""
        both = merge_records(record, self.record)
        orders = (record.abort, record.pending_return, record.descent)
        self._was_sent_down = any(order is not None for order in orders)
        self.overrides.plans, self.overrides.values = dict(both.plans), dict(both.values)
        self.parameters.load(both.borrowed)
        self.hover.recall(both.hover, both.hover_mode)
        if not self.descent.is_flown:
            self.descent.recall(both.descent, both.descent_s)
        self.pending_return, self.live = both.pending_return, both.live
        self.abort = both.abort
        self.segment, self._segment_s = both.segment, both.segment_s
        self._has_flown = both.has_flown
        self.paused = both.paused
        self._recall_lost_mission()
        self.is_tracking, self._is_of_earlier_run = both.is_tracking, record.is_tracking
        self.has_camera, self.armed_s = both.has_camera, both.armed_s
        self.arming_s = both.arming_s
        self.healthy = both.healthy
        self.shows_manual = both.shows_manual
        self.foreign_orders.recall(both.foreign_order, now)
        self.armed_period.recall(
            both.taken_mode, now, is_disarmed_by_others=both.is_disarmed_by_others
        )

    def _recall_lost_mission(self) -> None:
        """Find what an earlier run has begun: items that were flown, or a newer live command."""
        live, ordered_s = self.live, self._segment_s
        began_s = None if live is None else live.began_s
        is_older = began_s is not None and ordered_s is not None and began_s < ordered_s
        is_live = live is not None and live.is_accepted and not is_older
        if is_live or (self.segment is not None and self._has_flown):
            self.lost_mission.recall(began_s if is_live else ordered_s, is_live=is_live)

    def forget_armed_period(self) -> None:
        """Begin anew: another vehicle has not been armed by anybody yet."""
        self.armed_period = ArmedPeriod()

    def forget(self) -> None:
        """Begin anew with another vehicle in place of this one; aborts are for it too."""
        self.overrides, self.parameters = VehicleOverrides(), ParameterOverrider()
        self.hover.end()
        self.descent.end()
        self.lost_mission.end()
        self.foreign_orders.forget()
        self.pending_return = self.paused = self.armed_s = None
        self.forget_armed_period()
        self.is_tracking = self.has_camera = self.shows_manual = self._was_sent_down = False
        self.healthy = ()
        self.clear_commands()
