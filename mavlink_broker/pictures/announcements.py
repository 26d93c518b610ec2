"""Announcements of pictures: requests for those that were lost, and the command of each picture.

A camera numbers its pictures from 0 without gaps and announces each of them once. The broker
requests the numbers that are missing between two others, or up to the camera's own count:
REQUEST_MESSAGE(512) of CAMERA_IMAGE_CAPTURED(263) with the number. A restarted broker requests
from the newest backwards, as far as pictures may belong to its missions.

Each picture belongs to the command that ran when it was taken (`Attribution`). The interval of a
command runs from the end of the previous command to its own end, by the vehicle's clock and as far
as the broker knows it. The broker learns of a command up to a second late, later after a lost link
or a pause of its own, and a camera may need some time. So a command that lacks pictures also gets
those from shortly before its predecessor was seen last, and from shortly after its interval; of
several such commands the one at whose place a picture was taken, by the positions of both. What
an autopilot reports of pictures (`feedback`) is counted as of other cameras.
"""

import math
import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias
from urllib.parse import urlsplit

from afarcloud.commands import (
    CameraImage,
    CameraPanorama,
    Command,
    NavHotpoint,
    NavTakeoff,
    NavWaypoint,
    VideoStartCapture,
    VideoStopCapture,
)
from afarcloud.enumerations import PanoramaMode
from afarcloud.geodesy import distance_m
from mavlink_broker.mavlink.dialect import Message, Route, mavlink, source_of
from mavlink_broker.microservices.command import RoundTrip, long_command
from mavlink_broker.pictures.feedback import Place
from mavlink_broker.vehicle.mission_ledger import MissionLedger

EARLY_S: Final = 3.0
LATE_S: Final = 10.0
MAX_INTERVALS: Final = 1000
MAX_PLACES: Final = 5
AT_PLACE_M: Final = 15.0
"""So near to its command's place a picture is taken, with the errors of two positions."""
SAME_PLACE_M: Final = 3.0
FEEDBACK: Final = 256
"""Number of the autopilot's first camera, behind those of all components."""
_PANORAMA_SHOTS: Final = {PanoramaMode.FULL_CIRCLE: 8, PanoramaMode.HALF_CIRCLE: 5}


Position: TypeAlias = tuple[float, float]
"""Latitude and longitude [deg]."""


class Area(NamedTuple):
    """Where a command takes its pictures: a point, or a circle that the vehicle has flown."""

    latitude_deg: float
    longitude_deg: float
    radius_m: float = 0.0

    def off_m(self, latitude_deg: float, longitude_deg: float) -> float:
        """How far a position is from the point, or from the circle."""
        from_centre_m = distance_m(
            latitude_deg, longitude_deg, self.latitude_deg, self.longitude_deg
        )
        return abs(from_centre_m - self.radius_m)


@dataclass(frozen=True, slots=True)
class PictureCommand:
    """A command, and the number of pictures that it takes."""

    mission: str  # Unique name of the mission
    mission_id: int
    command: int  # Its index in the mission
    command_id: int
    expected: int
    area: Area | None = None  # None: not known before the flight


def pictures_of(command: Command) -> int:
    """Give the number of pictures of a command."""
    match command:
        case CameraImage():
            return command.parameters.photo_count
        case CameraPanorama():
            return _PANORAMA_SHOTS[command.parameters.panorama_mode]
        case _:
            return 0


def current_command(
    ledger: MissionLedger, commands: tuple[Command, ...], mission: str
) -> PictureCommand | None:
    """Give the command of a mission that runs, or is next."""
    if ledger.finished >= len(commands):
        return None
    return picture_command(ledger, commands, mission, ledger.finished)


def picture_command(
    ledger: MissionLedger, commands: tuple[Command, ...], mission: str, index: int
) -> PictureCommand:
    """Give a command of a mission by its index."""
    command = commands[index]
    count, area = pictures_of(command), _area_of(commands, index)
    return PictureCommand(mission, ledger.mission_id, index, command.command_id, count, area)


def _area_of(commands: tuple[Command, ...], index: int) -> Area | None:
    """Give where a command before has brought the vehicle; None if that depends on the flight."""
    for command in reversed(commands[:index]):
        match command:
            case NavWaypoint() | NavTakeoff():
                return Area(command.parameters.latitude, command.parameters.longitude)
            case NavHotpoint():
                centre = command.parameters.latitude, command.parameters.longitude
                return Area(*centre, command.parameters.radius)
            case CameraImage() | CameraPanorama() | VideoStartCapture() | VideoStopCapture():
                continue
            case _:
                return None
    return None


@dataclass(slots=True)
class CommandInterval:
    """The interval of one command, or between missions."""

    command: PictureCommand | None
    began_s: float
    earliest_s: float  # It may have begun since then, when its predecessor was seen last
    ended_s: float = math.inf
    is_partial: bool = False  # Its beginning was not observed
    counts: dict[int, int] = field(default_factory=dict)  # Its pictures, by camera
    places: list[Place] = field(default_factory=list)  # Where the first ones of feedback were taken
    is_given_up: bool = False  # Its missing pictures were requested often enough
    checks: int = 0  # Number of these requests
    check_at_s: float = 0.0

    @property
    def missing(self) -> int:
        """How many of its pictures were not announced by the camera that announced the most.

        Each camera of a vehicle takes all pictures of a command, or none of them.
        """
        announced = [camera for camera in self.counts if camera < FEEDBACK]
        return min(map(self.missing_of, announced), default=self.missing_of(None))

    @property
    def late_s(self) -> float:
        """How long behind its end its pictures may be taken.

        One whose beginning was not observed may have its pictures, whose announcements are not
        here yet: later ones are not its own.
        """
        return 0.0 if self.is_partial else LATE_S

    @property
    def unproved(self) -> int:
        """How many of its pictures nobody has reported.

        The autopilot's feedback counts if no camera has announced any: it comes for each picture
        of a camera that announces them too.
        """
        is_announced = any(camera < FEEDBACK for camera in self.counts)
        by_autopilot = [] if is_announced else list(map(self.missing_of, self.counts))
        return min(by_autopilot, default=self.missing)

    def missing_of(self, camera: int | None) -> int:
        """How many of its pictures a camera has not announced; None: one without pictures."""
        count = 0 if camera is None else self.counts.get(camera, 0)
        return 0 if self.command is None else max(0, self.command.expected - count)

    def count(self, camera: int) -> None:
        """Count a picture of a camera."""
        self.counts[camera] = self.counts.get(camera, 0) + 1


class Attribution:
    """The intervals of the last commands of one vehicle."""

    def __init__(self) -> None:
        self._intervals: deque[CommandInterval] = deque(maxlen=MAX_INTERVALS)
        self._incomplete: list[CommandInterval] = []
        self._seen_s: float | None = None  # When the present command was seen last

    @property
    def current(self) -> PictureCommand | None:
        """The command that runs."""
        return self._intervals[-1].command if self._intervals else None

    def update(
        self,
        command: PictureCommand | None,
        time_s: float,
        *,
        seen_s: float | None = None,
        is_resumed: bool = False,
    ) -> bool:
        """Follow the command that runs, `is_resumed` if it ran before; return if it changed.

        `seen_s` is when the vehicle was last received, now by default.
        """
        if self._intervals and self._intervals[-1].command == command:
            self._seen_s = time_s if seen_s is None else seen_s
            return False
        if self._intervals:
            self._end(self._intervals[-1], time_s)
        is_first = all(interval.command is None for interval in self._intervals)
        earliest_s = time_s if self._seen_s is None else min(self._seen_s, time_s)
        partial = is_resumed and is_first
        self._intervals.append(CommandInterval(command, time_s, earliest_s, is_partial=partial))
        return True

    def shift(self, shift_s: float) -> None:
        """Shift all times, for another clock is used from now on."""
        if shift_s:
            self._seen_s = None if self._seen_s is None else self._seen_s + shift_s
            for interval in self._intervals:
                interval.began_s += shift_s
                interval.earliest_s += shift_s
                interval.ended_s += shift_s

    def _end(self, interval: CommandInterval, time_s: float) -> None:
        interval.ended_s = time_s
        if interval.missing and not interval.is_partial:
            self._incomplete.append(interval)

    def attribute(
        self, time_s: float, camera: int, position: Position | None = None
    ) -> PictureCommand | None:
        """Give the command of a picture that a camera took at a time, and count the picture.

        `position` is where it was taken, None if that is not known.
        """
        interval = self._count(time_s, time_s, camera, position)
        return None if interval is None else interval.command

    def attribute_feedback(
        self, camera: int, since_s: float, time_s: float, place: Place | None
    ) -> None:
        """Count a picture of an autopilot's camera; `since_s` if it was taken at most so early."""
        position = None if place is None else place[:2]
        interval = self._count(since_s, time_s, FEEDBACK + camera, position)
        if interval is not None and place is not None and len(interval.places) < MAX_PLACES:
            interval.places.append(place)

    def _count(
        self, since_s: float, time_s: float, camera: int, position: Position | None
    ) -> CommandInterval | None:
        interval = self._find(since_s, time_s, camera, position)
        if interval is not None:
            interval.count(camera)
        return interval

    def _find(
        self, since_s: float, time_s: float, camera: int, position: Position | None
    ) -> CommandInterval | None:
        """Find the command of a picture.

        The place decides among commands that lack pictures, then among those shortly before and
        after, at last among those that have all of theirs. Else it is the first one that lacks
        pictures, or the one that ran.
        """
        lacking = self._lacking(since_s, time_s, camera)
        around = self._around(since_s, time_s)
        still_lacking = [one for one in around if one.missing_of(camera)]
        for candidates in (lacking, still_lacking, around):
            at_place = _at(position, candidates)
            if at_place is not None:
                return at_place
        if lacking:
            return lacking[0]
        ran = (one for one in self._intervals if one.began_s <= time_s < one.ended_s)
        return next(ran, None)

    def _around(self, since_s: float, time_s: float) -> list[CommandInterval]:
        """Give the commands with pictures that may have run some seconds before or after."""
        return [
            one
            for one in self._intervals
            if one.command is not None
            and one.command.expected
            and one.earliest_s - LATE_S <= time_s
            and since_s <= one.ended_s + LATE_S
        ]

    def may_be_of_later(self, time_s: float, camera: int, position: Position | None) -> bool:
        """Whether a picture may be of a command of which it is not known yet that it runs.

        No command lacks it while one runs, or none that takes its pictures at its position.
        """
        lacking = self._lacking(time_s, time_s, camera)
        if not lacking:
            return self.current is not None
        if position is None:
            return False
        return AT_PLACE_M < min(_off_m(interval, position) for interval in lacking) < math.inf

    def _lacking(self, since_s: float, time_s: float, camera: int) -> list[CommandInterval]:
        """Give the commands that lack pictures of a camera, and may have taken one then."""
        return [
            interval
            for interval in self._intervals
            if interval.missing_of(camera)
            and interval.earliest_s - EARLY_S <= time_s
            and since_s <= interval.ended_s + interval.late_s
        ]

    def began_before(self, time_s: float) -> bool:
        """Whether the intervals reach back to a time."""
        return bool(self._intervals) and self._intervals[0].began_s <= time_s

    def incomplete(self) -> Iterator[CommandInterval]:
        """Give the commands that have ended without all of their pictures."""
        self._incomplete = [
            interval
            for interval in self._incomplete
            if interval.missing and not interval.is_given_up
        ]
        return iter(self._incomplete)


def _at(position: Position | None, candidates: list[CommandInterval]) -> CommandInterval | None:
    """Give the first of those commands that take their pictures nearest to a position.

    None without a position, or if none of them takes its pictures there.
    """
    if position is None or not candidates:
        return None
    off_m = [_off_m(interval, position) for interval in candidates]
    nearest_m = min(off_m)
    if nearest_m > AT_PLACE_M:
        return None
    return next(
        interval
        for interval, one_m in zip(candidates, off_m, strict=True)
        if one_m <= nearest_m + SAME_PLACE_M
    )


def _off_m(interval: CommandInterval, position: Position) -> float:
    area = None if interval.command is None else interval.command.area
    return math.inf if area is None else area.off_m(*position)


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
        """Whether an earlier picture than this one, and a later one than the first, is requested.

        Those of before the first one are not waited for.
        """
        first = min(self._announced, default=number)
        return any(first < one < number for one in self._images)

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
