"""A true track, and the figures that are read off it.

Positions are metres north and east of where the vehicle stood and above that place, along the
WGS-84 ellipsoid, so that a commanded latitude and longitude is one point of the frame. All
figures are means over time: the track is sampled evenly, at 50 Hz.

Cross-track error: the horizontal distance from the true position to the nearest point of the
outline that the straight legs form. Rounding a corner counts with the distance to the nearer of
its two legs; flying past a corner counts with the distance to the corner. Mid-leg is the middle
half of each leg. Overshoot: how far the track leaves the convex hull of the legs.

"By estimate" is the same of where the vehicle took itself to be: what the control leaves, without
the receiver's own error.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from tests.support.autopilot_tester import AutopilotTester

Place = tuple[float, float]
"""Metres north and east."""

_EVERY_STEPS = 5
_OFF_THE_GROUND_M = 0.03


class Sample(NamedTuple):
    """The truth at one instant."""

    time_s: float
    north_m: float
    east_m: float
    up_m: float
    sink_m_s: float
    yaw_deg: float


class Track:
    """Begins with its making."""

    def __init__(self, tester: AutopilotTester) -> None:
        self.samples: list[Sample] = []
        self.believed: list[Place] = []  # Where the vehicle takes itself to be at these times
        self._tester = tester
        self._steps = 0
        tester.watch(self._note)

    def _note(self) -> None:
        self._steps += 1
        if self._steps % _EVERY_STEPS:
            return
        truth = self._tester.truth
        position = self._tester.true_position()
        place = self._tester.autopilot.topics.vehicle_global_position.value
        if place is None:
            return
        self.believed.append(self._tester.north_east_m(place.latitude_deg, place.longitude_deg))
        self.samples.append(
            Sample(truth.time_us * 1e-6, *position, truth.velocity_ned[2], truth.yaw_deg)
        )

    def last_believed(self, seconds: float) -> list[Place]:
        """The newest part of where the vehicle took itself to be."""
        return self.believed[-len(self.last(seconds)) :]

    def last(self, seconds: float) -> list[Sample]:
        """The newest part."""
        begin_s = self.samples[-1].time_s - seconds
        return [sample for sample in self.samples if sample.time_s > begin_s]


def rms(values: Iterable[float]) -> float:
    """Root of the mean square."""
    squares = [value * value for value in values]
    return math.sqrt(sum(squares) / len(squares))


def places(samples: Iterable[Sample]) -> list[Place]:
    """Where the samples are, metres north and east."""
    return [(sample.north_m, sample.east_m) for sample in samples]


def horizontal_rms(track: Iterable[Place], place: Place) -> float:
    """Horizontal distance [m] from a place, root mean square."""
    return rms(math.dist(at, place) for at in track)


def vertical_rms(samples: Iterable[Sample], height_m: float) -> float:
    """Vertical distance [m] from a height, root mean square."""
    return rms(s.up_m - height_m for s in samples)


def cross_track(track: Iterable[Place], outline: Sequence[Place]) -> list[float]:
    """Horizontal distance [m] of each place from a line through these corners."""
    legs = list(pairwise(outline))
    return [min(_off_leg(at, *leg)[0] for leg in legs) for at in track]


def mid_leg_cross_track(track: Iterable[Place], outline: Sequence[Place]) -> list[float]:
    """As `cross_track`, of those places only that are nearest to the middle half of a leg."""
    legs = list(pairwise(outline))
    nearest = (min(_off_leg(at, *leg) for leg in legs) for at in track)
    return [distance for distance, share in nearest if 0.25 <= share <= 0.75]


def _off_leg(place: Place, start: Place, end: Place) -> tuple[float, float]:
    """Distance [m] from a leg, and at which share of it its nearest point lies."""
    along = (end[0] - start[0], end[1] - start[1])
    to_place = (place[0] - start[0], place[1] - start[1])
    share = (along[0] * to_place[0] + along[1] * to_place[1]) / math.hypot(*along) ** 2
    share = min(max(share, 0.0), 1.0)
    nearest = (start[0] + share * along[0], start[1] + share * along[1])
    return math.dist(place, nearest), share


def overshoot(samples: Iterable[Sample], side_m: float) -> float:
    """How far [m] the track leaves the square from the start to (side, side)."""
    return max(
        max(-s.north_m, -s.east_m, s.north_m - side_m, s.east_m - side_m, 0.0) for s in samples
    )


def touch_down(samples: Sequence[Sample]) -> Sample:
    """The last sample above the ground on which the vehicle started."""
    return next(s for s in reversed(samples) if s.up_m > _OFF_THE_GROUND_M)
