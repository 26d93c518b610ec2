"""What every service needs: the database, the clock, whom to wake."""

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from afarcloud.numbers import LAST_YEAR, format_time
from afarcloud.vehicle import VehicleLimits
from edge_server.config import Config
from edge_server.outbox import wakeup
from edge_server.services.bell import Bell
from edge_server.services.space import Space
from edge_server.store import high_water
from edge_server.store.database import Database, Topic
from edge_server.store.high_water import HighWater
from edge_server.store.work import Work

WAITING_LIMIT = 8
CACHED_S: Final = 0.5


class Caller(NamedTuple):
    """Who asks, and with which idempotency key.

    `name` is that of the access key: a rotated key keeps it, and another broker has another one.
    """

    role: str
    idempotency_key: str | None = None
    name: str = ""

    @property
    def owner(self) -> str:
        """Whose idempotency keys are meant: those of another sender are other keys."""
        return f"{self.role}/{self.name or self.role}"


Precondition = Callable[[dict[str, Any]], None]
"""Looks at a thing as it is shown, in the transaction that will change it; raises ChangedError."""


def unconditionally(_shown: dict[str, Any]) -> None:
    """Change it however it is."""


class BriefCache:
    """Missions as they were read a moment ago, until something of them is changed here."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._changes = 0
        self._missions: tuple[Work, ...] = ()
        self._until_s = 0.0

    def get(self, read: Callable[[], Iterable[Work]]) -> tuple[Work, ...]:
        """Give what was read last; read it again when another server may have changed it."""
        with self._lock:
            changes = self._changes
            if time.monotonic() < self._until_s:
                return self._missions
        missions = tuple(read())
        with self._lock:
            if changes == self._changes:  # Else this may be what was there before
                self._missions, self._until_s = missions, time.monotonic() + CACHED_S
        return missions

    def clear(self) -> None:
        """Forget it; call after the commit of a change."""
        with self._lock:
            self._changes += 1
            self._until_s = 0.0


@dataclass(frozen=True, slots=True)
class Context:
    """Shared by all requests of a process; `clock` gives epoch seconds."""

    config: Config
    database: Database
    clock: Callable[[], float]
    bell: Bell = field(init=False)
    space: Space = field(init=False)
    high_water: HighWater | None = field(init=False)
    judging: threading.Lock = field(default_factory=threading.Lock)
    """Held while a plan is judged against its geofence: the interpreter is shared with aborts."""
    not_flown: BriefCache = field(default_factory=BriefCache)
    """Missions that were accepted and have not been seen to fly."""
    places_to_wait: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(WAITING_LIMIT)
    )

    def __post_init__(self) -> None:
        bell = Bell(lambda: self.database.announce(Topic.WORK))
        object.__setattr__(self, "bell", bell)
        space = Space(self.config, self.database, self.clock, lambda: self.wake_relay(changed=True))
        object.__setattr__(self, "space", space)
        mark = HighWater(high_water.path_of(self.config.database_path))
        object.__setattr__(self, "high_water", None if self.database.is_shared else mark)

    @property
    def vehicle_limits(self) -> VehicleLimits:
        """What a vehicle may be asked for."""
        return VehicleLimits(
            farthest_m=self.config.farthest_m, longest_leg_m=self.config.longest_leg_m
        )

    @property
    def wake_path(self) -> Path:
        """The relay's pipe."""
        return self.config.wake_path

    def wake_relay(self, *, changed: bool = False) -> None:
        """Tell the relay that records have come, or have been changed; call after commit."""
        if self.database.is_shared:
            self.database.announce(Topic.CHANGED if changed else Topic.DUE)
        else:
            wakeup.wake(self.wake_path, changed=changed)

    def note_acknowledged(self, record_id: int) -> None:
        """Remember apart from the database that a record was committed; call before the answer."""
        if self.high_water is not None:
            self.high_water.raise_to(record_id)

    def note_handed_out(self, work_id: int) -> None:
        """Remember apart from the database which work there is; call before it is given."""
        if self.high_water is not None:
            self.high_water.raise_work_to(work_id)

    def hear(self, topic: str) -> None:
        """Take in what another server on the same database tells."""
        if topic == Topic.WORK:
            self.bell.ring_here()


_FIRST_S: Final = datetime.min.replace(tzinfo=UTC).timestamp()
_LAST_S: Final = datetime(LAST_YEAR, 12, 31, 23, 59, 59, tzinfo=UTC).timestamp()


def moment(epoch_s: float) -> datetime:
    """Turn epoch seconds into a time in UTC; what no calendar has becomes its first or last day."""
    return datetime.fromtimestamp(min(max(epoch_s, _FIRST_S), _LAST_S), UTC)


def show_time(epoch_s: float) -> str:
    """Write epoch seconds as RFC 3339 in UTC, to the millisecond."""
    return format_time(moment(round(epoch_s, 3)))
