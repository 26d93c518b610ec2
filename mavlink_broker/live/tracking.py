"""Flies by what the camera tracks: behind a subject, beside it, round it, or turned towards it.

    LOOKING --SEEN--> STEERING --LOST or OVER--> over
    LOOKING --NOT TOLD WHERE--> gimbal alone, until its time is over

The camera tells whether it tracks (CAMERA_TRACKING_IMAGE_STATUS) and where the subject is
(CAMERA_TRACKING_GEO_STATUS); it is asked for both. A camera that does not tell where the subject is
keeps to it by its gimbal alone, which is said. A subject that is lost for 3 s ends the command: the
vehicle holds.
"""

import math
from typing import Final

from afarcloud.enumerations import TrackMode
from afarcloud.geodesy import offset
from mavlink_broker.autopilots.flight_modes import LIVE_MODES
from mavlink_broker.live.quick_shot import QuickShot, Subject
from mavlink_broker.live.series import SeriesRunner, heading_order
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Refused, long_command
from mavlink_broker.microservices.command_sequence import CommandSequence, Ways
from mavlink_broker.planning.follow_target import target_message
from mavlink_broker.planning.live_actions import Shift, Tracked
from mavlink_broker.planning.situation import Spot
from mavlink_broker.recovery.record import LiveNote, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

ASK_AGAIN_S: Final = 2.0
ASKED_OFTEN: Final = 4
TOLD_WITHIN_S: Final = 8.0
LOST_AFTER_S: Final = 3.0
STATUS_EVERY_US: Final = 200_000.0
TARGET_EVERY_S: Final = 0.2
TURN_EVERY_S: Final = 1.0
TURNED_AWAY_DEG: Final = 5.0
QUICK_RETREAT: Final = Shift(forward_m=-15.0, up_m=10.0)
"""What is flown where no circle will do: backwards and up, the subject in sight."""

_ACTIVE: Final[int] = mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
_NOWHERE: Final = 2**31 - 1
_BESIDE: Final = frozenset({TrackMode.TRACE, TrackMode.PROFILE})
_TELLING: Final = (
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS,
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
)
TRACKED_WORDS: Final = frozenset({"CAMERA_TRACKING_IMAGE_STATUS", "CAMERA_TRACKING_GEO_STATUS"})


class SubjectTracker:
    """One subject, for as long as a command lasts."""

    def __init__(self, end: Tracked, vehicle: Vehicle) -> None:
        self._end = end
        self._vehicle = vehicle
        self._began_at: float | None = None
        self._looks_since: float | None = None
        self._is_resumed = False
        self._here: Spot | None = None  # Where it began
        self._asked = 0
        self._ask_at = -math.inf
        self._subject: Subject | None = None
        self._seen_at: float | None = None
        self._steers = end.mode is not TrackMode.SPOTLIGHT_PRO
        self._sequence: CommandSequence | None = None
        self._series: SeriesRunner | None = None
        self._shot: QuickShot | None = None
        self._due_at = -math.inf
        self._faced_deg: float | None = None
        self.is_over = False
        self.reason: str | None = None  # It never fails: without a subject it is over
        self.note: str | None = None

    def resume(self, note: LiveNote) -> None:
        """Go on with what an earlier run of the broker has begun; its time counts on."""
        self._is_resumed = True
        self._began_at = note.going_s if self._vehicle.snapshot.time_s is not None else None
        if note.start is not None:
            self._here = Spot(*note.start[:3])

    @property
    def start(self) -> Pose | None:
        """Where it began."""
        return None if self._here is None else Pose(*self._here)

    @property
    def steps(self) -> int:
        """It has none that could be counted."""
        return 0

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle or its camera."""
        messages: list[Message] = []
        for running in (self._sequence, self._series, self._shot):
            if running is not None:
                messages += running.receive(message, now)
        match message.get_type():
            case "CAMERA_TRACKING_IMAGE_STATUS" if message.tracking_status == _ACTIVE:
                self._seen_at = self._time_s(now)
            case "CAMERA_TRACKING_GEO_STATUS" if message.tracking_status == _ACTIVE:
                self._see(message, now)
        return messages

    def tick(self, now: float) -> list[Message]:
        """Let time pass."""
        time_s = self._time_s(now)
        if self._began_at is None:
            self._began_at = time_s
        if self._looks_since is None:
            self._looks_since = time_s
        place = self._vehicle.snapshot.position
        if self._here is None and place is not None:
            self._here = Spot(place.latitude_deg, place.longitude_deg, place.altitude_m)
        messages = [*self._ask(time_s), *self._go_on(now)]
        if self._steers:
            messages += self._steer(time_s - self._looks_since, now)
        self._judge(time_s)
        return messages

    def _see(self, message: Message, now: float) -> None:
        self._seen_at = self._time_s(now)
        if _NOWHERE in {message.lat, message.lon}:
            return
        velocity = (message.vel_n, message.vel_e, message.vel_d)
        known = all(map(math.isfinite, velocity))
        place = message.lat / 1e7, message.lon / 1e7
        self._subject = Subject(*place, velocity if known else (0.0, 0.0, 0.0))

    def _ask(self, time_s: float) -> list[Message]:
        """Have the camera tell; one that refuses is asked in vain, and not often."""
        if self._seen_at is not None or self._asked >= ASKED_OFTEN or time_s < self._ask_at:
            return []
        self._asked += 1
        self._ask_at = time_s + ASK_AGAIN_S
        component = None if self._vehicle.family.camera_is_autopilot else mavlink.MAV_COMP_ID_CAMERA
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return [
            long_command(interval, message_id, STATUS_EVERY_US, component=component).message(
                self._vehicle.route, 0
            )
            for message_id in _TELLING
        ]

    def _go_on(self, now: float) -> list[Message]:
        """Go on with an order or a series that has been begun."""
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
            self._by_gimbal_alone(reason)

    def _steer(self, elapsed_s: float, now: float) -> list[Message]:
        subject = self._subject
        if subject is None:
            if elapsed_s > TOLD_WITHIN_S and self._series is None:
                return self._steer_blindly()
            return []
        if self._end.mode in _BESIDE:
            return self._tell_target(subject, now)
        if self._end.mode is TrackMode.QUICK_SHOT:
            return self._circle(subject, now)
        return self._turn_to(subject, now)

    def _steer_blindly(self) -> list[Message]:
        if self._end.mode is TrackMode.QUICK_SHOT:
            self._retreat()
        else:
            self._by_gimbal_alone("the camera does not tell where the subject is")
        return []

    def _by_gimbal_alone(self, reason: str) -> None:
        self._steers = False
        self.note = f"track_mode {self._end.mode.name}: {reason}; the gimbal alone keeps to it"

    def _retreat(self) -> None:
        """Fly the quick shot that needs no place of the subject."""
        self._steers = False
        self.note = "track_mode QUICK_SHOT: backwards and up instead of a circle"
        speed_m_s = self._end.maximum_speed_m_s
        self._series = SeriesRunner((QUICK_RETREAT,), self._vehicle, speed_m_s=speed_m_s)

    def _tell_target(self, subject: Subject, now: float) -> list[Message]:
        """Have the vehicle follow, and tell it where the subject is."""
        home, time_s = self._vehicle.snapshot.home, self._time_s(now)
        if home is None or time_s < self._due_at:
            return []
        self._due_at = time_s + TARGET_EVERY_S
        spot = Spot(subject.latitude_deg, subject.longitude_deg, self._end.height_m)
        told = target_message(spot, home, now, velocity_ned_m_s=subject.velocity_ned_m_s)
        follows = self._is_resumed and self._vehicle.mode in LIVE_MODES
        is_told = self._sequence is not None or follows
        begin = [] if is_told else self._order(self._end.follow, now)
        return [told, *begin]

    def _circle(self, subject: Subject, now: float) -> list[Message]:
        place = self._vehicle.snapshot.position
        if self._shot is None:
            if self._here is None or place is None:
                return []
            here = Spot(*place[:2], self._here.relative_altitude_m)
            self._shot = QuickShot(
                subject, here, self._vehicle, maximum_speed_m_s=self._end.maximum_speed_m_s
            )
        messages = self._shot.tick(subject, now, self._time_s(now))
        self.is_over |= self._shot.is_over
        if self._shot.reason is not None:
            self._shot = None
            self._retreat()
        return messages

    def _turn_to(self, subject: Subject, now: float) -> list[Message]:
        """Turn the nose to the subject, when it points elsewhere."""
        place, time_s = self._here, self._time_s(now)
        busy = self._sequence is not None and self._sequence.outcome is None
        if place is None or busy or time_s < self._due_at:
            return []
        self._due_at = time_s + TURN_EVERY_S
        north_m, east_m = offset(*place[:2], subject.latitude_deg, subject.longitude_deg)
        bearing_deg = math.degrees(math.atan2(east_m, north_m))
        before = self._faced_deg
        if (
            before is not None
            and abs(math.remainder(bearing_deg - before, 360.0)) < TURNED_AWAY_DEG
        ):
            return []
        order = heading_order(self._vehicle, place, bearing_deg)
        if order is None:
            return []
        self._faced_deg = bearing_deg
        return self._order(((order,),), now)

    def _order(self, ways: Ways, now: float) -> list[Message]:
        vehicle = self._vehicle
        self._sequence = CommandSequence(ways, vehicle.route, vehicle.round_trip)
        return self._sequence.start(now)

    def _judge(self, time_s: float) -> None:
        """End when the time is over, or the subject is lost."""
        elapsed_s = time_s - (self._began_at or 0.0)
        if self._seen_at is not None and time_s - self._seen_at > LOST_AFTER_S:
            self.note = (
                f"the subject was lost after {self._seen_at - (self._began_at or 0.0):.0f} s"
            )
            self.is_over = True
        self.is_over |= elapsed_s >= self._end.duration_s

    def _time_s(self, now: float) -> float:
        told = self._vehicle.snapshot.time_s
        return now if told is None else told
