"""What a restarted broker has to know of one vehicle, and whether the disk has it.

Whoever learns something of it calls a method here. The journal (`mavlink_broker.recovery`) stores
the whole as one record.

`RecordTracker` knows whether the newest record is on the disk. A command that changes a vehicle
waits until its record is stored; so do the messages to the edge server that follow from it. After a
refusal of the disk nothing waits, after two seconds without an answer neither: a bad disk ends no
flight.
"""

import logging
from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from mavlink_broker.microservices.config_overrides import (
    ParameterOverrider,
    VehicleOverrides,
)
from mavlink_broker.vehicle.control_authority import (
    Hover,
)
from mavlink_broker.vehicle.recovery_record import (
    EMPTY_RECORD,
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecoveryRecord,
    VehicleIdentity,
    merge_records,
)

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
        self._in_use = in_use
        self._newest = EMPTY_RECORD
        self._number = 0
        self._settled = 0  # The newest record that is on the disk, or was refused
        self._waits_since: float | None = None
        self._is_slow = False  # An answer of the disk is overdue
        self.identity: VehicleIdentity | None = None  # None: not known yet

    @property
    def in_use(self) -> bool:
        """Whether there is a disk to write to."""
        return self._in_use

    @property
    def is_loaded(self) -> bool:
        """Whether the record of an earlier run is known by now."""
        return not self._in_use or self.identity is not None

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
        return not self._in_use or self._is_slow or self._settled == self._number

    def is_stored(self, record: RecoveryRecord) -> bool:
        """Whether this record is on the disk, as far as the disk takes it."""
        if not self._in_use:
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
    """Of one vehicle."""

    def __init__(self, tracker: RecordTracker | None = None) -> None:
        """Begin with nothing; without a tracker nothing is stored, and nothing waited for."""
        self.tracker = tracker or RecordTracker()
        self.overrides = VehicleOverrides()  # By the geofence of a plan
        self.parameters = ParameterOverrider()
        self.hover = Hover()
        self._return: PendingReturn | None = None
        self._abort: PendingAbort | None = None
        self._held_abort: PendingAbort | None = None
        self._live: LiveCommandProgress | None = None
        self._segment: str | None = None
        self._segment_s: float | None = None
        self._has_flown = False
        self._paused: str | None = None
        self._is_tracking = False
        self._is_of_earlier_run = False  # That tracking

    @property
    def live(self) -> LiveCommandProgress | None:
        """The live command that was ordered last."""
        return self._live

    @property
    def segment(self) -> str | None:
        """Name of the first command of the items that the vehicle was ordered to fly last."""
        return self._segment

    def note_live(self, progress: LiveCommandProgress) -> None:
        """Note how far a live command is."""
        self._live = progress

    def note_segment(self, first_command: str, time_s: float | None) -> None:
        """Note that the vehicle is about to be ordered to fly items, at a time of its clock."""
        self._segment, self._segment_s, self._has_flown = first_command, time_s, False

    def note_flying(self, first_command: str) -> None:
        """Note that the vehicle was seen to fly these items."""
        self._has_flown |= first_command == self._segment

    def has_flown(self, first_command: str) -> bool:
        """Whether the vehicle was seen to fly these items since it was ordered to."""
        return self._has_flown and first_command == self._segment

    def began_s(self, names: Collection[str]) -> float | None:
        """Give when the newest of these commands was ordered, by the vehicle's clock since boot."""
        live, times = self._live, []
        if self._segment in names and self._segment_s is not None:
            times.append(self._segment_s)
        if live is not None and live.name in names and live.began_s is not None:
            times.append(live.began_s)
        return max(times, default=None)

    @property
    def paused(self) -> str | None:
        """Name of the work that an event has paused."""
        return self._paused

    def note_pause(self, mission: str) -> None:
        """Note that an event has paused a mission."""
        self._paused = mission

    def clear_pause(self) -> None:
        """Forget the pause: the mission flies, or has ended."""
        self._paused = None

    @property
    def is_tracking(self) -> bool:
        """Whether the camera may have been ordered to track a subject, and not to stop."""
        return self._is_tracking

    @property
    def may_resume_tracking(self) -> bool:
        """Whether an earlier run has ordered it, whose command may be continued."""
        return self._is_tracking and self._is_of_earlier_run

    def note_tracking(self) -> None:
        """Note that the camera is about to be ordered to track a subject."""
        self._is_tracking, self._is_of_earlier_run = True, False

    def clear_tracking(self) -> None:
        """Forget it: the camera was ordered to stop."""
        self._is_tracking = False

    def note_left(self, name: str) -> None:
        """Note that the vehicle has left a live command for a pause: it begins anew."""
        self._live = LiveCommandProgress(name=name, was_left=True)

    def clear_commands(self) -> None:
        """Forget live command and segment: none is flown, or those of another mission."""
        self._live = self._segment = self._segment_s = None
        self._has_flown = False

    def note_abort(self, abort: PendingAbort) -> None:
        """Note an abort that was accepted, until the vehicle has obeyed."""
        self._abort = abort

    def clear_abort(self) -> None:
        """Forget the abort."""
        self._abort = None

    def hold_abort(self, abort: PendingAbort) -> None:
        """Note an abort that is done, but for missions that may be handed out again."""
        self._held_abort = abort

    def release_abort(self) -> None:
        """Forget that abort: none of its missions may be handed out again."""
        self._held_abort = None

    def note_return(self, pending: PendingReturn) -> None:
        """Note that an alarm has sent the vehicle home, until it has obeyed."""
        self._return = pending

    def clear_return(self) -> None:
        """Forget the return."""
        self._return = None

    @property
    def record(self) -> RecoveryRecord:
        """All of it, as the journal stores it."""
        return RecoveryRecord(
            plans=dict(self.overrides.plans),
            values=dict(self.overrides.values),
            borrowed=self.parameters.overridden,
            hover=self.hover.place,
            hover_mode=self.hover.mode,
            pending_return=self._return,
            abort=self._abort or self._held_abort,
            live=self._live,
            started=self._segment,
            started_s=self._segment_s,
            has_flown=self._has_flown,
            paused=self._paused,
            is_tracking=self._is_tracking,
        )

    @property
    def is_stored(self) -> bool:
        """Whether a broker that is killed now knows all of it again."""
        return self.tracker.is_stored(self.record)

    def recall(self, record: RecoveryRecord) -> None:
        """Restore what an earlier run of the broker has noted."""
        both = merge_records(record, self.record)
        self.overrides.plans, self.overrides.values = dict(both.plans), dict(both.values)
        self.parameters.load(both.borrowed)
        self.hover.recall(both.hover, both.hover_mode)
        self._return, self._live = both.pending_return, both.live
        self._abort = both.abort
        self._segment, self._segment_s = both.started, both.started_s
        self._has_flown = both.has_flown
        self._paused = both.paused
        self._is_tracking, self._is_of_earlier_run = both.is_tracking, record.is_tracking

    def forget(self) -> None:
        """Begin anew with another vehicle in place of this one; aborts are for it too."""
        self.overrides, self.parameters = VehicleOverrides(), ParameterOverrider()
        self.hover.end()
        self._return = self._paused = None
        self.clear_tracking()
        self.clear_commands()
