"""What must be known of a vehicle again after the broker's death; plain values, nothing else.

What is borrowed of it, whose hover it is in, an order that it has not obeyed yet, and how far a
live command is. Everything else can be asked for again: the missions of the edge server, the rest
of the vehicle.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from mavlink_broker.microservices.borrowed_config import ExchangedPlan
from mavlink_broker.microservices.borrowed_parameters import Borrowed


class Owner(NamedTuple):
    """Whose page it is: another vehicle under the same system id has another one."""

    system: int
    uid: str  # Hexadecimal, of AUTOPILOT_VERSION; empty where the vehicle tells none

    def __str__(self) -> str:
        """Say it for people."""
        return f"system {self.system}" + (f" ({self.uid})" if self.uid else "")


class Pose(NamedTuple):
    """Where a vehicle was, and where its nose pointed."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # Above home
    heading_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Homeward:
    """An alarm has failed a mission, and the vehicle has not come round to going home yet."""

    mission: str  # Name of the work
    reason: str
    noted_s: float | None = None  # By the vehicle's clock, since it was switched on


@dataclass(frozen=True, slots=True, kw_only=True)
class AbortNote:
    """An abort that was accepted, and that the vehicle has not obeyed yet."""

    work_id: int  # Of the event
    event_type: int  # Of AFarCloud's: 1 abort, 2 soft abort
    point: Pose | None = None  # Where the vehicle is to go first
    noted_s: float | None = None  # By the vehicle's clock, since it was switched on


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveNote:
    """How far a live command is. Times are the vehicle's own, since it was switched on [s]."""

    name: str  # Of the command, for good
    is_agreed: bool = False  # Else the vehicle is about to be told, and may have been
    began_s: float | None = None  # When it set out; None: the vehicle tells no time
    going_s: float | None = None  # When the vehicle agreed
    start: Pose | None = None  # Where its steps count from
    steps: int = 0  # Taken: turns, pictures, points of a circle


@dataclass(frozen=True, slots=True, kw_only=True)
class Memo:
    """All of it, of one vehicle; kinds of plan are MAV_MISSION_TYPEs."""

    plans: Mapping[int, ExchangedPlan] = field(default_factory=dict)
    values: Mapping[str, Borrowed] = field(default_factory=dict)  # Guarding a fence
    borrowed: Mapping[str, Borrowed] = field(default_factory=dict)  # For a command
    hover: Pose | None = None  # It waits there for its next mission
    homeward: Homeward | None = None
    abort: AbortNote | None = None
    live: LiveNote | None = None
    started: str | None = None  # First command of the items that it was ordered to fly last


NOTHING: Final = Memo()


def merged(earlier: Memo, later: Memo) -> Memo:
    """Put two memos of one vehicle together.

    What was there before the earlier one is what was there; both have set what is there now.
    """
    plans = {
        kind: ExchangedPlan(earlier.plans[kind].before, plan.placed)
        for kind, plan in later.plans.items()
        if kind in earlier.plans
    }
    return Memo(
        plans={**earlier.plans, **later.plans, **plans},
        values=_merged_values(earlier.values, later.values),
        borrowed=_merged_values(earlier.borrowed, later.borrowed),
        hover=later.hover or earlier.hover,
        homeward=later.homeward or earlier.homeward,
        abort=later.abort or earlier.abort,
        live=later.live or earlier.live,
        started=later.started or earlier.started,
    )


def _merged_values(
    earlier: Mapping[str, Borrowed], later: Mapping[str, Borrowed]
) -> dict[str, Borrowed]:
    both = dict(earlier)
    for name, borrowed in later.items():
        both[name] = borrowed
        if name in earlier:
            placed = (*earlier[name].placed, *borrowed.placed)
            both[name] = Borrowed(earlier[name].before, tuple(dict.fromkeys(placed)))
    return both
