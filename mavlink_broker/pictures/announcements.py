"""Announcements of pictures, and requests for those that were lost.

A camera numbers its pictures from 0 without gaps and announces each of them once. The broker
requests the numbers that are missing between two others, or up to the camera's own count:
REQUEST_MESSAGE(512) of CAMERA_IMAGE_CAPTURED(263) with the number. A restarted broker requests
from the newest backwards, as far as pictures may belong to its missions.
"""

import math
import re
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias
from urllib.parse import urlsplit

from mavlink_broker.mavlink.dialect import Message, Route, mavlink, source_of
from mavlink_broker.microservices.command import RoundTrip, long_command
from mavlink_broker.pictures.attribution import Position

_FTP_URL: Final = re.compile(r"^(?:mftp|mavftp|mavlinkftp|file)://(.*)$", re.DOTALL)
_COMPONENT: Final = re.compile(r"^/?\[?;comp=(\d{1,3})\]?(.*)$", re.DOTALL)
WINDOW: Final = 4
ATTEMPTS: Final = 20
FIRST_PAUSE_S: Final = 0.5
LONGEST_PAUSE_S: Final = 10.0
"""A camera announces a picture when it has stored it, which may take a while."""
MAX_NUMBERS: Final = 4000
"""Numbers that are stored; older ones are not requested."""
MAX_GAP: Final = 200
"""A camera whose numbers jump further was exchanged or emptied."""
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IMAGE: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED


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
    altitude_m: float  # Above home
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
        altitude_m=message.relative_alt / 1e3,
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
        command = long_command(
            mavlink.MAV_CMD_REQUEST_MESSAGE, message_id, number, component=self._component
        )
        return command.message(self._route, 0)

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
