"""What the disk may hold, and what has to go when it is full; pure.

 80 %   receipts of long ago are forgotten, then state_vector and pose are thinned
 95 %   no more pictures
100 %   the oldest of what may be missed goes
105 %   nothing comes in; up to here is the reserve of alarms and mission reports
"""

from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple

THINNED: Final = ("state_vector", "pose")
"""Kinds of which one record per interval tells nearly as much."""
THINNING_INTERVAL_S: Final = 10.0
DROPPED: Final = ("state_vector", "pose", "battery")
"""Kinds whose oldest records may be missed; never an alarm, a report, an observation or a gap."""
URGENT: Final = frozenset({"alarm", "mission_report"})


class Level(IntEnum):
    """How full it is."""

    ROOMY = 0
    THINNING = 1
    NO_PICTURES = 2
    DROPPING = 3
    FULL = 4


_FROM: Final = (
    (1.05, Level.FULL),
    (1.0, Level.DROPPING),
    (0.95, Level.NO_PICTURES),
    (0.8, Level.THINNING),
)


class Usage(NamedTuple):
    """Bytes that are in use; pictures have a budget of their own."""

    data_bytes: int
    picture_bytes: int


def level(used_bytes: float, budget_bytes: float) -> Level:
    """Say how full a budget is."""
    share = used_bytes / budget_bytes
    return next((found for bound, found in _FROM if share >= bound), Level.ROOMY)


def has_room(kind: str, now: Level) -> bool:
    """Whether a record of a kind may come in, when what may go has gone."""
    if kind == "image":
        return now < Level.NO_PICTURES
    return now < Level.DROPPING or (kind in URGENT and now < Level.FULL)


class Sample(NamedTuple):
    """A record that may be thinned out: its row, and when it was taken [s since 1970]."""

    row: int
    taken_at: float


def superfluous(
    samples: Iterable[Sample], last_kept: float | None
) -> tuple[list[int], float | None]:
    """Which rows go so that one per interval stays, the first; in the order of a stream.

    `last_kept` is the interval of the last one that stayed before these; it is returned as it is
    after them. A clock that was set back only makes another interval.
    """
    going = []
    for row, taken_at in samples:
        interval = taken_at // THINNING_INTERVAL_S
        if interval == last_kept:
            going.append(row)
        last_kept = interval
    return going, last_kept
