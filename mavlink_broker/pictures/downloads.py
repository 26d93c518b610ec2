"""The downloads of one vehicle's pictures: one at a time, with retries.

A download that was interrupted is resumed with the bytes so far; a round that received any bytes
does not count as a failure.

Over MAVFTP a file is requested from the component that the announcement names, then from the
camera, then from the autopilot. A file on a web server is a job for the program's threads.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.effects import FetchUrl, Job
from mavlink_broker.mavlink.dialect import Message, Route
from mavlink_broker.microservices.ftp_download import NO_ANSWER, FileDownload
from mavlink_broker.microservices.ftp_requests import Fetched, PartialFile
from mavlink_broker.pictures.announcements import Capture, FileLocation, Location, WebLocation
from mavlink_broker.pictures.attribution import PictureCommand

MAX_FILE_BYTES: Final = 32 * 1024 * 1024
"""A camera of 50 megapixels writes half of it."""
PAUSES_S: Final = (2.0, 10.0, 30.0)
"""Before each further round: the camera may still write the file, the link may be bad."""


@dataclass(slots=True)
class PictureDownload:
    """The download of one picture."""

    number: int
    capture: Capture
    command: PictureCommand | None
    location: Location
    taken_at: float  # By the broker's clock
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
        return PictureDownload(
            self.number,
            self.capture,
            self.command,
            self.location,
            self.taken_at,
            is_second_chance=True,
            partial=self.partial,
        )


@dataclass(slots=True)
class Progress:
    """The result of a step: messages, jobs, and downloads that have ended."""

    messages: list[Message] = field(default_factory=list)
    jobs: list[Job] = field(default_factory=list)
    completed: list[tuple[PictureDownload, bytes]] = field(default_factory=list)
    failed: list[PictureDownload] = field(default_factory=list)


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
        progress = Progress()
        if self._download is not None:
            progress.messages += self._download.receive(message, now)
            self._settle(progress, now)
        return progress

    def step(self, now: float, *, is_paused: bool) -> Progress:
        """Do what is due, while the vehicle is connected. `is_paused`: request nothing."""
        progress = Progress()
        if self._download is not None:
            self._download.is_paused = is_paused
            progress.messages += self._download.tick(now)
            self._settle(progress, now)
        if self._running is None and not is_paused:
            self._begin_next(progress, now)
        return progress

    def web_completed(self, number: int, data: bytes) -> Progress:
        """Process a file of a web server."""
        progress = Progress()
        if self._running is not None and self._running.number == number:
            progress.completed.append((self._running, data))
            self._running = None
        return progress

    def web_failed(self, number: int, reason: str, now: float) -> Progress:
        """Process the failure of a web server."""
        progress = Progress()
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
