"""Flies one turn round the subject that the camera tracks, the nose to it.

    STILL --the subject leaves the centre--> MOVING --one turn--> over
    STILL --one turn--> over              refused --> reason

Round a subject that rests the vehicle flies its own orbit (DO_ORBIT). It stops on the circle before
it starts the orbit, and so could never keep up with a centre that moves: round a moving subject the
broker sends a DO_REPOSITION, twice a second or once a round trip, to a point ahead of the vehicle
on the circle round the predicted position of the subject.
"""

import math
from typing import Final, NamedTuple

from afarcloud.geodesy import distance_m, offset, shifted
from mavlink_broker.live.orbit import TurnAngle
from mavlink_broker.live.series import heading_command, reposition_command
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    Command,
    CommandInt,
    CommandSequence,
    Refused,
)
from mavlink_broker.planning.live_actions import Turned
from mavlink_broker.planning.situation import Spot
from mavlink_broker.vehicle.vehicle import Vehicle

RADIUS_M: Final = (5.0, 40.0)
SPEED_M_S: Final = (3.0, 5.0)
"""Along the circle, the faster the larger it is."""
TURN_WITHIN_S: Final = 50.0
REPOSITION_EVERY_S: Final = 0.5
AHEAD_S: Final = 2.5
"""The point is so far ahead that the vehicle does not slow down."""
MAX_AHEAD_RAD: Final = 0.8
MOVED_M: Final = 3.0
"""A subject so far from the centre of the circle moves."""
_FULL_TURN_RAD: Final = 2.0 * math.pi


class Subject(NamedTuple):
    """Position and velocity of what the camera tracks."""

    latitude_deg: float
    longitude_deg: float
    velocity_ned_m_s: tuple[float, float, float]


class QuickShot:
    """One clockwise turn, at the distance that the subject has at the beginning."""

    def __init__(
        self, subject: Subject, here: Spot, vehicle: Vehicle, *, maximum_speed_m_s: float
    ) -> None:
        self._vehicle = vehicle
        self._height_m = here.relative_altitude_m
        smallest, largest = RADIUS_M
        away_m = distance_m(*subject[:2], here.latitude_deg, here.longitude_deg)
        self._radius_m = min(max(away_m, smallest), largest)
        slowest, fastest = SPEED_M_S
        needed_m_s = _FULL_TURN_RAD * self._radius_m / TURN_WITHIN_S
        self._maximum_speed_m_s = maximum_speed_m_s
        self._speed_m_s = min(max(needed_m_s, slowest), fastest, maximum_speed_m_s)
        self._centre = subject
        self._turning = TurnAngle(
            Turned(*subject[:2], self._radius_m, _FULL_TURN_RAD, is_clockwise=True)
        )
        self._sequence: CommandSequence | None = None
        self._moves = False
        self._reposition_at = -math.inf
        self.reason: str | None = None  # Why it has failed

    @property
    def is_over(self) -> bool:
        """Whether the turn is complete."""
        return self._turning.is_complete

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle."""
        messages = [] if self._sequence is None else self._sequence.receive(message, now)
        position = self._vehicle.snapshot.position
        is_turning = self._moves or (
            self._sequence is not None and isinstance(self._sequence.outcome, Accepted)
        )
        if message.get_type() == "GLOBAL_POSITION_INT" and is_turning and position is not None:
            self._turning.take(position.latitude_deg, position.longitude_deg)
        return messages

    def tick(self, subject: Subject, now: float, time_s: float) -> list[Message]:
        """Fly on round the subject.

        Args:
            subject: its last known state.
            now: [s] By the broker's clock.
            time_s: [s] By the vehicle's clock.
        """
        if self.is_over or self.reason is not None:
            return []
        messages = [] if self._sequence is None else self._sequence.tick(now)
        outcome = None if self._sequence is None else self._sequence.outcome
        if isinstance(outcome, Refused):
            self.reason = outcome.reason
            return messages
        self._moves |= distance_m(*self._centre[:2], *subject[:2]) > MOVED_M
        if self._moves:
            self._turning.move_to(subject.latitude_deg, subject.longitude_deg)
        if self._sequence is None and not self._moves:
            return self._send([self._orbit_command()], now)
        if (
            self._moves
            and outcome is not None
            and time_s >= self._reposition_at + REPOSITION_EVERY_S
        ):
            self._reposition_at = time_s
            return [*messages, *self._send(self._commands_ahead(subject), now)]
        return messages

    def _send(self, commands: list[Command | None], now: float) -> list[Message]:
        known = [command for command in commands if command is not None]
        if len(known) < len(commands):
            return []
        self._sequence = self._vehicle.sequence((known,))
        return self._sequence.start(now)

    def _orbit_command(self) -> Command | None:
        home = self._vehicle.snapshot.home
        if home is None:
            return None
        return CommandInt(
            command=mavlink.MAV_CMD_DO_ORBIT,
            frame=mavlink.MAV_FRAME_GLOBAL,
            parameters=(self._radius_m, self._speed_m_s, 0.0, math.nan),
            latitude_deg=self._centre.latitude_deg,
            longitude_deg=self._centre.longitude_deg,
            altitude_m=home.altitude_amsl_m + self._height_m,
        )

    def _commands_ahead(self, subject: Subject) -> list[Command | None]:
        """Reposition along the tangent of the circle, plus the subject's own motion."""
        position, vehicle = self._vehicle.snapshot.position, self._vehicle
        if position is None:
            return [None]
        north_m, east_m = offset(*subject[:2], *position[:2])
        here_rad = math.atan2(east_m, north_m)
        ahead_rad = min(self._speed_m_s * AHEAD_S / self._radius_m, MAX_AHEAD_RAD)
        ahead_s = ahead_rad * self._radius_m / self._speed_m_s
        bearing_rad = here_rad + ahead_rad
        reach_m = self._radius_m / math.cos(ahead_rad)
        to_north_m, to_east_m = (
            reach_m * part + speed * ahead_s
            for part, speed in zip(
                (math.cos(bearing_rad), math.sin(bearing_rad)),
                subject.velocity_ned_m_s[:2],
                strict=True,
            )
        )
        wanted_m_s = math.hypot(to_north_m - north_m, to_east_m - east_m) / ahead_s
        speed_m_s = min(wanted_m_s, self._maximum_speed_m_s)
        towards_deg = math.degrees(math.atan2(to_east_m, to_north_m))
        there = shifted(*subject[:2], towards_deg, math.hypot(to_north_m, to_east_m))
        spot = Spot(*there, self._height_m)
        soon_rad = here_rad + self._speed_m_s * REPOSITION_EVERY_S / self._radius_m
        heading_deg = math.degrees(soon_rad) + 180.0
        commands = [reposition_command(vehicle, spot, heading_deg, speed_m_s=speed_m_s)]
        if vehicle.family.yaw_by_condition:
            commands.append(heading_command(vehicle, spot, heading_deg))
        return commands
