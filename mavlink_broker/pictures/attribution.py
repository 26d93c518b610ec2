"""Which command a picture belongs to: the one that ran when it was taken, by time and by place.

The interval of a command runs from the end of the previous command to its own end, by the vehicle's
clock and as far as the broker knows it. The broker learns of a command up to a second late, later
after a lost link or a pause of its own, and a camera may need some time. So a command that lacks
pictures also gets those from shortly before its predecessor was seen last, and from shortly after
its interval; of several such commands the one at whose place a picture was taken, by the positions
of both. What an autopilot reports of pictures (`Feedback`) is counted as of other cameras.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

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
from afarcloud.geodesy import distance_m
from mavlink_broker.pictures.announcements import Place, Position
from mavlink_broker.planning.camera_commands import PANORAMA_SHOTS
from mavlink_broker.vehicle.mission_ledger import MissionLedger

EARLY_S: Final = 3.0
LATE_S: Final = 10.0
MAX_INTERVALS: Final = 1000
MAX_PLACES: Final = 5
AT_PLACE_M: Final = 15.0
"""Largest distance of a picture from the place of its command, with the errors of two positions."""
SAME_PLACE_M: Final = 3.0
FEEDBACK: Final = 256
"""Number of the autopilot's first camera, behind those of all components."""


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
    is_followed: bool = False  # The next command with pictures takes them at the same place


def pictures_of(command: Command) -> int:
    """Give the number of pictures of a command."""
    match command:
        case CameraImage():
            return command.parameters.photo_count
        case CameraPanorama():
            return PANORAMA_SHOTS[command.parameters.panorama_mode]
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
    return PictureCommand(
        mission,
        ledger.mission_id,
        index,
        command.command_id,
        expected=pictures_of(command),
        area=_area_of(commands, index),
        is_followed=_is_followed(commands, index),
    )


def _is_followed(commands: tuple[Command, ...], index: int) -> bool:
    """Whether the next command with pictures takes them where this one does, or may do so."""
    later = range(index + 1, len(commands))
    following = next((one for one in later if pictures_of(commands[one])), None)
    if following is None:
        return False
    here, there = _area_of(commands, index), _area_of(commands, following)
    if here is None or there is None:
        return True
    return here.off_m(there.latitude_deg, there.longitude_deg) <= SAME_PLACE_M + here.radius_m


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
    is_partial: bool = field(kw_only=True)  # Its beginning was not observed
    ended_s: float = math.inf
    is_undated: bool = False  # Nor was it noted when it had been ordered
    is_of_boot_before: bool = False  # Its times are by a clock of which no run has seen the end
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

    def ran_at(self, time_s: float) -> bool:
        """Whether it was the command that ran."""
        return self.began_s <= time_s < self.ended_s

    def count(self, camera: int) -> None:
        """Count a picture of a camera."""
        self.counts[camera] = self.counts.get(camera, 0) + 1


class Attribution:
    """The intervals of the last commands of one vehicle."""

    def __init__(self) -> None:
        self._intervals: deque[CommandInterval] = deque(maxlen=MAX_INTERVALS)
        self._present: CommandInterval | None = None  # Of the intervals: it has not ended
        self._incomplete: list[CommandInterval] = []
        self._seen_s: float | None = None  # When the present command was seen last

    @property
    def current(self) -> PictureCommand | None:
        """The command that runs."""
        return None if self._present is None else self._present.command

    def update(
        self,
        command: PictureCommand | None,
        time_s: float,
        *,
        seen_s: float | None = None,
        resumed_since_s: float | None = None,
    ) -> bool:
        """Follow the command that runs; return if it changed.

        `seen_s` is when the vehicle has shown last that it runs, now by default; what is older
        than is known changes nothing. `resumed_since_s` if an earlier run has ordered it: when it
        may have begun.
        """
        if self._present is not None and self._present.command == command:
            seen_s = time_s if seen_s is None else seen_s
            self._seen_s = seen_s if self._seen_s is None else max(self._seen_s, seen_s)
            return False
        if self._present is not None:
            self._end(self._present, time_s)
        is_first = all(interval.command is None for interval in self._intervals)
        is_partial = is_first and resumed_since_s is not None
        if is_partial:
            self._seen_s = resumed_since_s
        earliest_s = time_s if self._seen_s is None else min(self._seen_s, time_s)
        self._present = CommandInterval(command, time_s, earliest_s, is_partial=is_partial)
        self._intervals.append(self._present)
        return True

    def add_earlier(
        self, command: PictureCommand, since_s: float, *, is_undated: bool = False
    ) -> None:
        """Add a command that an earlier run has seen end, before the present one.

        Its pictures, taken at `since_s` at the earliest, may be received in this run; `is_undated`
        if it was not noted when it had been ordered. Later ones take its place where it is one of
        too many.
        """
        present = self._present
        until_s = math.inf if present is None else present.began_s
        interval = CommandInterval(
            command, since_s, since_s, until_s, is_partial=True, is_undated=is_undated
        )
        if len(self._intervals) == MAX_INTERVALS:
            self._intervals.popleft()
        self._intervals.insert(len(self._intervals) - 1, interval)

    def add_unseen(self, commands: Iterable[PictureCommand], until_s: float) -> None:
        """Add commands behind the present one that the vehicle may have flown unseen, in order.

        It has restarted since, or the mission has ended, so that its progress never shows them.
        What was taken behind the time when the present command was seen last, until `until_s`, may
        be of any of them; if an earlier run has seen it last, behind that time.
        """
        seen_s, present = self._seen_s, self._present
        if present is None or seen_s is None:
            return
        since_s = present.earliest_s if present.is_partial else max(seen_s, present.began_s)
        for command in commands:
            interval = CommandInterval(command, since_s, since_s, until_s, is_partial=True)
            interval.is_of_boot_before = present.is_of_boot_before
            self._intervals.append(interval)

    def shift_earlier(self, shift_s: float) -> None:
        """Shift the beginnings of what an earlier run has ordered, by the clock of before."""
        for interval in self._intervals:
            if interval.is_partial:
                interval.is_of_boot_before = True
                interval.began_s += shift_s
                interval.earliest_s += shift_s

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
        after, at last among those that have all of theirs, where it is one too many of the one
        that ran: an order whose answer was lost is obeyed twice. Else it is the first one that
        lacks pictures, or the one that ran. One that may have run at any time takes its pictures at
        its place only: others may be of any flight before.
        """
        lacking = self._lacking(since_s, time_s, camera)
        around = self._around(since_s, time_s)
        still_lacking = [one for one in around if one.missing_of(camera)]
        ran_first = sorted(around, key=lambda one: not one.ran_at(time_s))
        for candidates in (lacking, still_lacking, ran_first):
            at_place = _at(position, candidates)
            if at_place is not None:
                return at_place
        ran = (one for one in self._intervals if one.ran_at(time_s))
        return next((one for one in (*lacking, *ran) if not _is_of_others(one, position)), None)

    def _around(self, since_s: float, time_s: float) -> list[CommandInterval]:
        """Give the commands with pictures that may have run some seconds before or after."""
        return [
            one
            for one in self._intervals
            if one.command is not None
            and one.command.expected
            and one.earliest_s - LATE_S <= time_s
            and since_s <= one.ended_s + one.late_s
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

    def may_be_overtaken(self, time_s: float, camera: int, position: Position | None) -> bool:
        """Whether a picture would be given to a command behind which others are taken there.

        An earlier picture, which is announced later, would then be given to the wrong command.
        """
        interval = self._find(time_s, time_s, camera, position)
        command = None if interval is None else interval.command
        return command is not None and command.is_followed

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


def _is_of_others(interval: CommandInterval, position: Position | None) -> bool:
    """Whether a picture is not of a command of unknown time: that takes none, or elsewhere."""
    is_unknown = interval.earliest_s == -math.inf or interval.is_undated
    if interval.command is None or not (is_unknown or interval.is_of_boot_before):
        return False
    is_elsewhere = position is not None and AT_PLACE_M < _off_m(interval, position) < math.inf
    return is_elsewhere or not interval.command.expected


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
