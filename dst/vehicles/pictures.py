"""The cameras of kinematic vehicles, and the jobs with which the broker fetches their pictures.

A camera is a component of its own. It stores a picture a while after it has taken it, announces it
once, and repeats an announcement on request. Its pictures survive a restart of the vehicle. Each
picture contains its URL, so that whoever has its bytes knows which one it is.
"""

import base64
import io
from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

from PIL import Image
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from afarcloud.enumerations import ImageFormat
from dst.scheduler import Scheduler
from dst.vehicles.flight import HOME, Truth, place
from dst.vehicles.tracking import ORDERS, REPORTS, Tracking
from mavlink_broker.effects import (
    ConvertedPicture,
    ConvertPicture,
    Downloaded,
    FetchUrl,
    Job,
    JobFailed,
    JobOutcome,
    failed,
)

COMPONENT: Final[int] = mavlink.MAV_COMP_ID_CAMERA
STORING_S: Final = (0.2, 3.0)
"""From a picture to its announcement."""
JOB_S: Final = (0.02, 4.0)
"""What a download or a conversion takes."""
PANORAMA_INTERVAL_S: Final = 0.8
PANORAMA_STEP_DEG: Final = 45.0


class Series(NamedTuple):
    """Pictures that are ordered together."""

    interval_s: float
    photos: int


SINGLE: Final = Series(0.0, 1)


class Picture(NamedTuple):
    """A picture that was taken, by truth."""

    time_s: float
    place_e7: tuple[int, int] | None
    """Latitude and longitude of the command before, which brought the vehicle here [1e-7 deg]."""
    url: str
    series: Series
    """As it was ordered."""


class Camera:
    """The camera of one vehicle."""

    def __init__(
        self,
        scheduler: Scheduler,
        system: int,
        send: Callable[[bytes], None],
        truth: Truth,
        boot_ms: Callable[[], int],
    ) -> None:
        """Begin without pictures; `boot_ms` is the clock of the vehicle since its start."""
        self._scheduler = scheduler
        self._random = scheduler.random(f"camera/{system}")
        self._send_frame = send
        self._truth = truth
        self._boot_ms = boot_ms
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        subjects = scheduler.random(f"subjects/{system}")
        self._tracking = Tracking(scheduler, subjects, self._send, truth)
        self._announcements: list[Any] = []
        self._stops = 0  # What was ordered before the last stop is not taken any more
        self._busy_until_s = 0.0
        self._number = 0.0  # Of the newest single picture: a repeated order takes no other one

    def heartbeat(self) -> None:
        """Send a HEARTBEAT."""
        kind, none = mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID
        self._send(mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, 4, 3))

    def restart(self) -> None:
        """Forget what was ordered before; the pictures stay."""
        self.stop()
        self._tracking.stop()

    def obey_tracking(self, message: Any) -> int:
        """Carry out an order of what to track, or of how often to report it; gives the result."""
        return self._tracking.obey(message)

    def stop(self) -> None:
        """Take no more pictures of what was ordered before."""
        self._stops += 1
        self._busy_until_s = 0.0

    def receive(self, message: Any) -> None:
        """Obey a command, or answer a question."""
        if message.get_type() == "COMMAND_LONG":
            result = self._obey(message)
            self._send(mavlink.MAVLink_command_ack_message(message.command, result))

    def start(self, interval_s: float, count: int, number: float = 0.0) -> None:
        """Take pictures; one that has the number of the last one was ordered before."""
        if count == 1 and number > 0.0 and number == self._number:
            return
        self._number = number
        series = Series(interval_s, count)
        self._busy_until_s = self._scheduler.now_s + count * max(interval_s, 0.1)
        for one in range(count):
            self._scheduler.after(one * interval_s, partial(self._take, series, self._stops))

    def _obey(self, message: Any) -> int:
        match message.command:
            case mavlink.MAV_CMD_IMAGE_START_CAPTURE:
                self.start(message.param2, int(message.param3), message.param4)
            case mavlink.MAV_CMD_IMAGE_STOP_CAPTURE:
                self.stop()
            case mavlink.MAV_CMD_PANORAMA_CREATE:
                self._begin_panorama(message.param1)
                return int(mavlink.MAV_RESULT_IN_PROGRESS)
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._answer(int(message.param1), int(message.param2))
            case _ if is_of_tracking(message):
                return self.obey_tracking(message)
            case _:
                return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _begin_panorama(self, span_deg: float) -> None:
        """Take a panorama, and confirm its command when it is complete."""
        if self._scheduler.now_s < self._busy_until_s:
            return  # The command is repeated
        count = round(span_deg / PANORAMA_STEP_DEG) + (0 if span_deg >= 360.0 else 1)
        self.start(PANORAMA_INTERVAL_S, count)
        stops = self._stops

        def complete() -> None:
            if stops == self._stops:
                command, accepted = mavlink.MAV_CMD_PANORAMA_CREATE, mavlink.MAV_RESULT_ACCEPTED
                self._send(mavlink.MAVLink_command_ack_message(command, accepted))

        self._scheduler.after(self._busy_until_s - self._scheduler.now_s, complete)

    def _answer(self, message_id: int, index: int) -> None:
        if message_id == mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS:
            status = 1 if self._scheduler.now_s < self._busy_until_s else 0
            count = len(self._announcements)
            self._send(
                mavlink.MAVLink_camera_capture_status_message(
                    self._boot_ms(), status, 0, 0.0, 0, 1000.0, count
                )
            )
        is_image = message_id == mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
        if is_image and 0 <= index < len(self._announcements):
            self._send(self._announcements[index])

    def _take(self, series: Series, stops: int) -> None:
        if stops != self._stops:
            return
        truth, boot_ms = self._truth, self._boot_ms()
        url = f"http://192.0.2.1/{truth.aircraft}/{len(truth.pictures)}.jpg"
        truth.pictures.append(Picture(self._scheduler.now_s, truth.place_e7, url, series))
        self._scheduler.note(f"camera {truth.aircraft}", "-", f"takes {url} at {truth.place_e7}")
        latitude_deg, longitude_deg = place(truth.north_m, truth.east_m)
        height_mm = round(truth.height_m * 1e3)
        where = round(latitude_deg * 1e7), round(longitude_deg * 1e7)
        heights_mm = round(HOME[2] * 1e3) + height_mm, height_mm
        picture = partial(
            mavlink.MAVLink_camera_image_captured_message,
            *(boot_ms, 0, 0, *where, *heights_mm, [1.0, 0.0, 0.0, 0.0]),
            capture_result=1,
            file_url=url.encode(),
        )
        pause_s = self._random.uniform(*STORING_S)
        self._scheduler.after(pause_s, partial(self._store, stops, picture))

    def _store(self, stops: int, picture: Callable[..., Any]) -> None:
        """Store a picture under the next number, and announce it, unless it has restarted."""
        message = picture(image_index=len(self._announcements))
        self._announcements.append(message)
        if stops == self._stops:
            self._send(message)

    def _send(self, message: Any) -> None:
        frame = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        self._send_frame(bytes(frame))


class PictureJobs:
    """Downloads and conversions of a broker; a share of the downloads fails."""

    def __init__(
        self, scheduler: Scheduler, wake: Callable[[], None], failure_share: Callable[[], float]
    ) -> None:
        """Begin without a job; `wake` has the broker's loop run."""
        self._scheduler = scheduler
        self._random = scheduler.random("picture jobs")
        self._wake = wake
        self._failure_share = failure_share
        self._finished: list[tuple[int, JobOutcome]] = []

    def put(self, system: int, job: Job) -> None:
        """Begin a job of a vehicle."""
        pause_s = self._random.uniform(*JOB_S)
        self._scheduler.after(pause_s, partial(self._finish, system, job))

    def take_finished(self) -> list[tuple[int, JobOutcome]]:
        """Give the outcomes since the last call."""
        finished, self._finished = self._finished, []
        return finished

    def _finish(self, system: int, job: Job) -> None:
        self._finished.append((system, self._outcome(job)))
        self._wake()

    def _outcome(self, job: Job) -> JobOutcome:
        match job:
            case FetchUrl(number) if self._random.random() < self._failure_share():
                return JobFailed(number, "no connection")
            case FetchUrl(number, url):
                return Downloaded(number, url.encode())
            case ConvertPicture(number, data):
                picture = _jpeg(data)
                frame = base64.b64encode(picture).decode()
                return ConvertedPicture(number, ImageFormat.JPEG, frame, len(picture))
            case _:
                return failed(job, "this simulation fetches no logs")


def is_of_tracking(message: Any) -> bool:
    """Whether a command is about what a camera tracks."""
    is_interval = message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    return message.command in ORDERS or (is_interval and int(message.param1) in REPORTS)


def _jpeg(comment: bytes) -> bytes:
    buffer = io.BytesIO()
    Image.new("L", (8, 8)).save(buffer, "JPEG", comment=comment)
    return buffer.getvalue()


def url_in(frame: str) -> str:
    """Read which picture a frame is."""
    with Image.open(io.BytesIO(base64.b64decode(frame))) as picture:
        return bytes(picture.info["comment"]).decode()
