"""Targets that a vehicle follows (another vehicle, or a track in a file), and FOLLOW_TARGET(144).

TargetSourceError  a target that cannot be read; names the file and the line
TargetFileError  a file that contains no valid track, with the line and the reason
"""

import csv
import io
import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from afarcloud.geodesy import offset
from afarcloud.route import Spot
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.planning.situation import Home
from mavlink_broker.planning.target_commands import STANDING, TargetSource, TargetState, Vector
from mavlink_broker.vehicle.vehicle import Vehicle

COLUMNS: Final = ("time_s", "latitude_deg", "longitude_deg")
STALE_S: Final = 1.0
"""A position is used for this time after the last update."""
_AVERAGED_S: Final = 2.0
"""The velocity is the mean over this time."""
_POSITION_AND_VELOCITY: Final = 3
"""Bits of `est_capabilities`."""


class TargetFileError(ValueError):
    """A file that contains no valid track."""


class _Fix(NamedTuple):
    time_s: float
    latitude_deg: float
    longitude_deg: float


class TargetTrack:
    """A track from a file: straight between its positions; before and after them it stands."""

    def __init__(self, positions: Sequence[tuple[float, float, float]]) -> None:
        """Store time [s], latitude [deg] and longitude [deg] of each position, in order."""
        self._fixes = [_Fix(*position) for position in positions]
        self._times = [fix.time_s for fix in self._fixes]

    def at(self, elapsed_s: float) -> TargetState:
        """Give the target's state some time after the follow began."""
        index = bisect_right(self._times, elapsed_s)
        if index == 0:
            return TargetState(*self._fixes[0][1:])
        before = self._fixes[index - 1]
        if index == len(self._fixes):
            return TargetState(*before[1:])
        after = self._fixes[index]
        span_s = after.time_s - before.time_s
        share = (elapsed_s - before.time_s) / span_s
        east_deg = math.remainder(after.longitude_deg - before.longitude_deg, 360.0)
        leg = offset(*before[1:], *after[1:])
        return TargetState(
            before.latitude_deg + share * (after.latitude_deg - before.latitude_deg),
            math.remainder(before.longitude_deg + share * east_deg, 360.0),
            (leg.north_m / span_s, leg.east_m / span_s, 0.0),
        )


class VehicleTrack:
    """The track of another vehicle, from the positions that it sends."""

    def __init__(self) -> None:
        self._fixes: list[_Fix] = []

    def take(self, time_s: float, latitude_deg: float, longitude_deg: float) -> None:
        """Add a position."""
        if self._fixes and time_s < self._fixes[-1].time_s:
            self._fixes = []  # The vehicle has restarted: its time begins anew
        self._fixes = [fix for fix in self._fixes if time_s - fix.time_s <= _AVERAGED_S]
        self._fixes.append(_Fix(time_s, latitude_deg, longitude_deg))

    def at(self, time_s: float) -> TargetState | None:
        """Give its state now; None if the last position is older than a second."""
        if not self._fixes or time_s - self._fixes[-1].time_s > STALE_S:
            return None
        first, last = self._fixes[0], self._fixes[-1]
        span_s = last.time_s - first.time_s
        if span_s <= 0.0:
            return TargetState(*last[1:])
        leg = offset(*first[1:], *last[1:])
        return TargetState(*last[1:], (leg.north_m / span_s, leg.east_m / span_s, 0.0))


def target_message(
    spot: Spot, home: Home, now: float, *, velocity_ned_m_s: Vector = STANDING
) -> Message:
    """Make FOLLOW_TARGET(144) of a target's position and velocity; its time is the broker's clock.

    The altitude is that of the follower, above mean sea level: some autopilots fly at it, others
    fly at a height that a parameter sets.
    """
    return mavlink.MAVLink_follow_target_message(
        int(now * 1e3),
        _POSITION_AND_VELOCITY,
        round(spot.latitude_deg * 1e7),
        round(spot.longitude_deg * 1e7),
        home.altitude_amsl_m + spot.relative_altitude_m,
        velocity_ned_m_s,
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        0,
    )


def read_track(text: str) -> TargetTrack:
    """Parse `time_s,latitude_deg,longitude_deg`, times in seconds since the follow began.

    Raises:
        TargetFileError: if a line is invalid, or the times do not increase.
    """
    rows = csv.DictReader(io.StringIO(text))
    if tuple(rows.fieldnames or ())[:3] != COLUMNS:
        raise TargetFileError(f"the first line must be {','.join(COLUMNS)}")
    fixes: list[_Fix] = []
    for number, row in enumerate(rows, 2):
        fix = _fix(number, row)
        if fixes and fix.time_s <= fixes[-1].time_s:
            raise TargetFileError(f"line {number}: time_s must increase")
        fixes.append(fix)
    if not fixes:
        raise TargetFileError("it contains no position")
    return TargetTrack(fixes)


def _fix(number: int, row: dict[str, str]) -> _Fix:
    try:
        fix = _Fix(*(float(row[column]) for column in COLUMNS))
    except (TypeError, ValueError):
        raise TargetFileError(f"line {number}: it must have three numbers") from None
    if not (math.isfinite(fix.time_s) and abs(fix[1]) <= 90.0 and abs(fix[2]) <= 180.0):
        raise TargetFileError(f"line {number}: it is not a position on earth")
    return fix


MAX_FILE_BYTES: Final = 16_000_000
SEND_EVERY_S: Final = 0.2
"""The rate of the vehicle's own positions; each of them triggers one message."""
SEND_TOLERANCE_S: Final = 0.05


class TargetSourceError(Exception):
    """A target that cannot be read."""


class VehicleTarget:
    """Another vehicle."""

    def __init__(self, find: Callable[[], Vehicle | None]) -> None:
        self._find = find
        self._track = VehicleTrack()

    def at(self, _elapsed_s: float, now: float) -> TargetState | None:
        """Give the vehicle's state now; None while it is not connected."""
        vehicle = self._find()
        position = None if vehicle is None else vehicle.snapshot.position
        if vehicle is None or position is None or not vehicle.is_connected(now):
            return None
        time_s = vehicle.time_s(now)
        self._track.take(time_s, position.latitude_deg, position.longitude_deg)
        return self._track.at(time_s)


class FollowTargetSender:
    """Sends the target of one live command to the vehicle, at the height of the command."""

    def __init__(self, spot: Spot, vehicle: Vehicle) -> None:
        """Follow the command's own position unless the vehicle has a source of targets."""
        self._spot = spot
        self._vehicle = vehicle
        self._due_at_s = -math.inf

    def send(self, time_s: float, followed_s: float, now: float) -> list[Message]:
        """Give the message when it is due.

        Args:
            time_s: by the vehicle's clock.
            followed_s: time since the follow began.
            now: [s] By the broker's clock.
        """
        spot, home = self._spot, self._vehicle.snapshot.home
        if home is None or time_s < self._due_at_s:
            return []
        self._due_at_s = time_s + SEND_EVERY_S - SEND_TOLERANCE_S
        source = self._vehicle.target_source
        if source is None:
            return [target_message(spot, home, now)]
        state = source(followed_s, now)
        if state is None:
            return []  # The vehicle holds by itself until the target is known again
        place = spot._replace(latitude_deg=state.latitude_deg, longitude_deg=state.longitude_deg)
        return [target_message(place, home, now, velocity_ned_m_s=state.velocity_ned_m_s)]


def read_target_sources(
    targets: Mapping[int, int | Path], find: Callable[[int], Vehicle | None]
) -> dict[int, TargetSource]:
    """Give the target of every follower: a vehicle's number or a file.

    Raises:
        TargetSourceError: if a file cannot be read.
    """
    return {follower: _source(target, find) for follower, target in targets.items()}


def _source(target: int | Path, find: Callable[[int], Vehicle | None]) -> TargetSource:
    if isinstance(target, int):
        return VehicleTarget(lambda: find(target)).at
    try:
        if target.stat().st_size > MAX_FILE_BYTES:
            raise TargetSourceError(f"{target}: it is larger than {MAX_FILE_BYTES} bytes")
        track = read_track(target.read_text(encoding="utf-8"))
    except OSError as error:
        raise TargetSourceError(f"{target}: {error.strerror}") from error
    except (UnicodeDecodeError, TargetFileError) as error:
        raise TargetSourceError(f"{target}: {error}") from error
    return lambda elapsed_s, _now: track.at(elapsed_s)
