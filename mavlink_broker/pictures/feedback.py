"""Pictures that an autopilot reports, and no camera: CAMERA_FEEDBACK(180) of ArduPilot.

ArduPilot sends it when it has triggered a camera, or with a feedback pin when the camera has
confirmed the picture (`AP_Camera_Backend.cpp`, `log_picture`, `check_feedback`; up to 4.3
`AP_Camera.cpp`). It has no file, is sent once, and is not repeated on request. A camera that is a
MAVLink component is triggered in the same manner, so both messages come for each of its pictures:
feedback counts where no camera has announced a picture of the command.

`send_camera_feedback` fills the message: `img_idx` counts what was triggered, `completed_captures`
what the pin has confirmed (0 without a pin), both from 1 and in 16 bits. A message that is not sent
yet is overwritten by the next one. So a step of the count is the number of pictures.

`time_usec` is the time since boot in 32 bits with a pin, else the GPS's time of day, or 0 without.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message

MAX_STEP: Final = 200
"""A count that jumps further begins anew."""
MAX_CAMERAS: Final = 8
LONGEST_LAG_S: Final = 60.0
"""A time that lies further back is not believed."""
_COUNTER: Final = 1 << 16
_TIMER_US: Final = 1 << 32


class Place(NamedTuple):
    """Where a picture was taken; the height is above home."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float

    def __str__(self) -> str:
        """Give it for a report."""
        return f"{self.latitude_deg:.7f} {self.longitude_deg:.7f} {self.relative_altitude_m:.1f} m"


@dataclass(frozen=True, slots=True)
class Feedback:
    """CAMERA_FEEDBACK(180)."""

    camera: int  # Number of the autopilot's camera, from 0
    number: int  # Of the picture
    time_us: int
    place: Place | None  # None: the autopilot has no position

    def taken_s(self, now_s: float, booted_utc_s: float | None) -> float:
        """The time when it was taken since boot; `now_s` is the vehicle's present time since boot.

        `booted_utc_s` is the time of day at boot; without it a time of day says nothing.
        """
        lag_s = 0.0
        if 0 < self.time_us < _TIMER_US:
            lag_s = (now_s * 1e6 - self.time_us) % _TIMER_US / 1e6
        elif self.time_us and booted_utc_s is not None:
            lag_s = now_s - (self.time_us / 1e6 - booted_utc_s)
        return now_s - lag_s if 0.0 <= lag_s <= LONGEST_LAG_S else now_s


def read_feedback(message: Message) -> Feedback:
    """Parse CAMERA_FEEDBACK(180)."""
    is_known = message.lat != 0 or message.lng != 0
    place = Place(message.lat / 1e7, message.lng / 1e7, message.alt_rel)
    return Feedback(
        camera=message.cam_idx,
        number=message.completed_captures or message.img_idx,
        time_us=message.time_usec,
        place=place if is_known else None,
    )


class FeedbackCounter:
    """Counts the pictures of one vehicle, also those whose message was lost."""

    def __init__(self) -> None:
        self._newest: dict[int, tuple[int, float]] = {}  # Number and time, by camera

    @property
    def is_used(self) -> bool:
        """Whether the vehicle has sent feedback."""
        return bool(self._newest)

    def restarted(self, time_s: float) -> None:
        """Note that the vehicle has restarted at a time: its counts begin anew."""
        self._newest = dict.fromkeys(self._newest, (0, time_s))

    def take(self, feedback: Feedback, time_s: float) -> tuple[int, float]:
        """Give the number of new pictures, and since when they were taken.

        All but the last one come of lost messages. A repeated or late message brings none.
        """
        number, since_s = self._newest.get(feedback.camera, (feedback.number - 1, time_s))
        is_full = feedback.camera not in self._newest and len(self._newest) >= MAX_CAMERAS
        step = (feedback.number - number) % _COUNTER
        if is_full or step == 0 or step >= _COUNTER - MAX_STEP:
            return 0, time_s
        self._newest[feedback.camera] = feedback.number, time_s
        return (step, since_s) if step <= MAX_STEP else (1, time_s)
