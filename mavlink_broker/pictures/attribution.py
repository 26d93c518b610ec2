"""Attributes pictures to commands: each picture belongs to the command that ran when it was taken.

The interval of a command runs from the end of the previous command to its own end, by the vehicle's
clock and as far as the broker knows it. The broker learns of a command up to a second late, and a
camera may need some time, so a command that lacks pictures also gets those from shortly before and
after its interval.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from afarcloud.commands import CameraImage, CameraPanorama, Command
from afarcloud.enumerations import PanoramaMode
from mavlink_broker.vehicle.mission_ledger import MissionLedger

EARLY_S: Final = 3.0
LATE_S: Final = 10.0
MAX_INTERVALS: Final = 1000
_PANORAMA_SHOTS: Final = {PanoramaMode.FULL_CIRCLE: 8, PanoramaMode.HALF_CIRCLE: 5}


@dataclass(frozen=True, slots=True)
class PictureCommand:
    """A command, and the number of pictures that it takes."""

    mission: str  # Unique name of the mission
    mission_id: int
    command: int  # Its index in the mission
    command_id: int
    expected: int


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
    command = commands[ledger.finished]
    return PictureCommand(
        mission,
        ledger.mission_id,
        ledger.finished,
        command.command_id,
        pictures_of(command),
    )


@dataclass(slots=True)
class CommandInterval:
    """The interval of one command, or between missions."""

    command: PictureCommand | None
    began_s: float
    ended_s: float = math.inf
    is_partial: bool = False  # Its beginning was not observed
    count: int = 0  # Its pictures
    is_given_up: bool = False  # Its missing pictures were requested often enough
    checks: int = 0  # Number of these requests
    check_at_s: float = 0.0

    @property
    def missing(self) -> int:
        """How many of its pictures were not announced."""
        return 0 if self.command is None else max(0, self.command.expected - self.count)


class Attribution:
    """The intervals of the last commands of one vehicle."""

    def __init__(self) -> None:
        self._intervals: deque[CommandInterval] = deque(maxlen=MAX_INTERVALS)
        self._incomplete: list[CommandInterval] = []

    @property
    def current(self) -> PictureCommand | None:
        """The command that runs."""
        return self._intervals[-1].command if self._intervals else None

    def update(
        self, command: PictureCommand | None, time_s: float, *, is_resumed: bool = False
    ) -> bool:
        """Follow the command that runs, `is_resumed` if it ran before; return if it changed."""
        if self._intervals and self._intervals[-1].command == command:
            return False
        if self._intervals:
            self._end(self._intervals[-1], time_s)
        is_first = all(interval.command is None for interval in self._intervals)
        self._intervals.append(CommandInterval(command, time_s, is_partial=is_resumed and is_first))
        return True

    def _end(self, interval: CommandInterval, time_s: float) -> None:
        interval.ended_s = time_s
        if interval.missing and not interval.is_partial:
            self._incomplete.append(interval)

    def attribute(self, time_s: float) -> PictureCommand | None:
        """Give the command of a picture that was taken at a time, and count the picture."""
        for interval in self._intervals:
            is_near = interval.began_s - EARLY_S <= time_s <= interval.ended_s + LATE_S
            if interval.missing and is_near:
                interval.count += 1
                return interval.command
        for interval in self._intervals:
            if interval.began_s <= time_s < interval.ended_s:
                interval.count += 1
                return interval.command
        return None

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
