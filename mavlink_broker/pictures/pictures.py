"""The pictures of one vehicle, from their announcement to the edge server.

Each picture belongs to the command that was running when it was taken; it is downloaded, reduced to
the size that the edge server takes, and sent once. No mission waits for its pictures, and none is
lost silently: the report of its command, or the log after the mission, names a missing picture.

A restarted broker may receive pictures before it has its mission again: they wait for it
(`EarlierFlight`).
"""

import logging
import math
import zlib
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from afarcloud.enumerations import Status
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
    EarlierFlight,
    PictureCommand,
    current_command,
    picture_command,
)
from mavlink_broker.pictures.downloads import PictureDownload, PictureFetcher, Progress
from mavlink_broker.pictures.vehicle_time import (
    OWN_CLOCK_S,
    UNSEEN_BOOT_S,
    CameraClocks,
    VehicleTime,
)
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

PICTURE_MESSAGES: Final = frozenset(
    {"CAMERA_CAPTURE_STATUS", "CAMERA_FEEDBACK", "CAMERA_IMAGE_CAPTURED", "FILE_TRANSFER_PROTOCOL"}
)
"""Messages of a vehicle's components about pictures."""
PROGRESS_WITHIN_S: Final = 10.0
"""A picture that no command known to run has taken waits so long for the mission's progress."""
PROGRESS_GAP_S: Final = 5.0
PROGRESS_SETTLED_S: Final = 5.0
"""So long after a gap in its progress the vehicle may be further than the ledger."""
STORED_WITHIN_S: Final = 3.0
"""A camera may store a picture, and number and announce it, so long behind a later one."""
MISSION_WITHIN_S: Final = 120.0
"""How long pictures wait for the mission of an earlier run, which the edge server sends again."""
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
        self._flight: tuple[MissionWork, MissionLedger] | None = None
        self._faults: list[tuple[PictureCommand, str]] = []
        self._time = VehicleTime(vehicle)
        self._followed_since = -math.inf  # From then on its progress is that of this run
        self._updated_at = math.inf
        self._updated_s = 0.0  # The same, by the vehicle's clock
        self._shown_since = -math.inf  # From then on the vehicle has shown it without a gap
        self._earlier = EarlierFlight()
        self._is_shifted = False  # To the clock before a restart since that flight
        self._followed_from_s = math.inf  # When the first command of a mission was followed
        self._flight_known_s = math.inf  # When the first mission of this run was received
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
        """Follow the mission that is flown, if any, and its progress.

        `is_followed`: the ledger has the progress that the vehicle shows, not that of an earlier
        run.
        """
        self._follow_clock(now)
        is_earlier = work is None or work.was_accepted
        if is_earlier and self._followed_from_s == math.inf:
            self._earlier.recall(self._vehicle.recovery)
        command = None
        if work is not None and ledger is not None:
            if self._flight is None:
                self._flight_known_s = self._time.at(now)
            self._flight = work, ledger
            if ledger.status is Status.RUNNING and self._may_follow:
                command = current_command(ledger, work.mission.command_array, work.name)
        stood_still = now - self._updated_at > PROGRESS_GAP_S  # What has waited is read first
        time_s = self._time.at(now)
        if stood_still:  # What has waited has an old time, and what the vehicle has begun may not
            time_s = max(time_s, self._updated_s + now - self._updated_at)
        if stood_still or not is_followed:
            self._followed_since = now
        self._updated_at, self._updated_s = now, self._time.at(now)
        is_change = self._follow_command(command, now, time_s)
        self._attribute_taken(now)
        if is_change:
            for camera in self._cameras.values():  # A mission begins or ends
                camera.request_count()

    @property
    def _may_follow(self) -> bool:
        """Whether the journal is read by now, and the vehicle's clock known if it has times of it.

        Before that the broker's own clock stands in for it.
        """
        if self._followed_from_s < math.inf:
            return True
        return self._vehicle.is_identified and (self._time.is_known or not self._earlier.has_times)

    def _follow_command(self, command: PictureCommand | None, now: float, time_s: float) -> bool:
        """Follow the command that runs; returns whether a mission begins or ends."""
        before = self._attribution.current
        ledger = None if self._flight is None else self._flight[1]
        is_of_boot_before = self._vehicle.recovery.was_restarted_since
        if is_of_boot_before and not self._is_shifted and self._followed_from_s < math.inf:
            self._is_shifted = True
            self._attribution.shift_earlier(-UNSEEN_BOOT_S)
        for passed in self._behind(before, 0 if ledger is None else ledger.begun):
            self._attribution.update(passed, time_s)
        self._add_unseen(time_s, 0 if ledger is None else ledger.finished)
        since_s = self._earlier_since_s(command, now)
        is_change = self._attribution.update(
            command,
            time_s,
            seen_s=self._progress_shown_s(now),
            resumed_since_s=None if command is None or not since_s else since_s[command.command],
        )
        if since_s:
            self._add_earlier(since_s)
        return is_change and (command is None or before is None)

    def _earlier_since_s(self, command: PictureCommand | None, now: float) -> list[float]:
        """Give when each command of an earlier run's mission may have begun, once it is known.

        Empty for a mission of this run, and before and behind that.
        """
        if command is None or self._flight is None or self._followed_from_s < math.inf:
            return []
        self._followed_from_s = self._time.at(now)
        work, ledger = self._flight
        commands = work.mission.command_array
        return self._earlier.since_s(ledger, commands) if work.was_accepted else []

    def _add_earlier(self, since_s: Sequence[float]) -> None:
        """Add the commands that an earlier run has seen end, whose pictures may come now."""
        if self._flight is None:
            return
        work, ledger = self._flight
        commands = work.mission.command_array
        dated_from = self._earlier.dated_from(ledger)
        for index in range(min(ledger.finished, len(commands))):
            one = picture_command(ledger, commands, work.name, index)
            if one.expected:
                is_undated = index < dated_from
                self._attribution.add_earlier(one, since_s[index], is_undated=is_undated)

    def _progress_shown_s(self, now: float) -> float | None:
        """When the vehicle has shown its progress last.

        What it has shown just after an outage is not in the ledger yet.
        """
        age_s = self._vehicle.age_s("MISSION_CURRENT", now)
        received_s = self._time.received_s
        if not self._vehicle.is_connected(now) or (age_s or 0.0) > PROGRESS_GAP_S:
            self._shown_since = now
        if now - max(self._shown_since, self._followed_since) < PROGRESS_SETTLED_S:
            return -math.inf
        if age_s is None or received_s is None:
            return received_s
        return min(received_s, self._time.at(now) - age_s)

    def _follow_clock(self, now: float) -> None:
        shift_s = self._time.update(now)
        self._attribution.shift(shift_s)
        self._updated_s += shift_s

    def _behind(
        self, before: PictureCommand | None, end: int | None = None
    ) -> Iterator[PictureCommand]:
        """Give the commands of the mission in flight behind one of it, up to an index."""
        if before is None or self._flight is None or before.mission != self._flight[0].name:
            return
        work, ledger = self._flight
        commands = work.mission.command_array
        for index in range(before.command + 1, len(commands[:end])):
            yield picture_command(ledger, commands, work.name, index)

    def _add_unseen(self, until_s: float, end: int | None = None) -> None:
        """Note that the vehicle may have flown commands behind the present one unseen."""
        behind = self._behind(self._attribution.current, end)
        self._attribution.add_unseen((one for one in behind if one.expected), until_s)

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
            is_of_earlier = self._earlier.was_flying and one.time_s <= self._flight_known_s
            if command is not None or one.is_of_earlier_run or is_of_earlier:
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
        if camera.goes_back and one.time_s < self._followed_from_s:
            return True  # They are given to commands in their order, and come the other way round
        if self._flight is None:
            is_open = self._earlier.was_flying or not self._vehicle.is_identified
            return is_open and now - one.announced_at < MISSION_WITHIN_S
        picture = one.time_s, capture.component, capture.position
        waited_s = now - max(one.announced_at, self._followed_since)  # It may have stood still
        if waited_s < STORED_WITHIN_S and self._attribution.may_be_overtaken(*picture):
            return True
        return waited_s < PROGRESS_WITHIN_S and self._attribution.may_be_of_later(*picture)

    def restarted(self) -> None:
        """Note that the vehicle has restarted: its clock begins anew, and perhaps its camera's.

        Earlier pictures stay with earlier commands, also with those that it has flown unseen.
        """
        self._add_unseen(self._time.latest_s)
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
        if self._flight is None:
            return
        work, ledger = self._flight
        of_mission = [(command, text) for command, text in faults if command.mission == work.name]
        if of_mission and not ledger.status.is_terminal:
            for command, text in of_mission:
                ledger.add_note(command.command, text)
            effects.for_edge.append(self._reporter.mission(ledger))
