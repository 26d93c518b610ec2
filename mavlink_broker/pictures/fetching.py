"""Gets the files of pictures from where they lie, one at a time, again and again if need be.

A transfer that ends in an outage is resumed by the next one with what has come; while rounds
bring something, they do not count.

Over MAVFTP they are asked for at the component that the announcement names, else at the camera,
else at the autopilot. What is on a web server is a job for the program's threads.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.ftp.download import NO_ANSWER, FileDownload
from mavlink_broker.ftp.partial_file import Fetched, PartialFile
from mavlink_broker.jobs import FetchUrl, Job
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.pictures.attribution import Taker
from mavlink_broker.pictures.capture import Capture, FilePlace, Place, WebPlace

LARGEST_FILE: Final = 32 * 1024 * 1024
"""Bytes; a camera of 50 megapixels writes half of it."""
PAUSES_S: Final = (2.0, 10.0, 30.0)
"""Before each further round: the file may not have been closed yet, the link may be bad."""


@dataclass(slots=True)
class Errand:
    """One picture that is to be fetched."""

    number: int
    capture: Capture
    taker: Taker | None
    place: Place
    rounds: int = 0
    component: int = 0  # How many of the possible ones have been asked in this round
    unheard: set[int] = field(default_factory=set)  # Components that have not answered
    silent: set[int] = field(default_factory=set)  # The same, as of the round before
    not_before: float = 0.0
    reason: str = ""
    is_second_chance: bool = False
    partial: PartialFile | None = None  # What has come of it so far

    def again(self) -> "Errand":
        """Give the same errand from its beginning, for the last time."""
        number, capture = self.number, self.capture
        return Errand(
            number, capture, self.taker, self.place, is_second_chance=True, partial=self.partial
        )


@dataclass(slots=True)
class Progress:
    """What a step brings: things to send and to do, and errands that have come to an end."""

    messages: list[Message]
    jobs: list[Job]
    brought: list[tuple[Errand, bytes]]
    failed: list[Errand]

    @classmethod
    def none(cls) -> "Progress":
        """Give nothing."""
        return cls([], [], [], [])


class Fetching:
    """The errands of one vehicle; the caller tells whether a new one may be begun."""

    def __init__(self, route: Route, first_seq: int) -> None:
        self.route = route
        self._next_seq = first_seq
        self._waiting: deque[Errand] = deque()
        self._running: Errand | None = None
        self._download: FileDownload | None = None
        self._had = 0  # [bytes] What had come of it when this download began

    def __len__(self) -> int:
        return len(self._waiting) + (self._running is not None)

    def add(self, errand: Errand) -> None:
        """Fetch it when its turn comes."""
        self._waiting.append(errand)

    def receive(self, message: Message, now: float) -> Progress:
        """Take an answer of a file server."""
        progress = Progress.none()
        if self._download is not None:
            progress.messages += self._download.receive(message, now)
            self._settle(progress, now)
        return progress

    def step(self, now: float, *, is_held: bool) -> Progress:
        """Let time pass; to be called while the vehicle is heard. `is_held`: ask for nothing."""
        progress = Progress.none()
        if self._download is not None:
            self._download.is_held = is_held
            progress.messages += self._download.tick(now)
            self._settle(progress, now)
        if self._running is None and not is_held:
            self._begin_next(progress, now)
        return progress

    def web_brought(self, number: int, data: bytes) -> Progress:
        """Take a file of a web server."""
        progress = Progress.none()
        if self._running is not None and self._running.number == number:
            progress.brought.append((self._running, data))
            self._running = None
        return progress

    def web_failed(self, number: int, reason: str, now: float) -> Progress:
        """Take that a web server did not give it."""
        progress = Progress.none()
        if self._running is not None and self._running.number == number:
            self._try_again(self._running, reason, progress, now)
        return progress

    def _begin_next(self, progress: Progress, now: float) -> None:
        errand = next((one for one in self._waiting if now >= one.not_before), None)
        if errand is None:
            return
        self._waiting.remove(errand)
        self._running = errand
        match errand.place:
            case WebPlace(url):
                progress.jobs.append(FetchUrl(errand.number, url, LARGEST_FILE))
            case FilePlace(path):
                component = self._components(errand)[errand.component]
                route = self.route._replace(target_component=component)
                self._download = FileDownload(
                    path,
                    route,
                    limit_bytes=LARGEST_FILE,
                    first_seq=self._next_seq,
                    partial=errand.partial,
                )
                self._had = self._download.partial.received
                progress.messages += self._download.start(now)

    def _components(self, errand: Errand) -> Sequence[int]:
        """Whom to ask in this round; who has never answered is not asked again if others have."""
        told = errand.place.component if isinstance(errand.place, FilePlace) else None
        possible = (told, errand.capture.component, self.route.target_component)
        everybody = dict.fromkeys(one for one in possible if one is not None)
        return tuple(one for one in everybody if one not in errand.silent) or tuple(everybody)

    def _settle(self, progress: Progress, now: float) -> None:
        download, errand = self._download, self._running
        if download is None or errand is None or download.outcome is None:
            return
        self._download = self._running = None
        self._next_seq = download.next_seq
        if isinstance(download.outcome, Fetched):
            progress.brought.append((errand, download.outcome.data))
            return
        errand.partial = download.partial
        if download.partial.received > self._had:
            errand.rounds = 0  # The link is bad, but it brings something
        reason, asked = download.outcome.reason, self._components(errand)
        if reason == NO_ANSWER:
            errand.unheard.add(asked[errand.component])
        errand.component += 1
        if not errand.reason or errand.reason == NO_ANSWER:
            errand.reason = reason
        if errand.component < len(asked):
            self._waiting.appendleft(errand)
        else:
            errand.component = 0
            errand.silent = set(errand.unheard)
            self._try_again(errand, errand.reason, progress, now)

    def _try_again(self, errand: Errand, reason: str, progress: Progress, now: float) -> None:
        self._running = None
        if errand.rounds >= len(PAUSES_S):
            errand.reason = reason
            progress.failed.append(errand)
            return
        errand.reason = ""
        errand.not_before = now + PAUSES_S[errand.rounds]
        errand.rounds += 1
        self._waiting.append(errand)
