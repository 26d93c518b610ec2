"""The recovery record of a vehicle: state that the broker needs again after a crash; plain values.

It holds the vehicle's overridden configuration, the position where it hovers, a command that it has
not obeyed yet, and the progress of a live command. The broker gets all other state again: the
missions from the edge server, the rest from the vehicle.

`RecordTracker` knows whether the newest record is on the disk. A command that changes a vehicle
waits until its record is stored; so do the messages to the edge server that follow from it. After a
refusal of the disk nothing waits, after two seconds without an answer neither: a bad disk ends no
flight.

"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from mavlink_broker.microservices.config_overrides import OverriddenParameter, OverriddenPlan

WRITE_TIMEOUT_S: Final = 2.0
_LOG = logging.getLogger(__name__)


class VehicleIdentity(NamedTuple):
    """Identifies the record of a vehicle; other hardware has another one."""

    system: int
    uid: str  # Hexadecimal, of AUTOPILOT_VERSION; empty if the vehicle sends none

    def __str__(self) -> str:
        """Give it as text for the log."""
        return f"system {self.system}" + (f" ({self.uid})" if self.uid else "")


class Pose(NamedTuple):
    """A vehicle's position and heading."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # Above home
    heading_deg: float = 0.0


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
    steps: int = 0  # Completed: turns, pictures, points of a circle


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryRecord:
    """The record of one vehicle; the keys of `plans` are MAV_MISSION_TYPEs."""

    plans: Mapping[int, OverriddenPlan] = field(default_factory=dict)
    values: Mapping[str, OverriddenParameter] = field(default_factory=dict)  # Guarding a fence
    borrowed: Mapping[str, OverriddenParameter] = field(default_factory=dict)  # For a command
    hover: Pose | None = None  # Where it waits for its next mission
    pending_return: PendingReturn | None = None
    abort: PendingAbort | None = None
    live: LiveCommandProgress | None = None
    started: str | None = None  # First command of the mission items that it was last ordered to fly
    paused: str | None = None  # Name of the work that an event has paused


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
        pending_return=later.pending_return or earlier.pending_return,
        abort=later.abort or earlier.abort,
        live=later.live or earlier.live,
        started=later.started or earlier.started,
        paused=later.paused or earlier.paused,
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
                "%s: its recovery record cannot be written; commands are sent without it",
                self.identity,
            )
