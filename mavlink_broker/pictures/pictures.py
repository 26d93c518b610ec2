"""Everything about the pictures of one vehicle: from their announcement to the edge server.

The ledger of captures: each picture belongs to the command that was running when it was taken,
is fetched from where it lies, made to fit, and told once. Nothing of it holds a mission up, and
nothing is lost silently: what cannot be had is said in its command's report, or in the log when
the mission is over.
"""

import logging
import zlib
from collections import OrderedDict
from typing import Final

from afarcloud.enumerations import Status
from mavlink_broker.edge.work import MissionWork
from mavlink_broker.effects import Effects
from mavlink_broker.jobs import Develop, Developed, Downloaded, JobFailed, JobOutcome
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.pictures.attribution import Attribution, Span, Taker, running
from mavlink_broker.pictures.capture import Capture, read_capture
from mavlink_broker.pictures.counting import PictureCount
from mavlink_broker.pictures.fetching import Errand, Fetching, Progress
from mavlink_broker.vehicle.mission_ledger import Ledger
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

HEARD: Final = frozenset(
    {"CAMERA_IMAGE_CAPTURED", "CAMERA_CAPTURE_STATUS", "FILE_TRANSFER_PROTOCOL"}
)
"""What a vehicle's components say about pictures."""
RECENT_S: Final = 900.0
"""Older pictures, taken before this run of the broker, are not looked for."""
OWN_CLOCK_S: Final = 3.0
"""A camera whose clock is further from the autopilot's than that has one of its own."""
CHECK_AFTER_S: Final = 2.0
CHECKS: Final = 5
DEVELOPING: Final = 2
"""Pictures at once whose bytes are in hand: a bound to memory."""
ERRANDS_KEPT: Final = 1000
IDENTITIES_KEPT: Final = 4000
CAMERAS_KEPT: Final = 8

_LOG = logging.getLogger(__name__)


class PictureDesk:
    """The pictures of one vehicle."""

    def __init__(self, vehicle: Vehicle, reporter: Reporter) -> None:
        self._vehicle = vehicle
        self._reporter = reporter
        self._attribution = Attribution()
        self._cameras: dict[int, PictureCount] = {}
        self._clock_s: dict[int, float] = {}  # Of each camera: how far it is behind the autopilot
        self._seen: OrderedDict[str, None] = OrderedDict()
        first_seq = zlib.crc32(reporter.session_id.encode())
        self._fetching = Fetching(vehicle.route, first_seq)
        self._developing: dict[int, Errand] = {}
        self._postponed: list[Errand] = []
        self._number = 0
        self._flight: tuple[MissionWork, Ledger] | None = None
        self._told: list[tuple[Taker, str]] = []
        self._epoch_s = 0.0  # Added to the vehicle's time, so that it never goes back
        self._epoch_before_s: float | None = None  # The same, before the vehicle's last restart
        self._latest_s = 0.0
        self.has_room = True  # The edge server takes pictures as fast as they come
        self.is_reachable = False  # The vehicle is heard

    @property
    def unfinished(self) -> int:
        """How many announced pictures have not been told yet."""
        return len(self._fetching) + len(self._developing) + len(self._postponed)

    @property
    def is_fetching(self) -> bool:
        """Whether pictures are still to come from a vehicle that is heard."""
        return self.is_reachable and self.unfinished > 0

    def watch(self, work: MissionWork | None, ledger: Ledger | None, now: float) -> None:
        """Take which mission is flown, if any, and how far it is."""
        taker = None
        if work is not None and ledger is not None:
            self._flight = work, ledger
            if ledger.status is Status.RUNNING:
                taker = running(ledger, work.mission.command_array, work.name)
        before = self._attribution.current
        is_resumed = work is not None and work.was_accepted
        is_news = self._attribution.watch(taker, self._time_s(now), is_resumed=is_resumed)
        if is_news and (taker is None or before is None):
            for camera in self._cameras.values():  # A mission begins or ends
                camera.ask_count()

    def restarted(self) -> None:
        """Take that the vehicle was restarted: its time begins anew, and its camera's perhaps.

        Pictures of before stay with the commands of before.
        """
        self._epoch_before_s = self._epoch_s
        self._epoch_s = self._latest_s + 2.0 * RECENT_S
        self._clock_s.clear()
        for camera in self._cameras.values():
            camera.ask_count()

    def camera_heard(self, component: int) -> None:
        """Take that a component is a camera; the first time, what was not heard of is asked for."""
        if component not in self._cameras and len(self._cameras) < CAMERAS_KEPT:
            camera = PictureCount(component, self._vehicle.route, self._vehicle.round_trip)
            camera.ask_count(go_back=True)
            self._cameras[component] = camera
            self._vehicle.cameras.add(component)

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Take what a component says about pictures."""
        match message.get_type():
            case "CAMERA_IMAGE_CAPTURED":
                self._captured(read_capture(message), now)
            case "CAMERA_CAPTURE_STATUS":
                self._counted(message, now)
            case "FILE_TRANSFER_PROTOCOL":
                self._carry_out(self._fetching.receive(message, now), effects)

    def step(self, now: float, effects: Effects, *, is_busy: bool) -> None:
        """Let time pass while the vehicle is heard; `is_busy` with what matters more."""
        for camera in self._cameras.values():
            messages, lost = camera.tick(now)
            effects.messages += messages
            for number in lost:
                _LOG.warning("vehicle %d: picture %d is lost", self._vehicle.vehicle_id, number)
        self._look_for_missing(now)
        self._take_up_postponed()
        self._fetching.route = self._vehicle.route
        is_held = is_busy or not self.has_room or len(self._developing) >= DEVELOPING
        self._carry_out(self._fetching.step(now, is_held=is_held), effects)
        self._tell_faults(effects)

    def take_outcome(self, outcome: JobOutcome, now: float, effects: Effects) -> None:
        """Take what became of a job."""
        match outcome:
            case Downloaded(number, data):
                self._carry_out(self._fetching.web_brought(number, data), effects)
            case Developed(number) if number in self._developing:
                errand = self._developing.pop(number)
                effects.for_edge.append(self._reporter.image(outcome, *self._named(errand)))
            case JobFailed(number, reason) if number in self._developing:
                self._fault(self._developing.pop(number), reason)
            case JobFailed(number, reason):
                self._carry_out(self._fetching.web_failed(number, reason, now), effects)
        self._tell_faults(effects)

    # Announcements.

    def _counted(self, message: Message, now: float) -> None:
        component = source_of(message).component
        if component in self._cameras:
            self._cameras[component].told(message.image_count)
            if message.time_boot_ms:
                camera_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
                self._clock_s[component] = self._vehicle_time_s(now) - camera_s

    def _captured(self, capture: Capture, now: float) -> None:
        self.camera_heard(capture.component)
        camera = self._cameras.get(capture.component)
        if camera is None:
            return
        taken_s = self._taken_s(capture, now)
        is_recent = self._time_s(now) - taken_s <= RECENT_S
        is_of_earlier_run = is_recent and not self._attribution.began_before(taken_s)
        is_news = camera.take(capture, goes_back=is_of_earlier_run)
        if not is_news or capture.identity in self._seen:
            return
        self._seen[capture.identity] = None
        if len(self._seen) > IDENTITIES_KEPT:
            self._seen.popitem(last=False)
        taker = self._attribution.attribute(taken_s)
        if taker is not None or is_of_earlier_run:
            self._fetch(capture, taker)

    def _taken_s(self, capture: Capture, now: float) -> float:
        """When it was taken, by the autopilot's clock; a camera may have its own.

        How far the two are apart is known from what the camera answers at once. An announcement
        does not tell: a camera may take its time to store a picture.
        """
        time_s = self._vehicle_time_s(now)
        if capture.taken_s is None:
            return time_s + self._epoch_s
        behind_s = self._clock_s.get(capture.component, 0.0)
        taken_s = self._vehicle.snapshot.since_boot_s(round(capture.taken_s * 1e3))
        taken_s += behind_s if abs(behind_s) > OWN_CLOCK_S else 0.0
        if self._epoch_before_s is not None and self._is_of_before(capture, taken_s, time_s):
            return taken_s + self._epoch_before_s
        return min(taken_s, time_s) + self._epoch_s

    def _is_of_before(self, capture: Capture, taken_s: float, time_s: float) -> bool:
        """Whether a picture is older than the vehicle's last restart.

        Its time of day tells, else its time since boot, which has not come yet.
        """
        booted_s = self._vehicle.snapshot.booted_at_utc_s
        if capture.taken_utc_s is not None and booted_s is not None:
            return capture.taken_utc_s < booted_s - OWN_CLOCK_S
        return taken_s > time_s + OWN_CLOCK_S

    def _fetch(self, capture: Capture, taker: Taker | None) -> None:
        self._number += 1
        place = capture.place
        if not capture.has_succeeded:
            self._say(taker, f"the camera could not take picture {capture.index}")
        elif place is None:
            where = f"{capture.url!r} is no place" if capture.url else "it is told nowhere"
            self._say(taker, f"picture {capture.index} cannot be fetched: {where}")
        elif self.unfinished >= ERRANDS_KEPT:
            self._say(taker, f"picture {capture.index} is not fetched: too many wait")
        else:
            self._fetching.add(Errand(self._number, capture, taker, place))

    def _look_for_missing(self, now: float) -> None:
        for span in self._attribution.ended_and_lacking():
            if self._time_s(now) >= span.ended_s + CHECK_AFTER_S:
                self._look_for(span, now)

    def _look_for(self, span: Span, now: float) -> None:
        if now < span.check_at_s or any(camera.is_asking for camera in self._cameras.values()):
            return
        span.checks += 1
        span.check_at_s = now + CHECK_AFTER_S * 2 ** (span.checks - 1)
        if span.checks > CHECKS or not self._cameras:
            span.is_given_up = True
            expected = 0 if span.taker is None else span.taker.expected
            self._say(span.taker, f"{span.lacks} of {expected} pictures were not announced")
            return
        for camera in self._cameras.values():
            camera.ask_count()

    # Results.

    def _carry_out(self, progress: Progress, effects: Effects) -> None:
        effects.messages += progress.messages
        effects.jobs += progress.jobs
        for errand, data in progress.brought:
            self._developing[errand.number] = errand
            effects.jobs.append(Develop(errand.number, data))
        for errand in progress.failed:
            self._give_up(errand)

    def _give_up(self, errand: Errand) -> None:
        """Leave a picture, for good or until the vehicle has landed: some give files only then."""
        if errand.is_second_chance or self._vehicle.snapshot.armed is False:
            self._fault(errand, errand.reason)
            return
        number = errand.capture.index
        self._say(errand.taker, f"picture {number} cannot be had in flight: {errand.reason}")
        self._postponed.append(errand)

    def _take_up_postponed(self) -> None:
        if self._vehicle.snapshot.armed is not False:
            return
        for errand in self._postponed:
            self._fetching.add(errand.again())
        self._postponed.clear()

    def _named(self, errand: Errand) -> tuple[str, str]:
        """Name a picture, and tell it from every other for good."""
        taker, capture = errand.taker, errand.capture
        whose = "found" if taker is None else f"m{taker.mission_id}_c{taker.command_id}"
        if taker is None and self._flight is not None:
            whose = f"m{self._flight[1].mission_id}_found"
        camera = "" if capture.component == mavlink.MAV_COMP_ID_CAMERA else f"_k{capture.component}"
        mark = f"{self._vehicle.vehicle_id}/{capture.identity}"
        return f"{whose}{camera}_{capture.index:04d}", mark

    def _fault(self, errand: Errand, reason: str) -> None:
        self._say(errand.taker, f"picture {errand.capture.index} cannot be had: {reason}")

    def _say(self, taker: Taker | None, text: str) -> None:
        _LOG.warning("vehicle %d: %s", self._vehicle.vehicle_id, text)
        if taker is not None:
            self._told.append((taker, text))

    def _tell_faults(self, effects: Effects) -> None:
        """Put what is missing into the report of its command, while its mission is under way."""
        told, self._told = self._told, []
        is_news = False
        for taker, text in told:
            work, ledger = self._flight or (None, None)
            if work is None or ledger is None or work.name != taker.mission:
                continue
            if not ledger.status.is_terminal:
                ledger.add_note(taker.command, text)
                is_news = True
        if is_news and self._flight is not None:
            effects.for_edge.append(self._reporter.mission(self._flight[1]))

    def _time_s(self, now: float) -> float:
        """The vehicle's time, going on over its restarts; the broker's where it tells none."""
        time_s = self._vehicle_time_s(now) + self._epoch_s
        self._latest_s = max(self._latest_s, time_s)
        return time_s

    def _vehicle_time_s(self, now: float) -> float:
        told = self._vehicle.snapshot.time_s
        return now if told is None else told
