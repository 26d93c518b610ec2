"""The pictures of one vehicle, from their announcement to the edge server.

Each picture belongs to the command that was running when it was taken; it is downloaded, reduced to
the size that the edge server takes, and sent once. No mission waits for its pictures, and none is
lost silently: the report of its command, or the log after the mission, names a missing picture.

A restarted broker may receive pictures before it has its mission again: they wait for it
(`MissionFollower`).
"""

import logging
import zlib
from collections import OrderedDict
from typing import Final, NamedTuple

from mavlink_broker.edge.wire import MissionWork
from mavlink_broker.effects import (
    ConvertedPicture,
    ConvertPicture,
    Downloaded,
    Effects,
    JobFailed,
    JobOutcome,
)
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.pictures.announcements import (
    MAX_CAMERAS,
    AnnouncementTracker,
    Capture,
    Feedback,
    FeedbackCounter,
    Place,
    read_capture,
    read_feedback,
)
from mavlink_broker.pictures.attribution import (
    Attribution,
    CommandInterval,
    PictureCommand,
)
from mavlink_broker.pictures.downloads import PictureDownload, PictureFetcher, Progress
from mavlink_broker.pictures.mission_follower import MissionFollower
from mavlink_broker.pictures.vehicle_time import OWN_CLOCK_S, CameraClocks, VehicleTime
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

PICTURE_MESSAGES: Final = frozenset(
    {"CAMERA_CAPTURE_STATUS", "CAMERA_FEEDBACK", "CAMERA_IMAGE_CAPTURED", "FILE_TRANSFER_PROTOCOL"}
)
"""Messages of a vehicle's components about pictures."""
PROGRESS_WITHIN_S: Final = 10.0
"""How long a picture of no known command waits for the mission's progress."""
STORED_WITHIN_S: Final = 3.0
"""How long after a later picture a camera may store, number and announce an earlier one."""
MISSION_WITHIN_S: Final = 120.0
"""How long pictures wait for the mission of an earlier run, which the edge server sends again."""
CHECK_AFTER_S: Final = 2.0
CHECKS: Final = 5
DEVELOPING: Final = 2
"""Pictures whose bytes are in memory at once."""
MAX_UNFINISHED: Final = 1000
MAX_IDENTITIES: Final = 4000

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
        # Since the last step, in their order
        self._taken: list[_AnnouncedPicture | _ReportedPicture] = []
        self._cameras: dict[int, AnnouncementTracker] = {}
        self._feedback = FeedbackCounter()
        self._clocks = CameraClocks()
        self._seen: OrderedDict[str, None] = OrderedDict()
        first_seq = zlib.crc32(reporter.session_id.encode())
        self._fetching = PictureFetcher(vehicle.route, first_seq)
        self._developing: dict[int, PictureDownload] = {}
        self._postponed: list[PictureDownload] = []
        self._number = 0
        self._faults: list[tuple[PictureCommand, str]] = []
        self._time = VehicleTime(vehicle)
        self._mission = MissionFollower(vehicle, self._time, self._attribution)
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
        self,
        work: MissionWork | None,
        ledger: MissionLedger | None,
        now: float,
        *,
        is_followed: bool,
    ) -> None:
        """Follow the mission that is flown (`MissionFollower.update`); give its pictures to it."""
        is_change = self._mission.update(work, ledger, now, is_followed=is_followed)
        self._attribute_taken(now)
        if is_change:
            for camera in self._cameras.values():  # A mission begins or ends
                camera.request_count()

    def _attribute_taken(self, now: float) -> None:
        """Give pictures to commands, in their order, once it is known which of them have begun."""
        taken, self._taken = sorted(self._taken, key=lambda one: one.time_s), []
        waiting = set[int]()  # Cameras of which a picture waits: later ones wait behind it
        for one in taken:
            if isinstance(one, _ReportedPicture):
                self._attribution.attribute_feedback(*one)
                continue
            if one.capture.component in waiting or self._must_wait(one, now):
                waiting.add(one.capture.component)
                self._taken.append(one)
                continue
            command = self._attribution.attribute(
                one.time_s, one.capture.component, one.capture.position
            )
            is_of_earlier = one.is_of_earlier_run or self._mission.is_of_earlier_flight(one.time_s)
            if command is not None or is_of_earlier:
                self._fetch(one, command, now)

    def _must_wait(self, one: _AnnouncedPicture, now: float) -> bool:
        """Whether an earlier picture, or the progress of the mission, is still to be received."""
        capture = one.capture
        camera = self._cameras[capture.component]
        if camera.lacks_before(capture.index):
            return True
        is_undated = one.is_of_earlier_run and not self._time.knows_rate
        if is_undated and now - one.announced_at < STORED_WITHIN_S:
            return True
        if camera.goes_back and one.time_s < self._mission.followed_from_s:
            return True  # They are given to commands in their order, and arrive in reverse
        if self._mission.flight is None:
            return self._mission.is_mission_open and now - one.announced_at < MISSION_WITHIN_S
        picture = one.time_s, capture.component, capture.position
        # The broker may have stood still
        waited_s = now - max(one.announced_at, self._mission.followed_since)
        if waited_s < STORED_WITHIN_S and self._attribution.may_be_overtaken(*picture):
            return True
        return waited_s < PROGRESS_WITHIN_S and self._attribution.may_be_of_later(*picture)

    def restarted(self) -> None:
        """Note that the vehicle has restarted: its clock begins anew, and perhaps its camera's.

        Earlier pictures stay with earlier commands, also with those that it has flown unseen.
        """
        self._mission.restarted()
        self._clocks.clear()
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
        self._mission.follow_clock(now)
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
                report = self._reporter.image(outcome, *self._named(picture), picture.taken_at)
                effects.for_edge.append(report)
            case JobFailed(number, reason) if number in self._developing:
                self._fault(self._developing.pop(number), reason)
            case JobFailed(number, reason):
                self._carry_out(self._fetching.web_failed(number, reason, now), effects)
        self._report_faults(effects)

    def _take_status(self, message: Message, now: float) -> None:
        component = source_of(message).component
        camera = self._cameras.get(component)
        if camera is None:
            return
        snapshot, boot_ms = self._vehicle.snapshot, message.time_boot_ms
        camera_s = None if snapshot.time_s is None else snapshot.since_boot_s(boot_ms)
        if boot_ms and not self._clocks.take(component, camera_s, self._time, now):
            camera.request_count()
            return
        camera.take_count(message.image_count)

    def _take_capture(self, capture: Capture, now: float) -> None:
        self.add_camera(capture.component)
        camera = self._cameras.get(capture.component)
        if camera is None or self._clocks.is_doubtful(capture.component, now):
            return  # It is asked for again when its time is known
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
        lag_s = self._clocks.lag_s(capture.component)
        taken_s = self._vehicle.snapshot.since_boot_s(round(capture.taken_s * 1e3))
        has_own = lag_s is not None and abs(lag_s) > OWN_CLOCK_S
        taken_s += (lag_s or 0.0) if has_own else 0.0
        is_same = lag_s is not None and not has_own
        return self._time.of(taken_s, capture.taken_utc_s, now, is_same_clock=is_same)

    def _fetch(
        self, announced: _AnnouncedPicture, command: PictureCommand | None, now: float
    ) -> None:
        self._number += 1
        capture, location = announced.capture, announced.capture.location
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
            taken_at = self._time.broker_time(announced.time_s, now)
            self._fetching.add(PictureDownload(self._number, capture, command, location, taken_at))

    def _request_missing(self, now: float) -> None:
        for interval in self._attribution.incomplete():
            has_ended = self._time.at(now) >= interval.ended_s + CHECK_AFTER_S
            is_due = has_ended and now >= interval.check_at_s
            if is_due and not any(camera.is_requesting for camera in self._cameras.values()):
                self._request_missing_of(interval, now)

    def _request_missing_of(self, interval: CommandInterval, now: float) -> None:
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
        if command is None and self._mission.flight is not None:
            prefix = f"m{self._mission.flight[1].mission_id}_found"
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
        if self._mission.flight is None:
            return
        work, ledger = self._mission.flight
        of_mission = [(command, text) for command, text in faults if command.mission == work.name]
        if of_mission and not ledger.status.is_terminal:
            for command, text in of_mission:
                ledger.add_note(command.command, text)
            effects.for_edge.append(self._reporter.mission(ledger))
