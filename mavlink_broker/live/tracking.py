"""Follows the subject that the camera tracks: behind it, beside it, round it, or turned to it.

    SEARCHING --SEEN--> FOLLOWING --LOST or OVER--> over
    SEARCHING --NO POSITION--> gimbal alone, until the duration is over

The camera reports whether it tracks (CAMERA_TRACKING_IMAGE_STATUS) and the subject's position
(CAMERA_TRACKING_GEO_STATUS); the broker requests both. If the camera reports no position, the
gimbal alone follows the subject, and a note says so. A subject that is lost for 3 s ends the
command: the vehicle holds.

`QuickShot` flies one turn round the subject, the nose to it. Round a subject that rests the vehicle
flies its own orbit (DO_ORBIT). It stops on the circle before it starts the orbit, and so could
never keep up with a centre that moves: round a moving subject the broker sends a DO_REPOSITION,
twice a second or once a round trip, to a point ahead of the vehicle on the circle round the
predicted position of the subject.

A command that ends as planned has the camera stop. One that ends otherwise (an abort, a failure, a
pause, a restart of the broker) leaves the camera on its subject: its gimbal would turn the pictures
of the next mission there. `TrackingStop` has it stop when no command of the broker needs it any
more.
"""

import logging
import math
from typing import Final, NamedTuple

from afarcloud.enumerations import TrackMode
from afarcloud.geodesy import distance_m, offset, shifted
from afarcloud.route import Spot
from mavlink_broker.autopilots.flight_modes import LIVE_MODES
from mavlink_broker.live.follow_target import target_message
from mavlink_broker.live.orbit import TurnAngle
from mavlink_broker.live.series import StepSeries, heading_command, reposition_command
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    Command,
    CommandAlternatives,
    CommandInt,
    CommandSequence,
    Refused,
)
from mavlink_broker.microservices.message_rates import set_interval
from mavlink_broker.planning.situation import Move, Pose, Tracked, Turned
from mavlink_broker.planning.target_commands import camera_of, stop_tracking
from mavlink_broker.vehicle.recovery_state import LiveCommandProgress
from mavlink_broker.vehicle.vehicle import Vehicle

CIRCLE_RADIUS_M: Final = (5.0, 40.0)
CIRCLE_SPEED_M_S: Final = (3.0, 5.0)
"""Along the circle, the faster the larger it is."""
CIRCLE_WITHIN_S: Final = 50.0
REPOSITION_EVERY_S: Final = 0.5
AHEAD_S: Final = 2.5
"""Flight time to the point, so that the vehicle does not slow down."""
MAX_AHEAD_RAD: Final = 0.8
MOVED_M: Final = 3.0
"""A subject further from the centre of the circle counts as moving."""


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
        smallest, largest = CIRCLE_RADIUS_M
        away_m = distance_m(*subject[:2], here.latitude_deg, here.longitude_deg)
        self._radius_m = min(max(away_m, smallest), largest)
        slowest, fastest = CIRCLE_SPEED_M_S
        needed_m_s = math.tau * self._radius_m / CIRCLE_WITHIN_S
        self._maximum_speed_m_s = maximum_speed_m_s
        self._speed_m_s = min(max(needed_m_s, slowest), fastest, maximum_speed_m_s)
        self._centre = subject
        self._turning = TurnAngle(Turned(*subject[:2], self._radius_m, math.tau, is_clockwise=True))
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


REQUEST_AGAIN_S: Final = 2.0
MAX_REQUESTS: Final = 4
POSITION_TIMEOUT_S: Final = 8.0
LOST_AFTER_S: Final = 3.0
STATUS_EVERY_US: Final = 200_000.0
TARGET_EVERY_S: Final = 0.2
TURN_EVERY_S: Final = 1.0
TURNED_AWAY_DEG: Final = 5.0
QUICK_RETREAT: Final = Move(forward_m=-15.0, up_m=10.0)
"""Flown instead of a circle: backwards and up, the subject in sight."""
STOP_AGAIN_AFTER_S: Final = 10.0
STOP_ATTEMPTS: Final = 5
"""Each attempt repeats its command several times."""

_ACTIVE: Final[int] = mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
_NO_POSITION: Final = 2**31 - 1
_BESIDE: Final = frozenset({TrackMode.TRACE, TrackMode.PROFILE})
_REQUESTED: Final = (
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS,
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
)
TRACKING_MESSAGES: Final = frozenset({"CAMERA_TRACKING_IMAGE_STATUS", "CAMERA_TRACKING_GEO_STATUS"})

_STOPPED: Final = frozenset(
    {mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_UNSUPPORTED}
)
"""Results of a camera that tracks nothing any more; others are repeated."""

_LOG = logging.getLogger(__name__)


class SubjectTracker:
    """One subject, for the duration of a command."""

    def __init__(self, end: Tracked, vehicle: Vehicle) -> None:
        self._end = end
        self._vehicle = vehicle
        self._began_at: float | None = None
        self._searches_since: float | None = None
        self._is_resumed = False
        self.start: Pose | None = None
        """The pose of the vehicle at the beginning."""
        self.steps = 0  # It has none
        self._requests = 0
        self._request_at = -math.inf
        self._subject: Subject | None = None
        self._seen_at: float | None = None
        self._is_following = end.mode is not TrackMode.SPOTLIGHT_PRO
        self._sequence: CommandSequence | None = None
        self._series: StepSeries | None = None
        self._quick_shot: QuickShot | None = None
        self._due_at = -math.inf
        self._faced_deg: float | None = None
        self.is_over = False
        self.reason: str | None = None  # It never fails: without a subject it ends
        self.note: str | None = None

    def resume(self, note: LiveCommandProgress) -> None:
        """Continue the command of an earlier run; its duration includes the time before."""
        self._is_resumed = True
        self._began_at = note.accepted_s if self._vehicle.snapshot.time_s is not None else None
        self.start = note.start

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle or its camera."""
        messages: list[Message] = []
        for running in (self._sequence, self._series, self._quick_shot):
            if running is not None:
                messages += running.receive(message, now)
        match message.get_type():
            case "CAMERA_TRACKING_IMAGE_STATUS" if message.tracking_status == _ACTIVE:
                self._seen_at = self._vehicle.time_s(now)
            case "CAMERA_TRACKING_GEO_STATUS" if message.tracking_status == _ACTIVE:
                self._see(message, now)
        return messages

    def tick(self, now: float) -> list[Message]:
        """Do what is due at a time."""
        time_s = self._vehicle.time_s(now)
        if self._began_at is None:
            self._began_at = time_s
        if self._searches_since is None:
            self._searches_since = time_s
        self.start = self.start or self._vehicle.pose
        messages = [*self._request(time_s), *self._continue(now)]
        if self._is_following:
            messages += self._follow(time_s - self._searches_since, now)
        self._check_end(time_s)
        return messages

    def _see(self, message: Message, now: float) -> None:
        self._seen_at = self._vehicle.time_s(now)
        if _NO_POSITION in {message.lat, message.lon}:
            return
        velocity = (message.vel_n, message.vel_e, message.vel_d)
        known = all(map(math.isfinite, velocity))
        position = message.lat / 1e7, message.lon / 1e7
        self._subject = Subject(*position, velocity if known else (0.0, 0.0, 0.0))

    def _request(self, time_s: float) -> list[Message]:
        """Request the tracking messages, a few times at most: the camera may refuse them."""
        if self._seen_at is not None or self._requests >= MAX_REQUESTS or time_s < self._request_at:
            return []
        self._requests += 1
        self._request_at = time_s + REQUEST_AGAIN_S
        component = camera_of(self._vehicle.family)
        requests = (set_interval(one, STATUS_EVERY_US, component=component) for one in _REQUESTED)
        return [request.message(self._vehicle.route, 0) for request in requests]

    def _continue(self, now: float) -> list[Message]:
        """Continue a command or a series of steps."""
        if self._series is not None:
            messages = self._series.tick(now)
            self.is_over |= self._series.is_over or self._series.reason is not None
            return messages
        if self._sequence is None:
            return []
        messages = self._sequence.tick(now)
        if isinstance(self._sequence.outcome, Refused):
            self._refused(self._sequence.outcome.reason)
        return messages

    def _refused(self, reason: str) -> None:
        self._sequence = None
        if self._end.mode in _BESIDE:
            self._use_gimbal_alone(reason)

    def _follow(self, elapsed_s: float, now: float) -> list[Message]:
        subject = self._subject
        if subject is None:
            if elapsed_s > POSITION_TIMEOUT_S and self._series is None:
                return self._follow_without_position()
            return []
        if self._end.mode in _BESIDE:
            return self._send_target(subject, now)
        if self._end.mode is TrackMode.QUICK_SHOT:
            return self._circle(subject, now)
        return self._turn_to(subject, now)

    def _follow_without_position(self) -> list[Message]:
        if self._end.mode is TrackMode.QUICK_SHOT:
            self._retreat()
        else:
            self._use_gimbal_alone("the camera does not report where the subject is")
        return []

    def _use_gimbal_alone(self, reason: str) -> None:
        self._is_following = False
        self.note = f"track_mode {self._end.mode.name}: {reason}; the gimbal alone keeps to it"

    def _retreat(self) -> None:
        """Fly the quick shot that needs no position of the subject.

        From where the command began: a restarted broker flies no further.
        """
        self._is_following = False
        self.note = "track_mode QUICK_SHOT: backwards and up instead of a circle"
        speed_m_s = self._end.maximum_speed_m_s
        self._series = StepSeries((QUICK_RETREAT,), self._vehicle, speed_m_s=speed_m_s)
        self._series.start = self.start

    def _send_target(self, subject: Subject, now: float) -> list[Message]:
        """Have the vehicle follow, and send it the position of the subject."""
        home, time_s = self._vehicle.snapshot.home, self._vehicle.time_s(now)
        if home is None or time_s < self._due_at:
            return []
        self._due_at = time_s + TARGET_EVERY_S
        spot = Spot(subject.latitude_deg, subject.longitude_deg, self._end.height_m)
        target = target_message(spot, home, now, velocity_ned_m_s=subject.velocity_ned_m_s)
        follows = self._is_resumed and self._vehicle.mode in LIVE_MODES
        is_commanded = self._sequence is not None or follows
        begin = [] if is_commanded else self._send(self._end.follow, now)
        return [target, *begin]

    def _circle(self, subject: Subject, now: float) -> list[Message]:
        position = self._vehicle.snapshot.position
        if self._quick_shot is None:
            if self.start is None or position is None:
                return []
            here = Spot(*position[:2], self.start.altitude_m)
            self._quick_shot = QuickShot(
                subject, here, self._vehicle, maximum_speed_m_s=self._end.maximum_speed_m_s
            )
        messages = self._quick_shot.tick(subject, now, self._vehicle.time_s(now))
        self.is_over |= self._quick_shot.is_over
        if self._quick_shot.reason is not None:
            self._quick_shot = None
            self._retreat()
        return messages

    def _turn_to(self, subject: Subject, now: float) -> list[Message]:
        """Turn the vehicle to the subject, when it points elsewhere."""
        start, time_s = self.start, self._vehicle.time_s(now)
        busy = self._sequence is not None and self._sequence.outcome is None
        if start is None or busy or time_s < self._due_at:
            return []
        self._due_at = time_s + TURN_EVERY_S
        north_m, east_m = offset(*start[:2], subject.latitude_deg, subject.longitude_deg)
        bearing_deg = math.degrees(math.atan2(east_m, north_m))
        before = self._faced_deg
        if (
            before is not None
            and abs(math.remainder(bearing_deg - before, 360.0)) < TURNED_AWAY_DEG
        ):
            return []
        command = heading_command(self._vehicle, Spot(*start[:3]), bearing_deg)
        if command is None:
            return []
        self._faced_deg = bearing_deg
        return self._send(((command,),), now)

    def _send(self, alternatives: CommandAlternatives, now: float) -> list[Message]:
        self._sequence = self._vehicle.sequence(alternatives)
        return self._sequence.start(now)

    def _check_end(self, time_s: float) -> None:
        """End when the duration is over, or the subject is lost."""
        elapsed_s = time_s - (self._began_at or 0.0)
        if self._seen_at is not None and time_s - self._seen_at > LOST_AFTER_S:
            self.note = (
                f"the subject was lost after {self._seen_at - (self._began_at or 0.0):.0f} s"
            )
            self.is_over = True
        self.is_over |= elapsed_s >= self._end.duration_s


class TrackingStop:
    """The camera of one vehicle; that it tracks for the broker is in the recovery state."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._sequence: CommandSequence | None = None
        self._attempts = 0
        self._again_at = -math.inf

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process an answer, also to a stop at the planned end of a command."""
        if message.get_type() != "COMMAND_ACK" or not self._vehicle.route.is_for_us(message):
            return []
        is_stop = message.command == mavlink.MAV_CMD_CAMERA_STOP_TRACKING
        if is_stop and message.result in _STOPPED:
            self._vehicle.recovery.is_tracking = False
        return [] if self._sequence is None else self._sequence.receive(message, now)

    def tick(self, now: float, *, is_wanted: bool) -> list[Message]:
        """Stop it, unless a command needs it to track, or may be continued."""
        if is_wanted or not self._vehicle.recovery.is_tracking:
            self._sequence, self._attempts, self._again_at = None, 0, -math.inf
            return []
        if self._sequence is not None:
            messages = self._sequence.tick(now)
            if self._sequence.outcome is not None:
                self._end_attempt(now)
            return messages
        if now < self._again_at:
            return []
        self._attempts += 1
        self._sequence = self._vehicle.sequence(((stop_tracking(self._vehicle.family),),))
        return self._sequence.start(now)

    def _end_attempt(self, now: float) -> None:
        """Try again later, some times: nobody has answered, or not yet."""
        self._sequence, self._again_at = None, now + STOP_AGAIN_AFTER_S
        if self._attempts >= STOP_ATTEMPTS:
            _LOG.warning(
                "vehicle %d: its camera may still track a subject: it does not stop",
                self._vehicle.vehicle_id,
            )
            self._vehicle.recovery.is_tracking = False
