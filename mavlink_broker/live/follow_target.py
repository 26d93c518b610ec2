"""Targets that a vehicle follows (another vehicle, or a track in a file), and FOLLOW_TARGET(144).

TargetSourceError  a target that cannot be read; names the file and the line
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.planning.situation import Spot
from mavlink_broker.planning.target_track import (
    TargetFileError,
    TargetSource,
    TargetState,
    TargetTrack,
    VehicleTrack,
    read_track,
    target_message,
)
from mavlink_broker.vehicle.vehicle import Vehicle

MAX_FILE_BYTES: Final = 16_000_000
SEND_EVERY_S: Final = 0.2
"""The rate of the vehicle's own positions; each of them triggers one message."""
SEND_TOLERANCE_S: Final = 0.05


class TargetSourceError(Exception):
    """A target that cannot be read."""


class FileTarget:
    """A track in a file, which starts with the follow."""

    def __init__(self, track: TargetTrack) -> None:
        self._track = track

    def at(self, elapsed_s: float, now: float) -> TargetState | None:
        """Give the target's state some time after the follow began."""
        del now
        return self._track.at(elapsed_s)


class VehicleTarget:
    """Another vehicle."""

    def __init__(self, find: Callable[[], Vehicle | None]) -> None:
        self._find = find
        self._track = VehicleTrack()

    def at(self, elapsed_s: float, now: float) -> TargetState | None:
        """Give the vehicle's state now; None while it is not connected."""
        del elapsed_s
        vehicle = self._find()
        position = None if vehicle is None else vehicle.snapshot.position
        if vehicle is None or position is None or not vehicle.is_connected(now):
            return None
        vehicle_time_s = vehicle.snapshot.time_s
        time_s = now if vehicle_time_s is None else vehicle_time_s
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
        state = source.at(followed_s, now)
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
        return VehicleTarget(lambda: find(target))
    try:
        if target.stat().st_size > MAX_FILE_BYTES:
            raise TargetSourceError(f"{target}: it is larger than {MAX_FILE_BYTES} bytes")
        return FileTarget(read_track(target.read_text(encoding="utf-8")))
    except OSError as error:
        raise TargetSourceError(f"{target}: {error.strerror}") from error
    except (UnicodeDecodeError, TargetFileError) as error:
        raise TargetSourceError(f"{target}: {error}") from error
