"""What a restarted broker has to know of one vehicle, as plain values: `RecoveryRecord`.

It holds the vehicle's overridden configuration, the position where it hovers, a command that it has
not obeyed yet, and the progress of a live command. The broker gets all other state again: the
missions from the edge server, the rest from the vehicle.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from mavlink_broker.microservices.config_overrides import OverriddenParameter, OverriddenPlan
from mavlink_broker.planning.situation import Pose


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
    pending_return: PendingReturn | None = None
    abort: PendingAbort | None = None
    live: LiveCommandProgress | None = None
    started: str | None = None  # First command of the mission items that it was last ordered to fly
    started_s: float | None = None  # When that was, by the vehicle's clock since boot
    has_flown: bool = False  # It was seen to fly them
    paused: str | None = None  # Name of the work that an event has paused
    is_tracking: bool = False  # Its camera may have been ordered to track a subject


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
        pending_return=later.pending_return or earlier.pending_return,
        abort=later.abort or earlier.abort,
        live=later.live or earlier.live,
        started=later.started or earlier.started,
        started_s=later.started_s if later.started else earlier.started_s,
        has_flown=later.has_flown if later.started else earlier.has_flown,
        paused=later.paused or earlier.paused,
        is_tracking=later.is_tracking or earlier.is_tracking,
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
