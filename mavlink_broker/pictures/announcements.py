"""What cameras and autopilots announce of pictures, and requests for what was lost.

A camera numbers its pictures from 0 without gaps and announces each of them once. The broker
requests the numbers that are missing between two others, or up to the camera's own count:
REQUEST_MESSAGE(512) of CAMERA_IMAGE_CAPTURED(263) with the number. A restarted broker requests
from the newest backwards, as far as pictures may belong to its missions.

Pictures that an autopilot reports, and no camera, are known by CAMERA_FEEDBACK(180) of ArduPilot.
It sends it when it has triggered a camera, or with a feedback pin when the camera has confirmed the
picture (`AP_Camera_Backend.cpp`, `log_picture`, `check_feedback`; up to 4.3 `AP_Camera.cpp`). It
has no file, is sent once, and is not repeated on request. A camera that is a MAVLink component is
triggered in the same manner, so both messages come for each of its pictures: feedback counts where
no camera has announced a picture of the command.

`send_camera_feedback` fills the message: `img_idx` counts what was triggered, `completed_captures`
what the pin has confirmed (0 without a pin), both from 1 and in 16 bits. A message that is not sent
yet is overwritten by the next one. So a step of the count is the number of pictures. `time_usec` is
the time since boot in 32 bits with a pin, else the GPS's time of day, or 0 without.
"""

import math
import re
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias
from urllib.parse import urlsplit

from mavlink_broker.mavlink.dialect import Message, Route, mavlink, source_of
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.message_rates import request_message

WINDOW: Final = 4
ATTEMPTS: Final = 20
FIRST_PAUSE_S: Final = 0.5
LONGEST_PAUSE_S: Final = 10.0
"""A camera announces a picture when it has stored it, which may take a while."""
MAX_NUMBERS: Final = 4000
"""Numbers that are stored; older ones are not requested."""
MAX_GAP: Final = 200
"""A camera whose numbers jump further was exchanged or emptied."""
MAX_STEP: Final = 200
"""A count that increases by more has begun again."""
MAX_CAMERAS: Final = 8
LONGEST_LAG_S: Final = 60.0
"""Times that are further in the past are not used."""
_FTP_URL: Final = re.compile(r"^(?:mftp|mavftp|mavlinkftp|file)://(.*)$", re.DOTALL)
_COMPONENT: Final = re.compile(r"^/?\[?;comp=(\d{1,3})\]?(.*)$", re.DOTALL)
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IMAGE: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
_COUNTER: Final = 1 << 16
_TIMER_US: Final = 1 << 32

Position: TypeAlias = tuple[float, float]
"""Latitude and longitude [deg]."""


class FileLocation(NamedTuple):
    """A file on the vehicle, read over MAVFTP; without a component it is on the camera."""

    path: str
    component: int | None = None


class WebLocation(NamedTuple):
    """A file on a web server, such as the camera's."""

    url: str


Location: TypeAlias = FileLocation | WebLocation


def location_of(url: str) -> Location | None:
    """Parse `file_url`: `mftp://[;comp=<id>]path`, a plain path, http or https; None for others."""
    match = _FTP_URL.match(url)
    if match is not None:
        with_component = _COMPONENT.match(match[1])
        path = match[1] if with_component is None else with_component[2]
        component = None if with_component is None else int(with_component[1])
        is_component = component is None or 1 <= component <= 255
        return FileLocation(path, component) if path and is_component else None
    if "://" not in url:
        return FileLocation(url) if url else None
    try:
        parts = urlsplit(url)
    except ValueError:
        return None
    return WebLocation(url) if parts.scheme in {"http", "https"} and parts.hostname else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """CAMERA_IMAGE_CAPTURED(263)."""

    component: int
    index: int
    taken_s: float | None  # By its camera's clock since boot; None: not sent
    taken_utc_s: float | None = None  # Since 1970; None: its clock is not set
    position: Position | None = None  # None: unknown
    has_succeeded: bool
    url: str
    identity: str  # The same for the same picture, however often it is announced

    @property
    def location(self) -> Location | None:
        """The location of its file."""
        return location_of(self.url)


def read_capture(message: Message) -> Capture:
    """Parse CAMERA_IMAGE_CAPTURED(263)."""
    component, url = source_of(message).component, str(message.file_url)
    fields = (message.time_utc, message.time_boot_ms, message.lat, message.lon, message.image_index)
    return Capture(
        component=component,
        index=message.image_index,
        taken_s=message.time_boot_ms / 1e3 if message.time_boot_ms else None,
        taken_utc_s=message.time_utc / 1e6 if message.time_utc > 0 else None,
        position=(message.lat / 1e7, message.lon / 1e7) if message.lat or message.lon else None,
        has_succeeded=message.capture_result == 1,
        url=url,
        identity="/".join(map(str, (component, message.camera_id, *fields, url))),
    )


@dataclass(slots=True)
class _PendingRequest:
    due_at: float = 0.0
    attempts: int = 0


class AnnouncementTracker:
    """One camera of one vehicle."""

    def __init__(self, component: int, route: Route, round_trip: RoundTrip) -> None:
        self._component = component
        self._route = route
        self._round_trip = round_trip
        self._announced: dict[int, str] = {}  # Number to identity, oldest first but for gaps
        self._newest = -1  # The highest number of these
        self._first: int | None = None  # Earlier pictures do not matter
        self._status: _PendingRequest | None = None
        self._images: dict[int, _PendingRequest] = {}
        self._goes_back = False

    @property
    def is_requesting(self) -> bool:
        """Whether a request has no answer yet."""
        return self._status is not None or bool(self._images)

    def lacks_before(self, number: int) -> bool:
        """Whether an earlier picture than this one is requested.

        Those of before the first one that matters are not waited for.
        """
        first = number if self._first is None else self._first
        return any(first <= one < number for one in self._images)

    @property
    def goes_back(self) -> bool:
        """Whether pictures from before the first one that was announced here are requested."""
        if not self._goes_back:
            return False
        first = min(self._announced, default=math.inf)
        return self._status is not None or any(number < first for number in self._images)

    def request_count(self, *, go_back: bool = False) -> None:
        """Request the number of pictures; `go_back`: also those that were not announced here."""
        self._goes_back |= go_back
        self._status = self._status or _PendingRequest()

    def take(self, capture: Capture, *, goes_back: bool) -> bool:
        """Process an announcement; whether it is new. `goes_back`: request earlier ones too."""
        number = capture.index
        was_requested = self._images.pop(number, None) is not None
        if self._announced.get(number) == capture.identity:
            return False
        if not was_requested and self._is_of_another_camera(number):
            self._announced.clear()
            self._newest = -1
            self._images.clear()
            self._first = number
        if self._goes_back and was_requested and number <= min(self._announced, default=number):
            self._goes_back = goes_back and number > 0
            if self._goes_back:
                self._images[number - 1] = _PendingRequest()
        self._store(number, capture.identity)
        self._first = number if self._first is None else self._first
        self._request_up_to(number)
        return True

    def take_count(self, image_count: int) -> None:
        """Process CAMERA_CAPTURE_STATUS.image_count: the newest picture has one number less."""
        self._status = None
        if image_count < 0:
            return
        if self._first is None:
            self._first = image_count
        if self._goes_back:
            self._begin_back(image_count)
        if image_count <= self._newest + MAX_GAP:
            self._request_up_to(image_count)

    def _begin_back(self, image_count: int) -> None:
        newest = min(self._announced, default=image_count) - 1
        if newest >= 0:
            self._images.setdefault(newest, _PendingRequest())

    def tick(self, now: float) -> tuple[list[Message], list[int]]:
        """Repeat overdue requests; gives the messages, and the numbers that are given up."""
        messages, lost = [], []
        if self._status is not None and now >= self._status.due_at:
            if self._status.attempts >= ATTEMPTS:
                self._status = None  # It has no count
                if self._goes_back and self._announced:
                    self._begin_back(0)
            else:
                messages.append(self._request(self._status, now, _STATUS))
        for number in sorted(self._images)[:WINDOW]:
            pending = self._images[number]
            if now < pending.due_at:
                continue
            if pending.attempts >= ATTEMPTS:
                del self._images[number]
                self._store(number, "")
                lost.append(number)
            else:
                messages.append(self._request(pending, now, _IMAGE, number))
        return messages, lost

    def _request(
        self, pending: _PendingRequest, now: float, message_id: int, number: int = 0
    ) -> Message:
        pending.attempts += 1
        pause_s = max(FIRST_PAUSE_S, self._round_trip.timeout_s) * 1.5**pending.attempts
        pending.due_at = now + min(pause_s, LONGEST_PAUSE_S)
        return request_message(self._route, message_id, number, component=self._component)

    def _is_of_another_camera(self, number: int) -> bool:
        """Whether the numbers start again: the camera was exchanged, emptied or restarted."""
        if not self._announced:
            return False
        is_other = bool(self._announced.get(number))
        return is_other or number < (self._first or 0) or number > self._newest + MAX_GAP

    def _store(self, number: int, identity: str) -> None:
        """Store a number that was announced or is given up; the oldest are removed."""
        self._announced[number] = identity
        self._newest = max(self._newest, number)
        if len(self._announced) > MAX_NUMBERS:
            del self._announced[next(iter(self._announced))]

    def _request_up_to(self, number: int) -> None:
        first = max(self._first or 0, number - MAX_GAP)
        for missing in range(first, number):
            if missing not in self._announced:
                self._images.setdefault(missing, _PendingRequest())


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
