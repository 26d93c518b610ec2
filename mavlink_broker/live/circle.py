"""Flies a circle from point to point, with a heading that the vehicle's own orbit does not support.

Every point is a DO_REPOSITION, sent before the previous point is reached, so that a vehicle whose
link is lost holds at the next point, which a stream of setpoints would not ensure. The points are
so close that the chords stay within 0.25 m of the circle.
"""

import math
from typing import Final

from afarcloud.enumerations import OrbitType
from afarcloud.geodesy import distance_m, offset, shifted
from mavlink_broker.live.series import heading_command, reposition_command
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.command import Accepted, Command, CommandSequence, Refused
from mavlink_broker.planning.live_actions import Circled, speed_command
from mavlink_broker.planning.situation import Spot
from mavlink_broker.recovery.record import LiveCommandProgress, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

MAX_DEVIATION_M: Final = 0.25
MAX_STEP_DEG: Final = 15.0
AHEAD_S: Final = 0.8
"""The next point is sent so long before: some round trips, and the time to slow down."""
NEAR_M: Final = 1.0
HEADING_OFFSET_DEG: Final = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 90.0,
    OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS: -90.0,
    OrbitType.TOWARDS_HOT_POINT: 180.0,
    OrbitType.AWAY_FROM_HOT_POINT: 0.0,
}
"""Heading minus the bearing from the centre on a clockwise circle; else its negative."""


def point_count(radius_m: float) -> int:
    """Give the number of points of a full turn."""
    near_deg = 2.0 * math.degrees(math.acos(1.0 - MAX_DEVIATION_M / radius_m))
    return math.ceil(360.0 / min(near_deg, MAX_STEP_DEG))


class CircleExecutor:
    """One turn, from the point of the circle that is nearest at its beginning."""

    def __init__(self, end: Circled, vehicle: Vehicle) -> None:
        self._end = end
        self._vehicle = vehicle
        self._first: tuple[float, float] | None = None  # Bearing from the centre, heading [deg]
        self._number = 0
        self._count = point_count(end.turn.radius_m)
        self.start: Pose | None = None  # Its pose at the beginning
        self._sequence: CommandSequence | None = None
        self.reason: str | None = None  # Why it has failed
        self.note: str | None = None

    def resume(self, note: LiveCommandProgress) -> None:
        """Continue with the point that an earlier run of the broker has sent."""
        if note.start is not None:
            self._begin_at(note.start)
            self._number = note.steps

    @property
    def steps(self) -> int:
        """The number of points that were reached."""
        return self._number

    @property
    def is_over(self) -> bool:
        """Whether the last point, which is the first one, was reached."""
        return self._number > self._count

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle."""
        return [] if self._sequence is None else self._sequence.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Send the next point when this one is near."""
        if self.is_over or self.reason is not None:
            return []
        if self._first is None and not self._find_start():
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

    def _find_start(self) -> bool:
        position, attitude = self._vehicle.snapshot.position, self._vehicle.snapshot.attitude
        if position is None or attitude is None:
            return False
        self._begin_at(Pose(*position[:3], attitude.yaw_deg))
        return True

    def _begin_at(self, start: Pose) -> None:
        turn, self.start = self._end.turn, start
        north_m, east_m = offset(turn.latitude_deg, turn.longitude_deg, *start[:2])
        self._first = math.degrees(math.atan2(east_m, north_m)), start.heading_deg

    def _begin(self, now: float) -> list[Message]:
        spot, heading_deg = self._point()
        vehicle = self._vehicle
        go = reposition_command(vehicle, spot, heading_deg, speed_m_s=self._end.speed_m_s)
        commands: list[Command | None] = [go]
        if vehicle.family.speed_by_command and self._number == 0:
            commands.append(speed_command(self._end.speed_m_s))
        if vehicle.family.yaw_by_condition:
            commands.append(heading_command(vehicle, spot, heading_deg))
        known = [command for command in commands if command is not None]
        if len(known) < len(commands):
            self.reason = "the vehicle's home is not known"
            return []
        self._sequence = CommandSequence((known,), vehicle.route, vehicle.round_trip)
        return self._sequence.start(now)

    def _point(self) -> tuple[Spot, float]:
        """Give the point that the vehicle flies to, and the heading there."""
        bearing_deg, first_heading_deg = self._first or (0.0, 0.0)
        turn, direction = self._end.turn, 1.0 if self._end.turn.is_clockwise else -1.0
        bearing_deg += direction * 360.0 * self._number / self._count
        place = shifted(turn.latitude_deg, turn.longitude_deg, bearing_deg, turn.radius_m)
        spot = Spot(*place, self._end.height_m)
        offset_deg = HEADING_OFFSET_DEG.get(self._end.heading)
        if offset_deg is None:
            return spot, first_heading_deg
        half_way_deg = bearing_deg - direction * 180.0 / self._count  # The mean of the two bearings
        return spot, half_way_deg + direction * offset_deg

    def _is_near(self) -> bool:
        position = self._vehicle.snapshot.position
        if position is None:
            return False
        spot, _ = self._point()
        last = self._number == self._count
        near_m = NEAR_M if last else max(NEAR_M, AHEAD_S * self._end.speed_m_s)
        return distance_m(*position[:2], *spot[:2]) <= near_m
