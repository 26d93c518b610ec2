"""Whom a vehicle follows: another vehicle of this broker, or the way in a file.

LeadError  a follower's target that cannot be read; names the file and the line
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from mavlink_broker.planning.target_track import (
    Lead,
    LeadTrack,
    Sighting,
    TargetFileError,
    TargetTrack,
    read_track,
)
from mavlink_broker.vehicle.vehicle import Vehicle

LARGEST_FILE_BYTES: Final = 16_000_000


class LeadError(Exception):
    """A follower's target that cannot be read."""


class FileLead:
    """The way in a file, which begins with the follow."""

    def __init__(self, track: TargetTrack) -> None:
        self._track = track

    def at(self, elapsed_s: float, now: float) -> Sighting | None:
        """Where it is, some time after the follow began."""
        del now
        return self._track.at(elapsed_s)


class VehicleLead:
    """Another vehicle, wherever it is."""

    def __init__(self, find: Callable[[], Vehicle | None]) -> None:
        self._find = find
        self._track = LeadTrack()

    def at(self, elapsed_s: float, now: float) -> Sighting | None:
        """Where it is now; None while it is not heard."""
        del elapsed_s
        vehicle = self._find()
        place = None if vehicle is None else vehicle.snapshot.position
        if vehicle is None or place is None or not vehicle.is_connected(now):
            return None
        told_s = vehicle.snapshot.time_s
        time_s = now if told_s is None else told_s
        self._track.take(time_s, place.latitude_deg, place.longitude_deg)
        return self._track.at(time_s)


def read_leads(
    targets: Mapping[int, int | Path], find: Callable[[int], Vehicle | None]
) -> dict[int, Lead]:
    """Give every follower its target.

    Raises:
        LeadError: if a file cannot be read.
    """
    return {follower: _lead(target, find) for follower, target in targets.items()}


def _lead(target: int | Path, find: Callable[[int], Vehicle | None]) -> Lead:
    if isinstance(target, int):
        return VehicleLead(lambda: find(target))
    try:
        if target.stat().st_size > LARGEST_FILE_BYTES:
            raise LeadError(f"{target}: it is larger than {LARGEST_FILE_BYTES} bytes")
        return FileLead(read_track(target.read_text(encoding="utf-8")))
    except OSError as error:
        raise LeadError(f"{target}: {error.strerror}") from error
    except (UnicodeDecodeError, TargetFileError) as error:
        raise LeadError(f"{target}: {error}") from error
