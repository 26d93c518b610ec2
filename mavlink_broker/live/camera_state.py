"""What the cameras of a vehicle do, by CAMERA_CAPTURE_STATUS: who waits for them, and for what.

SeriesMonitor waits for the pictures of a command that has ended before the next command begins. A
camera may begin late, because its gimbal still turns, and a series of pictures that a mission has
begun pauses while the mission is not flown: a live command that begins too early finds the camera
busy, and interrupts the series. So the broker requests CAMERA_CAPTURE_STATUS until image_status is
idle. It does not wait if no camera is known, or none answers.

CaptureCheck finds out whether a camera has carried out a command whose final acknowledgement is
missing. A camera that carries out a command acknowledges it with IN_PROGRESS and takes pictures.
When it falls silent, its final acknowledgement may be lost, and a repeated command would be carried
out again: a vehicle stores its acknowledgements for some seconds only. So the broker requests the
camera's state, and the pictures decide: if it is idle and has taken pictures, the command is done;
if it is idle without new pictures, the command may be sent again. With several cameras all of them
must be idle: the command may be for any. A camera that does not answer is waited for as long as
after a series of pictures: then the command is done if only other cameras have shown signs of work
and are idle; else the result is unknown, and the command fails.
"""

from collections.abc import Iterable
from enum import Enum, auto
from typing import Final

from afarcloud.commands import CameraImage, Command
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.message_rates import request_message
from mavlink_broker.vehicle.vehicle import Vehicle

SERIES_REQUEST_EVERY_S: Final = 0.5
SERIES_SILENT_AFTER_S: Final = 5.0
"""The broker does not wait longer for a camera that does not answer."""
SERIES_EXTRA_S: Final = 20.0
"""Added to the duration of the series."""
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IDLE: Final = 0
SILENT_AFTER_S: Final = 3.0
"""Several times the longest silence of a working camera."""
REQUEST_EVERY_S: Final = 1.0
ANSWER_TIMEOUT_S: Final = 20.0
"""For a camera that does not answer; `SeriesMonitor` adds as much to the time of a series."""


def _status_requests(vehicle: Vehicle, cameras: Iterable[int]) -> list[Message]:
    """Request the state of cameras, by their components."""
    return [
        request_message(vehicle.route, _STATUS, component=component)
        for component in sorted(cameras)
    ]


class SeriesMonitor:
    """The cameras of one vehicle after one command."""

    def __init__(self, command: Command, vehicle: Vehicle) -> None:
        """Wait for the pictures of a command; commands without pictures are over at once."""
        self._vehicle = vehicle
        self._timeout_s = 0.0
        if isinstance(command, CameraImage):
            p = command.parameters
            self._timeout_s = p.photo_count * max(1.0, p.time_interval) + SERIES_EXTRA_S
        self._began_at: float | None = None  # By the broker's clock
        self._began_s: float | None = None  # By the vehicle's, once it has one
        self._requested_at: float | None = None
        self._answered_at = 0.0
        self._busy = set(vehicle.cameras)

    def receive(self, message: Message, now: float) -> None:
        """Process the answer of a camera."""
        if message.get_type() != "CAMERA_CAPTURE_STATUS" or self._requested_at is None:
            return
        component = source_of(message).component
        self._answered_at = now
        if message.image_status == _IDLE:
            self._busy.discard(component)

    def tick(self, now: float) -> list[Message]:
        """Request the state of the cameras that are not known to be idle."""
        if self._began_at is None:
            self._began_at = self._answered_at = now
        time_s = self._vehicle.snapshot.time_s
        if self._began_s is None and time_s is not None:
            self._began_s = time_s - (now - self._began_at)
        if self.is_over(now) or (
            self._requested_at is not None and now - self._requested_at < SERIES_REQUEST_EVERY_S
        ):
            return []
        self._requested_at = now
        return _status_requests(self._vehicle, self._busy)

    def is_over(self, now: float) -> bool:
        """Whether the next command may begin."""
        if self._timeout_s == 0.0 or not self._busy:
            return True
        if self._began_at is None:
            return False
        is_silent = now - self._answered_at >= SERIES_SILENT_AFTER_S
        time_s = self._vehicle.snapshot.time_s
        if time_s is None or self._began_s is None:
            lasted_s = now - self._began_at
        else:
            lasted_s = time_s - self._began_s
        return is_silent or lasted_s >= self._timeout_s


class CaptureState(Enum):
    """What is known of the command."""

    NO_SIGN = auto()  # It may be sent again
    IN_PROGRESS = auto()  # Received; the result is not known yet
    DONE = auto()
    NOT_DONE = auto()  # Received, without pictures: it may be sent again


class CaptureCheck:
    """One command to a camera that takes time."""

    def __init__(self, command: int, vehicle: Vehicle) -> None:
        """Watch for the signs of a MAV_CMD."""
        self._command = command
        self._vehicle = vehicle
        self._sent_s = vehicle.snapshot.time_s
        self._sign_at: float | None = None  # The newest sign of work
        self._requested_at: float | None = None
        self._unanswered_since: float | None = None  # Without a sign, while the vehicle sends
        self._idle: set[int] = set()  # Components, since the newest sign of work
        self._answered_at: dict[int, float] = {}
        self._ignored: set[int] = set()  # Silent components without a sign of work
        self._working: set[int] = set()  # Cameras that have shown signs of work
        self.pictures: set[int] = set()

    @property
    def state(self) -> CaptureState:
        """What the messages so far show."""
        if self._sign_at is None:
            return CaptureState.NO_SIGN
        if not self._cameras - self._ignored <= self._idle:
            return CaptureState.IN_PROGRESS
        return CaptureState.DONE if self.pictures else CaptureState.NOT_DONE

    def receive(self, message: Message, now: float) -> None:
        """Process a message of the vehicle or of its camera."""
        match message.get_type():
            case "COMMAND_ACK" if message.command == self._command:
                is_own = self._vehicle.route.is_for_us(message)
                if is_own and message.result == mavlink.MAV_RESULT_IN_PROGRESS:
                    self._note_work(message, now)
            case "CAMERA_IMAGE_CAPTURED" if self._is_new(message):
                self.pictures.add(message.image_index)
                self._note_work(message, now)
            case "CAMERA_CAPTURE_STATUS" if self._is_requested(message):
                self._answered_at[source_of(message).component] = now
                if message.image_status == _IDLE:
                    self._idle.add(source_of(message).component)
                else:
                    self._idle.discard(source_of(message).component)

    def tick(self, now: float) -> list[Message]:
        """Request the cameras' state when they are silent."""
        if self._sign_at is None or now - self._sign_at < SILENT_AFTER_S:
            return []
        if self._requested_at is not None and now - self._requested_at < REQUEST_EVERY_S:
            return []
        self._requested_at = now
        if self._unanswered_since is None:
            self._unanswered_since = now
        return _status_requests(self._vehicle, self._cameras)

    def fault(self, now: float) -> str | None:
        """Why the result cannot be determined; None while it may be, or is.

        Call it while messages of the vehicle arrive; after a lost link call `restart_timeout`.
        """
        silent = self._silent(now)
        if not silent:
            return None
        others = self._cameras - silent
        if self.pictures and self._working and self._working <= others:
            self._ignored = silent
            return None
        names = ", ".join(str(component) for component in sorted(silent))
        return f"camera {names} has not reported for {ANSWER_TIMEOUT_S:.0f} s whether it has ended"

    def restart_timeout(self) -> None:
        """Wait anew for the cameras: the link was lost."""
        self._unanswered_since = None

    def _silent(self, now: float) -> set[int]:
        """Cameras that have not answered in time."""
        since = self._unanswered_since
        if since is None or now - since < ANSWER_TIMEOUT_S:
            return set()
        answered = {c for c, at in self._answered_at.items() if now - at < ANSWER_TIMEOUT_S}
        return self._cameras - answered

    def _note_work(self, message: Message, now: float) -> None:
        self._sign_at = now
        self._requested_at = self._unanswered_since = None
        self._idle.clear()
        self._ignored = set()
        self._working |= {source_of(message).component} & self._cameras

    @property
    def _cameras(self) -> set[int]:
        return self._vehicle.cameras or {mavlink.MAV_COMP_ID_CAMERA}

    def _is_new(self, message: Message) -> bool:
        """Whether a picture was taken after the command, by the vehicle's clock."""
        taken_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
        return self._sent_s is not None and taken_s >= self._sent_s

    def _is_requested(self, message: Message) -> bool:
        return self._requested_at is not None and source_of(message).component in self._cameras
