"""The pictures of one vehicle, from their announcement to the edge server.

Each picture belongs to the command that was running when it was taken; it is downloaded, reduced to
the size that the edge server takes, and sent once. No mission waits for its pictures, and none is
lost silently: the report of its command, or the log after the mission, names a missing picture.

Files are downloaded one at a time, with retries (`PictureFetcher`). A download that was interrupted
is resumed with the bytes so far; a round that received any bytes does not count as a failure.

Over MAVFTP a file is requested from the component that the announcement names, then from the
camera, then from the autopilot. A file on a web server is a job for the program's threads.
"""

import logging
import zlib
from collections import OrderedDict, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from afarcloud.enumerations import Status
from mavlink_broker.edge.wire import MissionWork
from mavlink_broker.effects import (
    ConvertedPicture,
    ConvertPicture,
    Downloaded,
    Effects,
    FetchUrl,
    Job,
    JobFailed,
    JobOutcome,
)
from mavlink_broker.mavlink.dialect import Message, Route, mavlink, source_of
from mavlink_broker.microservices.ftp_download import NO_ANSWER, FileDownload
from mavlink_broker.microservices.ftp_requests import Fetched, PartialFile
from mavlink_broker.pictures.announcements import (
    AnnouncementTracker,
    Capture,
    FileLocation,
    Location,
    WebLocation,
    read_capture,
)
from mavlink_broker.pictures.attribution import (
    Attribution,
    CommandInterval,
    PictureCommand,
    current_command,
    picture_command,
)
from mavlink_broker.pictures.feedback import Feedback, FeedbackCounter, Place, read_feedback
from mavlink_broker.pictures.vehicle_time import OWN_CLOCK_S, VehicleTime
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

MAX_FILE_BYTES: Final = 32 * 1024 * 1024
""" a camera of 50 megapixels writes half of it."""
PAUSES_S: Final = (2.0, 10.0, 30.0)
"""Before each further round: the camera may still write the file, the link may be bad."""


@dataclass(slots=True)
class PictureDownload:
    """The download of one picture."""

    number: int
    capture: Capture
    command: PictureCommand | None
    location: Location
    rounds: int = 0
    component: int = 0  # Index of the component that this round asks
    unanswered: set[int] = field(default_factory=set)  # Components that have not answered
    silent: set[int] = field(default_factory=set)  # The same, of the previous round
    not_before: float = 0.0
    reason: str = ""
    is_second_chance: bool = False
    partial: PartialFile | None = None  # The bytes so far

    def restarted(self) -> "PictureDownload":
        """Give the same download from its first round, for the last time."""
        number, capture = self.number, self.capture
        return PictureDownload(
            number,
            capture,
            self.command,
            self.location,
            is_second_chance=True,
            partial=self.partial,
        )


@dataclass(slots=True)
class Progress:
    """The result of a step: messages, jobs, and downloads that have ended."""

    messages: list[Message]
    jobs: list[Job]
    completed: list[tuple[PictureDownload, bytes]]
    failed: list[PictureDownload]

    @classmethod
    def none(cls) -> "Progress":
        """Give an empty result."""
        return cls([], [], [], [])


class PictureFetcher:
    """The downloads of one vehicle; the caller decides whether a new one may begin."""

    def __init__(self, route: Route, first_seq: int) -> None:
        self.route = route
        self._next_seq = first_seq
        self._waiting: deque[PictureDownload] = deque()
        self._running: PictureDownload | None = None
        self._download: FileDownload | None = None
        self._received_before = 0  # [bytes] Received before this transfer

    def __len__(self) -> int:
        return len(self._waiting) + (self._running is not None)

    def add(self, picture: PictureDownload) -> None:
        """Queue a download."""
        self._waiting.append(picture)

    def receive(self, message: Message, now: float) -> Progress:
        """Process an answer of a file server."""
        progress = Progress.none()
        if self._download is not None:
            progress.messages += self._download.receive(message, now)
            self._settle(progress, now)
        return progress

    def step(self, now: float, *, is_paused: bool) -> Progress:
        """Do what is due, while the vehicle is connected. `is_paused`: request nothing."""
        progress = Progress.none()
        if self._download is not None:
            self._download.is_paused = is_paused
            progress.messages += self._download.tick(now)
            self._settle(progress, now)
        if self._running is None and not is_paused:
            self._begin_next(progress, now)
        return progress

    def web_completed(self, number: int, data: bytes) -> Progress:
        """Process a file of a web server."""
        progress = Progress.none()
        if self._running is not None and self._running.number == number:
            progress.completed.append((self._running, data))
            self._running = None
        return progress

    def web_failed(self, number: int, reason: str, now: float) -> Progress:
        """Process the failure of a web server."""
        progress = Progress.none()
        if self._running is not None and self._running.number == number:
            self._retry(self._running, reason, progress, now)
        return progress

    def _begin_next(self, progress: Progress, now: float) -> None:
        picture = next((one for one in self._waiting if now >= one.not_before), None)
        if picture is None:
            return
        self._waiting.remove(picture)
        self._running = picture
        match picture.location:
            case WebLocation(url):
                progress.jobs.append(FetchUrl(picture.number, url, MAX_FILE_BYTES))
            case FileLocation(path):
                component = self._components(picture)[picture.component]
                route = self.route._replace(target_component=component)
                self._download = FileDownload(
                    path,
                    route,
                    limit_bytes=MAX_FILE_BYTES,
                    first_seq=self._next_seq,
                    partial=picture.partial,
                )
                self._received_before = self._download.partial.received
                progress.messages += self._download.start(now)

    def _components(self, picture: PictureDownload) -> Sequence[int]:
        """The components to ask in this round, without silent ones if others have answered."""
        named = picture.location.component if isinstance(picture.location, FileLocation) else None
        possible = (named, picture.capture.component, self.route.target_component)
        components = dict.fromkeys(one for one in possible if one is not None)
        return tuple(one for one in components if one not in picture.silent) or tuple(components)

    def _settle(self, progress: Progress, now: float) -> None:
        download, picture = self._download, self._running
        if download is None or picture is None or download.outcome is None:
            return
        self._download = self._running = None
        self._next_seq = download.next_seq
        if isinstance(download.outcome, Fetched):
            progress.completed.append((picture, download.outcome.data))
            return
        picture.partial = download.partial
        if download.partial.received > self._received_before:
            picture.rounds = 0  # The link is bad, but bytes arrive
        reason, asked = download.outcome.reason, self._components(picture)
        if reason == NO_ANSWER:
            picture.unanswered.add(asked[picture.component])
        picture.component += 1
        if not picture.reason or picture.reason == NO_ANSWER:
            picture.reason = reason
        if picture.component < len(asked):
            self._waiting.appendleft(picture)
        else:
            picture.component = 0
            picture.silent = set(picture.unanswered)
            self._retry(picture, picture.reason, progress, now)

    def _retry(self, picture: PictureDownload, reason: str, progress: Progress, now: float) -> None:
        self._running = None
        if picture.rounds >= len(PAUSES_S):
            picture.reason = reason
            progress.failed.append(picture)
            return
        picture.reason = ""
        picture.not_before = now + PAUSES_S[picture.rounds]
        picture.rounds += 1
        self._waiting.append(picture)


PICTURE_MESSAGES: Final = frozenset(
    {
        "CAMERA_CAPTURE_STATUS",
        "CAMERA_FEEDBACK",
        "CAMERA_IMAGE_CAPTURED",
        "FILE_TRANSFER_PROTOCOL",
    }
)
"""Messages of a vehicle's components about pictures."""
PROGRESS_WITHIN_S: Final = 10.0
"""A picture that no command known to run has taken waits so long for the mission's progress."""
CHECK_AFTER_S: Final = 2.0
CHECKS: Final = 5
DEVELOPING: Final = 2
"""Pictures whose bytes are in memory at once."""
MAX_UNFINISHED: Final = 1000
MAX_IDENTITIES: Final = 4000
MAX_CAMERAS: Final = 8

_LOG = logging.getLogger(__name__)


class _AnnouncedPicture(NamedTuple):
    """A picture that was announced, and is of no command yet."""

    capture: Capture
    time_s: float  # When it was taken, by the vehicle's clock
    announced_at: float
    is_of_earlier_run: bool


class _ReportedPicture(NamedTuple):
    """A picture that the autopilot has reported, and that is of no command yet."""

    camera: int
    since_s: float
    time_s: float
    place: Place | None


class PictureCollector:
    """The pictures of one vehicle."""

    def __init__(self, vehicle: Vehicle, reporter: Reporter) -> None:
        self._vehicle = vehicle
        self._reporter = reporter
        self._attribution = Attribution()
        self._taken: list[
            _AnnouncedPicture | _ReportedPicture
        ] = []  # Since the last step, in their order
        self._cameras: dict[int, AnnouncementTracker] = {}
        self._feedback = FeedbackCounter()
        self._clock_s: dict[int, float] = {}  # Of each camera: its lag behind the autopilot's clock
        self._seen: OrderedDict[str, None] = OrderedDict()
        first_seq = zlib.crc32(reporter.session_id.encode())
        self._fetching = PictureFetcher(vehicle.route, first_seq)
        self._developing: dict[int, PictureDownload] = {}
        self._postponed: list[PictureDownload] = []
        self._number = 0
        self._flight: tuple[MissionWork, MissionLedger] | None = None
        self._faults: list[tuple[PictureCommand, str]] = []
        self._time = VehicleTime(vehicle)
        self.has_room = True  # The edge server keeps up with the pictures
        self.is_reachable = False  # Whether the vehicle is connected

    @property
    def unfinished(self) -> int:
        """How many announced pictures were not sent yet."""
        taken = len(self._taken) + len(self._fetching)
        return taken + len(self._developing) + len(self._postponed)

    @property
    def is_fetching(self) -> bool:
        """Whether downloads from a connected vehicle are unfinished."""
        return self.is_reachable and self.unfinished > 0

    def update_mission(
        self, work: MissionWork | None, ledger: MissionLedger | None, now: float
    ) -> None:
        """Follow the mission that is flown, if any, and its progress."""
        self._follow_clock(now)
        command = None
        if work is not None and ledger is not None:
            self._flight = work, ledger
            if ledger.status is Status.RUNNING:
                command = current_command(ledger, work.mission.command_array, work.name)
        before, time_s = self._attribution.current, self._time.at(now)
        is_resumed = work is not None and work.was_accepted
        for passed in self._passed(before):
            self._attribution.update(passed, time_s)
        is_change = self._attribution.update(
            command, time_s, seen_s=self._time.received_s, is_resumed=is_resumed
        )
        self._attribute_taken(now)
        if is_change and (command is None or before is None):
            for camera in self._cameras.values():  # A mission begins or ends
                camera.request_count()

    def _follow_clock(self, now: float) -> None:
        self._attribution.shift(self._time.update(now))

    def _passed(self, before: PictureCommand | None) -> Iterator[PictureCommand]:
        """Give the commands behind `before` that have ended since the last step, too."""
        if before is None or self._flight is None:
            return
        work, ledger = self._flight
        if before.mission != work.name:
            return
        commands = work.mission.command_array
        for index in range(before.command + 1, min(ledger.finished, len(commands))):
            yield picture_command(ledger, commands, work.name, index)

    def _attribute_taken(self, now: float) -> None:
        """Give pictures to commands, in their order, once it is known which of them have begun."""
        taken, self._taken = sorted(self._taken, key=lambda one: one.time_s), []
        for one in taken:
            if isinstance(one, _ReportedPicture):
                self._attribution.attribute_feedback(*one)
                continue
            if self._must_wait(one, now):
                self._taken.append(one)
                continue
            command = self._attribution.attribute(
                one.time_s, one.capture.component, one.capture.position
            )
            if command is not None or one.is_of_earlier_run:
                self._fetch(one.capture, command)

    def _must_wait(self, one: _AnnouncedPicture, now: float) -> bool:
        """Whether an earlier picture, or the progress of the mission, is still to be received."""
        capture = one.capture
        if self._cameras[capture.component].lacks_before(capture.index):
            return True
        may_be_of_later = self._attribution.may_be_of_later(
            one.time_s, capture.component, capture.position
        )
        return may_be_of_later and now - one.announced_at < PROGRESS_WITHIN_S

    def restarted(self) -> None:
        """Note that the vehicle has restarted: its clock begins anew, and perhaps its camera's.

        Earlier pictures stay with earlier commands.
        """
        self._clock_s.clear()
        self._feedback.restarted(self._time.restarted())
        for camera in self._cameras.values():
            camera.request_count()

    def add_camera(self, component: int) -> None:
        """Add a component that is a camera; request the pictures that were not announced here."""
        if component not in self._cameras and len(self._cameras) < MAX_CAMERAS:
            camera = AnnouncementTracker(component, self._vehicle.route, self._vehicle.round_trip)
            camera.request_count(go_back=True)
            self._cameras[component] = camera
            self._vehicle.add_camera(component)

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Process a component's message about pictures."""
        self._follow_clock(now)
        match message.get_type():
            case "CAMERA_IMAGE_CAPTURED" | "CAMERA_CAPTURE_STATUS" if self._time.is_doubtful:
                pass  # They are asked for again when the vehicle's time is known
            case "CAMERA_IMAGE_CAPTURED":
                self._take_capture(read_capture(message), now)
            case "CAMERA_FEEDBACK":
                self._take_feedback(read_feedback(message), now)
            case "CAMERA_CAPTURE_STATUS":
                self._take_status(message, now)
            case "FILE_TRANSFER_PROTOCOL":
                self._carry_out(self._fetching.receive(message, now), effects)

    def step(self, now: float, effects: Effects, *, is_busy: bool) -> None:
        """Do what is due, while the vehicle is connected; `is_busy` with more urgent transfers."""
        for camera in self._cameras.values():
            messages, lost = camera.tick(now)
            effects.messages += messages
            for number in lost:
                _LOG.warning("vehicle %d: picture %d is lost", self._vehicle.vehicle_id, number)
        self._request_missing(now)
        self._resume_postponed()
        self._fetching.route = self._vehicle.route
        is_paused = is_busy or not self.has_room or len(self._developing) >= DEVELOPING
        self._carry_out(self._fetching.step(now, is_paused=is_paused), effects)
        self._report_faults(effects)

    def take_outcome(self, outcome: JobOutcome, now: float, effects: Effects) -> None:
        """Process the outcome of a job."""
        match outcome:
            case Downloaded(number, data):
                self._carry_out(self._fetching.web_completed(number, data), effects)
            case ConvertedPicture(number) if number in self._developing:
                picture = self._developing.pop(number)
                effects.for_edge.append(self._reporter.image(outcome, *self._named(picture)))
            case JobFailed(number, reason) if number in self._developing:
                self._fault(self._developing.pop(number), reason)
            case JobFailed(number, reason):
                self._carry_out(self._fetching.web_failed(number, reason, now), effects)
        self._report_faults(effects)

    # Announcements

    def _take_status(self, message: Message, now: float) -> None:
        component = source_of(message).component
        if component in self._cameras:
            self._cameras[component].take_count(message.image_count)
            if message.time_boot_ms and self._vehicle.snapshot.time_s is not None:
                camera_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
                self._clock_s[component] = self._time.since_boot_s(now) - camera_s

    def _take_capture(self, capture: Capture, now: float) -> None:
        self.add_camera(capture.component)
        camera = self._cameras.get(capture.component)
        if camera is None:
            return
        taken_s = self._taken_s(capture, now)
        is_recent = self._time.is_recent(taken_s, now)
        is_of_earlier_run = is_recent and not self._attribution.began_before(taken_s)
        is_new = camera.take(capture, goes_back=is_recent)
        if not is_new or capture.identity in self._seen:
            return
        self._seen[capture.identity] = None
        if len(self._seen) > MAX_IDENTITIES:
            self._seen.popitem(last=False)
        self._taken.append(_AnnouncedPicture(capture, taken_s, now, is_of_earlier_run))

    def _take_feedback(self, feedback: Feedback, now: float) -> None:
        booted_s = self._vehicle.snapshot.booted_at_utc_s
        taken_s = self._time.of(feedback.taken_s(self._time.since_boot_s(now), booted_s), None, now)
        count, since_s = self._feedback.take(feedback, taken_s)
        for lost in reversed(range(count)):
            place = None if lost else feedback.place
            since_s = since_s if lost else taken_s
            self._taken.append(_ReportedPicture(feedback.camera, since_s, taken_s, place))

    def _taken_s(self, capture: Capture, now: float) -> float:
        """The time when it was taken, by the autopilot's clock; a camera may have its own.

        The difference of the clocks is known from CAMERA_CAPTURE_STATUS, which a camera sends at
        once; it sends an announcement only when it has stored the picture.
        """
        if capture.taken_s is None:
            return self._time.at(now)
        is_known = capture.component in self._clock_s
        behind_s = self._clock_s.get(capture.component, 0.0)
        taken_s = self._vehicle.snapshot.since_boot_s(round(capture.taken_s * 1e3))
        has_own = abs(behind_s) > OWN_CLOCK_S
        taken_s += behind_s if has_own else 0.0
        is_same = is_known and not has_own
        return self._time.of(taken_s, capture.taken_utc_s, now, is_same_clock=is_same)

    def _fetch(self, capture: Capture, command: PictureCommand | None) -> None:
        self._number += 1
        location = capture.location
        if not capture.has_succeeded:
            self._report(command, f"the camera could not take picture {capture.index}")
        elif location is None:
            where = (
                f"{capture.url!r} is not a location" if capture.url else "its location is unknown"
            )
            self._report(command, f"picture {capture.index} cannot be fetched: {where}")
        elif self.unfinished >= MAX_UNFINISHED:
            self._report(command, f"picture {capture.index} is not fetched: too many wait")
        else:
            self._fetching.add(PictureDownload(self._number, capture, command, location))

    def _request_missing(self, now: float) -> None:
        for interval in self._attribution.incomplete():
            if self._time.at(now) >= interval.ended_s + CHECK_AFTER_S:
                self._request_missing_of(interval, now)

    def _request_missing_of(self, interval: CommandInterval, now: float) -> None:
        if now < interval.check_at_s or any(
            camera.is_requesting for camera in self._cameras.values()
        ):
            return
        interval.checks += 1
        interval.check_at_s = now + CHECK_AFTER_S * 2 ** (interval.checks - 1)
        awaits_feedback = self._feedback.is_used and interval.unproved > 0
        if interval.checks > CHECKS or not (self._cameras or awaits_feedback):
            self._give_up_missing(interval)
            return
        for camera in self._cameras.values():
            camera.request_count()

    def _give_up_missing(self, interval: CommandInterval) -> None:
        """Report pictures of which nobody knows, and those of which there is no file."""
        interval.is_given_up = True
        expected = 0 if interval.command is None else interval.command.expected
        if interval.unproved:
            text = f"{interval.unproved} of {expected} pictures were not announced"
            self._report(interval.command, text)
        without_file = interval.missing - interval.unproved
        if without_file:
            where = f" at {', '.join(map(str, interval.places))}" if interval.places else ""
            text = f"{without_file} of {expected} pictures were taken{where}, and have no file"
            self._report(interval.command, text)

    # Results

    def _carry_out(self, progress: Progress, effects: Effects) -> None:
        effects.messages += progress.messages
        effects.jobs += progress.jobs
        for picture, data in progress.completed:
            self._developing[picture.number] = picture
            effects.jobs.append(ConvertPicture(picture.number, data))
        for picture in progress.failed:
            self._give_up(picture)

    def _give_up(self, picture: PictureDownload) -> None:
        """Give a picture up, or postpone it: some vehicles send files only after landing."""
        if picture.is_second_chance or self._vehicle.snapshot.armed is False:
            self._fault(picture, picture.reason)
            return
        number = picture.capture.index
        self._report(picture.command, f"picture {number} cannot be had in flight: {picture.reason}")
        self._postponed.append(picture)

    def _resume_postponed(self) -> None:
        if self._vehicle.snapshot.armed is not False:
            return
        for picture in self._postponed:
            self._fetching.add(picture.restarted())
        self._postponed.clear()

    def _named(self, picture: PictureDownload) -> tuple[str, str]:
        """Give the name and the unique identity of a picture."""
        command, capture = picture.command, picture.capture
        prefix = "found" if command is None else f"m{command.mission_id}_c{command.command_id}"
        if command is None and self._flight is not None:
            prefix = f"m{self._flight[1].mission_id}_found"
        camera = "" if capture.component == mavlink.MAV_COMP_ID_CAMERA else f"_k{capture.component}"
        identity = f"{self._vehicle.vehicle_id}/{capture.identity}"
        return f"{prefix}{camera}_{capture.index:04d}", identity

    def _fault(self, picture: PictureDownload, reason: str) -> None:
        self._report(picture.command, f"picture {picture.capture.index} cannot be had: {reason}")

    def _report(self, command: PictureCommand | None, text: str) -> None:
        _LOG.warning("vehicle %d: %s", self._vehicle.vehicle_id, text)
        if command is not None:
            self._faults.append((command, text))

    def _report_faults(self, effects: Effects) -> None:
        """Add missing pictures to the reports of their commands, while the mission runs."""
        faults, self._faults = self._faults, []
        has_changed = False
        for command, text in faults:
            work, ledger = self._flight or (None, None)
            if work is None or ledger is None or work.name != command.mission:
                continue
            if not ledger.status.is_terminal:
                ledger.add_note(command.command, text)
                has_changed = True
        if has_changed and self._flight is not None:
            effects.for_edge.append(self._reporter.mission(self._flight[1]))
