"""Flies a circle from point to point, where a vehicle's own circle knows no such heading.

Every point is an order of its own (DO_REPOSITION), given before the last one is reached, so that a
vehicle whose link is lost holds at the next point instead of falling out of a stream of set-points.
The points are so close that the chords stay within 0.25 m of the circle.
"""

import math
from typing import Final

from afarcloud.enumerations import OrbitType
from afarcloud.geodesy import distance_m, offset, shifted
from mavlink_broker.live.series import heading_order, way_order
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.command import Accepted, Command, Refused
from mavlink_broker.microservices.command_sequence import CommandSequence
from mavlink_broker.planning.live_actions import Circled, speed_order
from mavlink_broker.planning.situation import Spot
from mavlink_broker.recovery.record import LiveNote, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

OFF_THE_CIRCLE_M: Final = 0.25
LARGEST_STEP_DEG: Final = 15.0
AHEAD_S: Final = 0.8
"""How long before a point the next one is told: some round trips, and the time to slow down."""
NEAR_M: Final = 1.0
NOSE_DEG: Final = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 90.0,
    OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS: -90.0,
    OrbitType.TOWARDS_HOT_POINT: 180.0,
    OrbitType.AWAY_FROM_HOT_POINT: 0.0,
}
"""Heading less the bearing from the centre on a clockwise circle; on the other its negative."""


def points(radius_m: float) -> int:
    """How many points a full turn has."""
    near_deg = 2.0 * math.degrees(math.acos(1.0 - OFF_THE_CIRCLE_M / radius_m))
    return math.ceil(360.0 / min(near_deg, LARGEST_STEP_DEG))


class CircleRunner:
    """One turn, from the point of the circle that is nearest when it begins."""

    def __init__(self, end: Circled, vehicle: Vehicle) -> None:
        self._end = end
        self._vehicle = vehicle
        self._first: tuple[float, float] | None = None  # Bearing from the centre, heading [deg]
        self._number = 0
        self._count = points(end.turn.radius_m)
        self.start: Pose | None = None  # Where it was when it began
        self._sequence: CommandSequence | None = None
        self.reason: str | None = None  # Why it cannot go on
        self.note: str | None = None

    def resume(self, note: LiveNote) -> None:
        """Go on to the point that an earlier run of the broker has sent it to."""
        if note.start is not None:
            self._begin_at(note.start)
            self._number = note.steps

    @property
    def steps(self) -> int:
        """How many points have been reached."""
        return self._number

    @property
    def is_over(self) -> bool:
        """Whether the last point, which is the first one, has been reached."""
        return self._number > self._count

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        return [] if self._sequence is None else self._sequence.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Let time pass: give the next point when this one is near."""
        if self.is_over or self.reason is not None:
            return []
        if self._first is None and not self._look_round():
            return []
        if self._sequence is None:
            return self._begin(now)
        messages = self._sequence.tick(now)
        match self._sequence.outcome:
            case Refused(reason):
                self.reason = reason
            case Accepted() if self._is_near():
                self._number += 1
                self._sequence = None
        return messages

    def _look_round(self) -> bool:
        place, attitude = self._vehicle.snapshot.position, self._vehicle.snapshot.attitude
        if place is None or attitude is None:
            return False
        self._begin_at(Pose(*place[:3], attitude.yaw_deg))
        return True

    def _begin_at(self, start: Pose) -> None:
        turn, self.start = self._end.turn, start
        north_m, east_m = offset(turn.latitude_deg, turn.longitude_deg, *start[:2])
        self._first = math.degrees(math.atan2(east_m, north_m)), start.heading_deg

    def _begin(self, now: float) -> list[Message]:
        spot, heading_deg = self._point()
        vehicle = self._vehicle
        go = way_order(vehicle, spot, heading_deg, speed_m_s=self._end.speed_m_s)
        orders: list[Command | None] = [go]
        if vehicle.family.speed_by_order and self._number == 0:
            orders.append(speed_order(self._end.speed_m_s))
        if vehicle.family.yaw_by_condition:
            orders.append(heading_order(vehicle, spot, heading_deg))
        known = [order for order in orders if order is not None]
        if len(known) < len(orders):
            self.reason = "the vehicle's home is not known"
            return []
        self._sequence = CommandSequence((known,), vehicle.route, vehicle.round_trip)
        return self._sequence.start(now)

    def _point(self) -> tuple[Spot, float]:
        """Give the point that is being flown to, and the heading there."""
        bearing_deg, first_heading_deg = self._first or (0.0, 0.0)
        turn, sense = self._end.turn, 1.0 if self._end.turn.is_clockwise else -1.0
        bearing_deg += sense * 360.0 * self._number / self._count
        place = shifted(turn.latitude_deg, turn.longitude_deg, bearing_deg, turn.radius_m)
        spot = Spot(*place, self._end.height_m)
        nose_deg = NOSE_DEG.get(self._end.heading)
        if nose_deg is None:
            return spot, first_heading_deg
        half_way_deg = bearing_deg - sense * 180.0 / self._count  # On its way there it turns less
        return spot, half_way_deg + sense * nose_deg

    def _is_near(self) -> bool:
        place = self._vehicle.snapshot.position
        if place is None:
            return False
        spot, _ = self._point()
        last = self._number == self._count
        near_m = NEAR_M if last else max(NEAR_M, AHEAD_S * self._end.speed_m_s)
        return distance_m(*place[:2], *spot[:2]) <= near_m
