"""What a simulated camera tracks: a subject that rests, moves, is lost, or has no known position.

The camera reports it as often as it was asked to, once it has been ordered to track a rectangle of
its picture or a point.
"""

import math
from collections.abc import Callable
from enum import Enum
from functools import partial
from random import Random
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.scheduler import Scheduler
from dst.vehicles.flight import Truth, place

ORDERS: Final = frozenset(
    {
        mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE,
        mavlink.MAV_CMD_CAMERA_TRACK_POINT,
        mavlink.MAV_CMD_CAMERA_STOP_TRACKING,
    }
)
REPORTS: Final = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS,
        mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
    }
)
SHORTEST_PERIOD_S: Final = 0.5
"""Of the reports: a fast simulation."""
LOST_AFTER_S: Final = 5.0, 40.0
SPEED_M_S: Final = 0.5
NORTH_M, EAST_M = (10.0, 16.0), (-5.0, 5.0)
"""Of home: so that a vehicle that circles a subject stays where plans are flown."""
_UNKNOWN: Final = 2**31 - 1


class Subject(Enum):
    """What it turns out to be."""

    RESTS = "rests"
    MOVES = "moves"
    LOST = "is lost"
    WITHOUT_PLACE = "has no known place"
    UNREPORTED = "is not reported"


class Rectangle(NamedTuple):
    """A rectangle of a picture, its corners as fractions."""

    left: float
    top: float
    right: float
    bottom: float


class Tracked(NamedTuple):
    """A subject that was tracked, by truth."""

    time_s: float
    rectangle: Rectangle


class Tracking:
    """The tracking of one camera."""

    def __init__(
        self, scheduler: Scheduler, random: Random, send: Callable[[Any], None], truth: Truth
    ) -> None:
        """Track nothing; `send` takes each message."""
        self._scheduler = scheduler
        self._random = random
        self._send = send
        self._truth = truth
        self._periods_s: dict[int, float] = {}
        self._subject: Subject | None = None
        self._began_s = 0.0
        self._path_m = (0.0, 0.0), (0.0, 0.0)  # North and east of home, from and to
        self._lost_s = math.inf

    def obey(self, message: Any) -> int:
        """Carry out a command of `ORDERS`, or an order of how often to report; gives the result."""
        match message.command:
            case mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE:
                corners = message.param1, message.param2, message.param3, message.param4
                self._begin(Rectangle(*corners))
            case mavlink.MAV_CMD_CAMERA_TRACK_POINT:
                return int(mavlink.MAV_RESULT_DENIED)  # It has understood the rectangle
            case mavlink.MAV_CMD_CAMERA_STOP_TRACKING:
                self.stop()
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                if self._subject is Subject.UNREPORTED:
                    return int(mavlink.MAV_RESULT_UNSUPPORTED)
                self._set_period(int(message.param1), message.param2 * 1e-6)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def stop(self) -> None:
        """Track nothing."""
        self._subject, self._truth.is_tracking = None, False
        self._periods_s.clear()

    def _begin(self, rectangle: Rectangle) -> None:
        random = self._random
        self._periods_s.clear()
        self._subject, self._truth.is_tracking = random.choice(list(Subject)), True
        self._began_s = self._scheduler.now_s
        self._truth.tracked.append(Tracked(self._began_s, rectangle))
        begin_m, end_m = [(random.uniform(*NORTH_M), random.uniform(*EAST_M)) for _ in range(2)]
        self._path_m = begin_m, end_m if self._subject is Subject.MOVES else begin_m
        is_lost = self._subject is Subject.LOST
        self._lost_s = self._began_s + random.uniform(*LOST_AFTER_S) if is_lost else math.inf
        self._scheduler.note(
            f"camera {self._truth.aircraft}", "-", f"tracks what {self._subject.value}"
        )

    def _set_period(self, message_id: int, period_s: float) -> None:
        is_new = message_id not in self._periods_s
        self._periods_s[message_id] = max(period_s, SHORTEST_PERIOD_S)
        if is_new:
            self._report(message_id, self._began_s)

    def _report(self, message_id: int, began_s: float) -> None:
        """Send a report, and the next one later, until the subject is another one."""
        if self._subject is None or began_s != self._began_s or message_id not in self._periods_s:
            return
        is_active = self._scheduler.now_s < self._lost_s
        status = int(is_active and mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE)
        if message_id == mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS:
            self._send(self._place(status))
        else:
            middle, unknown = (0.5, 0.5), (math.nan,) * 5
            message = mavlink.MAVLink_camera_tracking_image_status_message
            self._send(message(status, 1, 1, *middle, *unknown))
        again = partial(self._report, message_id, began_s)
        self._scheduler.after(self._periods_s[message_id], again)

    def _place(self, status: int) -> Any:
        begin_m, end_m = self._path_m
        length_m = math.dist(begin_m, end_m)
        gone_m = min(length_m, SPEED_M_S * (self._scheduler.now_s - self._began_s))
        north, east = ((b - a) / max(length_m, 1.0) for a, b in zip(begin_m, end_m, strict=True))
        where = place(begin_m[0] + gone_m * north, begin_m[1] + gone_m * east)
        speed_m_s = SPEED_M_S if gone_m < length_m else 0.0
        place_e7 = round(where[0] * 1e7), round(where[1] * 1e7)
        if self._subject is Subject.WITHOUT_PLACE:
            place_e7 = _UNKNOWN, _UNKNOWN
        velocity_ned = speed_m_s * north, speed_m_s * east, 0.0
        return mavlink.MAVLink_camera_tracking_geo_status_message(
            status, *place_e7, 650.0, 1.0, 1.0, *velocity_ned, 0.1, 10.0, math.nan, math.nan
        )
