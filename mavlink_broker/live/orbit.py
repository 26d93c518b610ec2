"""Orbits: those that a vehicle flies by itself, and circles that are flown point by point.

A vehicle that counts its turns ends the orbit by itself, and holds. For one that orbits without end
the positions show the angle that it has flown.

A circle with a heading that the vehicle's own orbit does not support is flown from point to point.
Every point is a DO_REPOSITION, sent before the previous point is reached, so that a vehicle whose
link is lost holds at the next point, which a stream of setpoints would not ensure. The points are
so close that the chords stay within 0.25 m of the circle.
"""

import math
from dataclasses import replace
from typing import Final

from afarcloud.enumerations import OrbitType
from afarcloud.geodesy import distance_m, offset, shifted
from afarcloud.route import Spot
from mavlink_broker.autopilots.families import OrbitMethod
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.live.series import heading_command, reposition_command
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.command import Accepted, Command, CommandSequence, Refused
from mavlink_broker.planning.situation import Circled, Pose, Turned, speed_command
from mavlink_broker.vehicle.recovery_state import LiveCommandProgress
from mavlink_broker.vehicle.vehicle import Vehicle

COMPLETE_AT: Final = 0.99
"""Share of a turn at which it is ended: the vehicle needs some time to stop."""
GAP_S: Final = 2.5
"""After such a gap between positions, by its own clock, the angle is not known."""
COUNTED_FROM: Final = 0.7
"""A vehicle that holds after this share of a turn has ended the turn by itself."""
MAX_DEVIATION_M: Final = 0.25
MAX_STEP_DEG: Final = 15.0
AHEAD_S: Final = 0.8
"""Flight time before a point at which the next one is sent: some round trips, and the time to slow
down."""
NEAR_M: Final = 1.0
HEADING_OFFSET_DEG: Final = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 90.0,
    OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS: -90.0,
    OrbitType.TOWARDS_HOT_POINT: 180.0,
    OrbitType.AWAY_FROM_HOT_POINT: 0.0,
}
"""Heading minus the bearing from the centre on a clockwise circle; else its negative."""


class TurnAngle:
    """Sums up the angle that a vehicle flies round a centre."""

    def __init__(self, end: Turned) -> None:
        self._end = end
        self._bearing: float | None = None
        self._first: float | None = None  # Bearing at which an earlier run began
        self._flown_rad = 0.0  # Since then, estimated from the time
        self.turned_rad = 0.0

    def move_to(self, latitude_deg: float, longitude_deg: float) -> None:
        """Move the centre; the angle so far counts."""
        self._end = replace(self._end, latitude_deg=latitude_deg, longitude_deg=longitude_deg)

    def resume(self, start: Pose, elapsed_s: float) -> None:
        """Continue the turn that was begun there, on the circle, `elapsed_s` ago.

        The next position gives the angle within a turn, and the time the number of full turns.
        """
        end = self._end
        self._flown_rad = end.speed_m_s / end.radius_m * elapsed_s
        north, east = offset(end.latitude_deg, end.longitude_deg, *start[:2])
        self._first = math.atan2(east, north)

    def take(self, latitude_deg: float, longitude_deg: float) -> None:
        """Add a position; a position off the circle does not count."""
        end = self._end
        north, east = offset(end.latitude_deg, end.longitude_deg, latitude_deg, longitude_deg)
        bearing, distance = math.atan2(east, north), math.hypot(north, east)
        if abs(distance - end.radius_m) > max(2.0, 0.3 * end.radius_m):
            self._bearing = None
            return
        if self._bearing is not None:
            step = math.remainder(bearing - self._bearing, math.tau)
            self.turned_rad += step if end.is_clockwise else -step
        elif self._first is not None:
            self._count_earlier(bearing, self._first)
        self._bearing, self._first = bearing, None

    def _count_earlier(self, bearing: float, first: float) -> None:
        """Add the angle that ends at this bearing and is nearest to the estimate."""
        direction = 1.0 if self._end.is_clockwise else -1.0
        ahead = direction * (bearing - first) % (math.tau)
        turns = round((self._flown_rad - ahead) / (math.tau))
        self.turned_rad = max(0.0, ahead + turns * math.tau)

    @property
    def is_on_circle(self) -> bool:
        """Whether the last position was on the circle."""
        return self._bearing is not None

    @property
    def share(self) -> float:
        """The share that was flown, 1 for all; 0 of a turn without an end."""
        return self.turned_rad / self._end.angle_rad

    @property
    def is_complete(self) -> bool:
        """Whether the angle was flown, except for the angle that it takes to stop."""
        return self.turned_rad >= COMPLETE_AT * self._end.angle_rad


class OrbitMonitor:
    """One turn; `resumed` if the vehicle had begun it before this broker started."""

    steps = 0  # It is one
    reason: str | None = None  # It cannot fail
    note: str | None = None

    def __init__(self, end: Turned, vehicle: Vehicle, *, resumed: bool) -> None:
        self._vehicle = vehicle
        self._turning = TurnAngle(end)
        self.start: Pose | None = None  # Where it reached the circle
        self._was_guided = resumed
        self._was_circling = False  # Without end, until a command ends it
        self._is_counted = not resumed  # There is no gap between its positions
        self._position_s: float | None = None

    def resume(self, note: LiveCommandProgress) -> None:
        """Continue the turn that an earlier run of the broker has seen begin.

        A turn counts anew of a vehicle that it has not seen on the circle: that may have been on
        its leg there for any time.
        """
        time_s, self.start = self._vehicle.snapshot.time_s, note.start
        since_s = note.accepted_s if note.start_s is None else note.start_s
        if note.start is not None and time_s is not None and since_s is not None:
            self._turning.resume(note.start, max(0.0, time_s - since_s))

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a position."""
        del now
        position = self._vehicle.snapshot.position
        if message.get_type() == "GLOBAL_POSITION_INT" and position is not None:
            self._check_gap(self._vehicle.snapshot.time_s)
            self._turning.take(position.latitude_deg, position.longitude_deg)
            if self.start is None and self._turning.is_on_circle:
                self.start = Pose(*position[:3])
        return []

    def _check_gap(self, time_s: float | None) -> None:
        """Mark the turn as not counted after a gap between positions."""
        before, self._position_s = self._position_s, time_s
        if time_s is None or (before is not None and time_s - before > GAP_S):
            self._is_counted = False

    def tick(self, now: float) -> list[Message]:
        """Do what is due at a time."""
        del now
        is_guided = self._vehicle.mode_role is ModeRole.GUIDED
        self._was_guided |= is_guided
        self._was_circling |= is_guided and self._vehicle.family.orbiting is OrbitMethod.ENDLESS
        return []

    @property
    def is_over(self) -> bool:
        """Whether the turn is complete, or the vehicle has ended it by itself."""
        return self._turning.is_complete or self.has_released

    @property
    def has_released(self) -> bool:
        """Whether a vehicle that counts its turns has ended the turn by itself.

        For one that does not an earlier run of the broker may have ended it.
        """
        is_over = self._was_guided and not self._was_circling and not self._is_cut_short
        return is_over and self._vehicle.mode_role is ModeRole.HOLD

    @property
    def has_left(self) -> bool:
        """Whether the vehicle holds before its turn is over: it was paused."""
        has_begun = self._was_circling or (self._was_guided and self._is_cut_short)
        return has_begun and self._vehicle.mode_role is ModeRole.HOLD

    @property
    def _is_cut_short(self) -> bool:
        """Whether its positions prove that the turn is not complete."""
        return self._is_counted and self._turning.share < COUNTED_FROM


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
        self.steps = 0
        """The number of points that were reached."""
        self._count = point_count(end.turn.radius_m)
        self.start: Pose | None = None  # Its pose at the beginning
        self._sequence: CommandSequence | None = None
        self.reason: str | None = None  # Why it has failed
        self.note: str | None = None

    def resume(self, note: LiveCommandProgress) -> None:
        """Continue with the point that an earlier run of the broker has sent."""
        if note.start is not None:
            self._begin_at(note.start)
            self.steps = note.steps

    @property
    def is_over(self) -> bool:
        """Whether the last point, which is the first one, was reached."""
        return self.steps > self._count

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle."""
        return [] if self._sequence is None else self._sequence.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Send the next point when this one is near."""
        if self.is_over or self.reason is not None:
            return []
        if self._first is None:
            if self._vehicle.pose is None:
                return []
            self._begin_at(self._vehicle.pose)
        if self._sequence is None:
            return self._begin(now)
        messages = self._sequence.tick(now)
        match self._sequence.outcome:
            case Refused(reason):
                self.reason = reason
            case Accepted() if self._is_near():
                self.steps += 1
                self._sequence = None
        return messages

    def _begin_at(self, start: Pose) -> None:
        turn, self.start = self._end.turn, start
        north_m, east_m = offset(turn.latitude_deg, turn.longitude_deg, *start[:2])
        self._first = math.degrees(math.atan2(east_m, north_m)), start.heading_deg

    def _begin(self, now: float) -> list[Message]:
        spot, heading_deg = self._point()
        vehicle = self._vehicle
        go = reposition_command(vehicle, spot, heading_deg, speed_m_s=self._end.speed_m_s)
        commands: list[Command | None] = [go]
        if vehicle.family.speed_by_command and self.steps == 0:
            commands.append(speed_command(self._end.speed_m_s))
        if vehicle.family.yaw_by_condition:
            commands.append(heading_command(vehicle, spot, heading_deg))
        known = [command for command in commands if command is not None]
        if len(known) < len(commands):
            self.reason = "the vehicle's home is not known"
            return []
        self._sequence = vehicle.sequence((known,))
        return self._sequence.start(now)

    def _point(self) -> tuple[Spot, float]:
        """Give the point that the vehicle flies to, and the heading there."""
        bearing_deg, first_heading_deg = self._first or (0.0, 0.0)
        turn, direction = self._end.turn, 1.0 if self._end.turn.is_clockwise else -1.0
        bearing_deg += direction * 360.0 * self.steps / self._count
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
        last = self.steps == self._count
        near_m = NEAR_M if last else max(NEAR_M, AHEAD_S * self._end.speed_m_s)
        return distance_m(*position[:2], *spot[:2]) <= near_m
