"""Goes once round what the camera tracks, the nose to it: a subject that rests, or one that moves.

    STILL --the subject leaves the middle--> MOVING --once round--> over
    STILL --once round--> over              refused --> reason

Round a subject that rests the vehicle flies its own circle (DO_ORBIT). It comes to rest on its
circle before it goes round, and so could never keep up with a middle that moves: round such a
subject it is led (DO_REPOSITION), from twice a second to once a round trip, to a point that lies
ahead of it on the circle about where the subject will be by then.
"""

import math
from typing import Final, NamedTuple

from afarcloud.geodesy import distance_m, offset, shifted
from mavlink_broker.live.series import heading_order, way_order
from mavlink_broker.live.turn_angle import Turning
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Accepted, Command, CommandInt, Refused
from mavlink_broker.microservices.command_sequence import CommandSequence
from mavlink_broker.planning.live_actions import Turned
from mavlink_broker.planning.situation import Spot
from mavlink_broker.vehicle.vehicle import Vehicle

RADIUS_M: Final = (5.0, 40.0)
SPEED_M_S: Final = (3.0, 5.0)
"""Along the circle, the faster the larger it is."""
TURN_WITHIN_S: Final = 50.0
LED_EVERY_S: Final = 0.5
AHEAD_S: Final = 2.5
"""So far ahead lies the point that a vehicle is led to: it does not slow down on its way."""
AHEAD_MOST_RAD: Final = 0.8
AWAY_M: Final = 3.0
"""A subject so far from the middle of the circle has left it."""
_FULL_TURN_RAD: Final = 2.0 * math.pi


class Subject(NamedTuple):
    """What the camera tracks."""

    latitude_deg: float
    longitude_deg: float
    velocity_ned_m_s: tuple[float, float, float]


class QuickShot:
    """One turn, as far off as the subject is when it begins, clockwise."""

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
        self._middle = subject
        self._turning = Turning(
            Turned(*subject[:2], self._radius_m, _FULL_TURN_RAD, is_clockwise=True)
        )
        self._sequence: CommandSequence | None = None
        self._moves = False
        self._led_at = -math.inf
        self.reason: str | None = None  # Why no circle can be flown

    @property
    def is_over(self) -> bool:
        """Whether it has gone round."""
        return self._turning.is_complete

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        messages = [] if self._sequence is None else self._sequence.receive(message, now)
        place = self._vehicle.snapshot.position
        goes = self._moves or (
            self._sequence is not None and isinstance(self._sequence.outcome, Accepted)
        )
        if message.get_type() == "GLOBAL_POSITION_INT" and goes and place is not None:
            self._turning.take(place.latitude_deg, place.longitude_deg)
        return messages

    def tick(self, subject: Subject, now: float, time_s: float) -> list[Message]:
        """Let time pass: go round where the subject is.

        Args:
            subject: where it was seen last.
            now: [s] Of this program.
            time_s: [s] Of the vehicle.
        """
        if self.is_over or self.reason is not None:
            return []
        messages = [] if self._sequence is None else self._sequence.tick(now)
        outcome = None if self._sequence is None else self._sequence.outcome
        if isinstance(outcome, Refused):
            self.reason = outcome.reason
            return messages
        self._moves |= distance_m(*self._middle[:2], *subject[:2]) > AWAY_M
        if self._moves:
            self._turning.move_to(subject.latitude_deg, subject.longitude_deg)
        if self._sequence is None and not self._moves:
            return self._order([self._circle()], now)
        if self._moves and outcome is not None and time_s >= self._led_at + LED_EVERY_S:
            self._led_at = time_s
            return [*messages, *self._order(self._lead(subject), now)]
        return messages

    def _order(self, commands: list[Command | None], now: float) -> list[Message]:
        known = [command for command in commands if command is not None]
        if len(known) < len(commands):
            return []
        self._sequence = CommandSequence((known,), self._vehicle.route, self._vehicle.round_trip)
        return self._sequence.start(now)

    def _circle(self) -> Command | None:
        home = self._vehicle.snapshot.home
        if home is None:
            return None
        return CommandInt(
            command=mavlink.MAV_CMD_DO_ORBIT,
            frame=mavlink.MAV_FRAME_GLOBAL,
            parameters=(self._radius_m, self._speed_m_s, 0.0, math.nan),
            latitude_deg=self._middle.latitude_deg,
            longitude_deg=self._middle.longitude_deg,
            altitude_m=home.altitude_amsl_m + self._height_m,
        )

    def _lead(self, subject: Subject) -> list[Command | None]:
        """To where the tangent of the circle leads, and on by the subject's own way."""
        place, vehicle = self._vehicle.snapshot.position, self._vehicle
        if place is None:
            return [None]
        north_m, east_m = offset(*subject[:2], *place[:2])
        here_rad = math.atan2(east_m, north_m)
        ahead_rad = min(self._speed_m_s * AHEAD_S / self._radius_m, AHEAD_MOST_RAD)
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
        soon_rad = here_rad + self._speed_m_s * LED_EVERY_S / self._radius_m
        heading_deg = math.degrees(soon_rad) + 180.0
        orders = [way_order(vehicle, spot, heading_deg, speed_m_s=speed_m_s)]
        if vehicle.family.yaw_by_condition:
            orders.append(heading_order(vehicle, spot, heading_deg))
        return orders
