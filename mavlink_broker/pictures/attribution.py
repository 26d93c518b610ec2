"""Whose picture it is: the command that was running when it was taken.

A command's time runs from the end of the one before to its own end, by the vehicle's clock and
as far as the broker has heard of it. News of a command comes up to a second late, and a camera
may need some time, so a command that was to take pictures and lacks some also gets those from
shortly before and after.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from afarcloud.commands import CameraImage, CameraPanorama, Command
from afarcloud.enumerations import PanoramaMode
from mavlink_broker.vehicle.mission_ledger import Ledger

EARLY_S: Final = 3.0
LATE_S: Final = 10.0
SPANS_KEPT: Final = 1000
_PANORAMA_SHOTS: Final = {PanoramaMode.FULL_CIRCLE: 8, PanoramaMode.HALF_CIRCLE: 5}


@dataclass(frozen=True, slots=True)
class Taker:
    """A command, and how many pictures it is to take."""

    mission: str  # Tells the mission from every other for good
    mission_id: int
    command: int  # Its place in the mission
    command_id: int
    expected: int


def pictures_of(command: Command) -> int:
    """How many pictures a command asks for."""
    match command:
        case CameraImage():
            return command.parameters.photo_count
        case CameraPanorama():
            return _PANORAMA_SHOTS[command.parameters.panorama_mode]
        case _:
            return 0


def running(ledger: Ledger, commands: tuple[Command, ...], mission: str) -> Taker | None:
    """The command of a mission that runs, or is about to."""
    if ledger.finished >= len(commands):
        return None
    command = commands[ledger.finished]
    return Taker(
        mission,
        ledger.mission_id,
        ledger.finished,
        command.command_id,
        pictures_of(command),
    )


@dataclass(slots=True)
class Span:
    """The time of one command; of none, between missions."""

    taker: Taker | None
    began_s: float
    ended_s: float = math.inf
    is_partial: bool = False  # Its beginning was not watched
    count: int = 0  # Pictures that are its
    is_given_up: bool = False  # What it lacks has been looked for often enough
    checks: int = 0  # How often it has been
    check_at_s: float = 0.0

    @property
    def lacks(self) -> int:
        """How many of its pictures nobody has announced."""
        return 0 if self.taker is None else max(0, self.taker.expected - self.count)


class Attribution:
    """The times of the last commands of one vehicle."""

    def __init__(self) -> None:
        self._spans: deque[Span] = deque(maxlen=SPANS_KEPT)
        self._lacking: list[Span] = []

    @property
    def current(self) -> Taker | None:
        """The command that runs."""
        return self._spans[-1].taker if self._spans else None

    def watch(self, taker: Taker | None, time_s: float, *, is_resumed: bool = False) -> bool:
        """Take which command runs now, `is_resumed` if it ran before; whether that is news."""
        if self._spans and self._spans[-1].taker == taker:
            return False
        if self._spans:
            self._end(self._spans[-1], time_s)
        is_first = all(span.taker is None for span in self._spans)
        self._spans.append(Span(taker, time_s, is_partial=is_resumed and is_first))
        return True

    def _end(self, span: Span, time_s: float) -> None:
        span.ended_s = time_s
        if span.lacks and not span.is_partial:
            self._lacking.append(span)

    def attribute(self, time_s: float) -> Taker | None:
        """Give a picture to its command."""
        for span in self._spans:
            is_near = span.began_s - EARLY_S <= time_s <= span.ended_s + LATE_S
            if span.lacks and is_near:
                span.count += 1
                return span.taker
        for span in self._spans:
            if span.began_s <= time_s < span.ended_s:
                span.count += 1
                return span.taker
        return None

    def began_before(self, time_s: float) -> bool:
        """Whether commands have been watched at a time already."""
        return bool(self._spans) and self._spans[0].began_s <= time_s

    def ended_and_lacking(self) -> Iterator[Span]:
        """Commands that have ended without all of their pictures."""
        self._lacking = [span for span in self._lacking if span.lacks and not span.is_given_up]
        return iter(self._lacking)
