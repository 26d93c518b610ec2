"""What every service needs: configuration, database, clock, signals to relay and brokers."""

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from afarcloud.flyable import VehicleLimits
from afarcloud.numbers import LAST_SECOND, format_time
from edge_server.archive.writer import FlightArchive
from edge_server.config import Config
from edge_server.outbox import wakeup
from edge_server.pictures.mosaics import MosaicWork
from edge_server.pictures.orthophotos import Orthophotos
from edge_server.pictures.thumbnails import Thumbnails
from edge_server.services.brokers import BrokerContacts, WorkSignal
from edge_server.services.fleet.event_ages import EventAges
from edge_server.services.fleet.unstored_states import UnstoredStates
from edge_server.services.space import Space
from edge_server.store.connection.database import Database, Topic
from edge_server.store.files import high_water
from edge_server.store.files.high_water import HighWater
from edge_server.store.rows import vehicles
from edge_server.store.rows.work import PossibleFlight

WAITING_LIMIT = 8
CACHED_S: Final = 0.5


class Caller(NamedTuple):
    """The sender of a request and its idempotency key.

    `name` is that of the access key: a rotated key keeps it, and each broker has its own.
    """

    role: str
    idempotency_key: str | None = None
    name: str = ""
    instance: str = ""
    """Which of the brokers with this key it is; some brokers do not state it."""

    @property
    def broker(self) -> str:
        """Identity of a broker."""
        return vehicles.identity(self.owner, self.instance)

    @property
    def owner(self) -> str:
        """Owner of the idempotency keys: the same key of another sender is another key."""
        return f"{self.role}/{self.name or self.role}"


Precondition = Callable[[dict[str, Any]], None]
"""Checks an object as it is shown, in the transaction that will change it; raises ChangedError."""


def unconditionally(_shown: dict[str, Any]) -> None:
    """Accept any state."""


class BriefCache:
    """Missions as they were read less than `CACHED_S` ago, until one is changed here."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._lock = threading.Lock()
        self._changes = 0
        self._missions: tuple[PossibleFlight, ...] = ()
        self._until_s = float("-inf")

    def get(self, read: Callable[[], Iterable[PossibleFlight]]) -> tuple[PossibleFlight, ...]:
        """Return what was read last; read it again when another server may have changed it."""
        with self._lock:
            changes = self._changes
            if self._monotonic() < self._until_s:
                return self._missions
        missions = tuple(read())
        with self._lock:
            if changes == self._changes:  # Else this may be the state before the change
                self._missions, self._until_s = missions, self._monotonic() + CACHED_S
        return missions

    def clear(self) -> None:
        """Clear the cache; call after the commit of a change."""
        with self._lock:
            self._changes += 1
            self._until_s = float("-inf")


@dataclass(frozen=True, slots=True)
class Context:
    """Shared by all requests of a process.

    `clock` gives epoch seconds, `monotonic` a time [s] that no time server changes.
    """

    config: Config
    database: Database
    clock: Callable[[], float]
    monotonic: Callable[[], float] = time.monotonic
    work_signal: WorkSignal = field(init=False)
    space: Space = field(init=False)
    contacts: BrokerContacts = field(init=False)
    event_ages: EventAges = field(init=False)
    high_water: HighWater | None = field(init=False)
    archive: FlightArchive = field(init=False)
    fence_check: threading.Lock = field(default_factory=threading.Lock)
    """Held while a plan is checked against its geofence: aborts share the interpreter."""
    unstored: UnstoredStates = field(default_factory=UnstoredStates)
    not_flown: BriefCache = field(init=False)
    """Missions that were accepted and are not known to have flown."""
    orthophotos: Orthophotos = field(init=False)
    thumbnails: Thumbnails = field(default_factory=Thumbnails)
    mosaics: MosaicWork = field(default_factory=MosaicWork)
    places_to_wait: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(WAITING_LIMIT)
    )

    def __post_init__(self) -> None:
        signal = WorkSignal(lambda: self.database.announce(Topic.WORK))
        object.__setattr__(self, "work_signal", signal)
        space = Space(self.config, self.database, self.clock, lambda: self.wake_relay(changed=True))
        object.__setattr__(self, "space", space)
        object.__setattr__(self, "not_flown", BriefCache(self.monotonic))
        object.__setattr__(self, "contacts", BrokerContacts(self.database, self.clock))
        object.__setattr__(self, "event_ages", EventAges(self.monotonic))
        archive = FlightArchive(
            self.config.archive_path,
            budget_bytes=self.config.archive_mib * 1024 * 1024,
            days=self.config.archive_days,
            clock=self.clock,
            monotonic=self.monotonic,
        )
        object.__setattr__(self, "archive", archive)
        photos = Orthophotos(self.config.edge_dir / "orthophotos")
        object.__setattr__(self, "orthophotos", photos)
        mark = HighWater(high_water.path_of(self.config.database_path))
        object.__setattr__(self, "high_water", None if self.database.is_shared else mark)

    @property
    def vehicle_limits(self) -> VehicleLimits:
        """Limits of what a plan may require of a vehicle."""
        return VehicleLimits(
            farthest_m=self.config.farthest_m, longest_leg_m=self.config.longest_leg_m
        )

    @property
    def wake_path(self) -> Path:
        """The relay's pipe."""
        return self.config.wake_path

    def wake_relay(self, *, changed: bool = False) -> None:
        """Notify the relay that records were added, or changed; call after the commit."""
        if self.database.is_shared:
            self.database.announce(Topic.CHANGED if changed else Topic.DUE)
        else:
            wakeup.wake(self.wake_path, changed=changed)

    def note_acknowledged(self, record_id: int) -> None:
        """Store outside the database that a record was committed; call before the answer."""
        if self.high_water is not None:
            self.high_water.raise_to(record_id)

    def note_published(self, work_id: int) -> None:
        """Store outside the database which work was published; call before the answer."""
        if self.high_water is not None:
            self.high_water.raise_work_to(work_id)

    def was_published(self, work_id: int) -> bool | None:
        """Whether this work was published; None if that is not known, with a shared database."""
        return None if self.high_water is None else work_id <= self.high_water.newest_work

    def close(self) -> None:
        """Close the files and connections, at once instead of when Python collects them."""
        self.database.close()
        self.archive.close()
        if self.high_water is not None:
            self.high_water.close()

    def receive_notice(self, topic: str) -> None:
        """Handle a notice of another server on the same database."""
        if topic == Topic.WORK:
            self.work_signal.notify_here()


_FIRST_S: Final = datetime.min.replace(tzinfo=UTC).timestamp()


def moment(epoch_s: float) -> datetime:
    """Convert epoch seconds to UTC, limited to the first and last day of the calendar."""
    return datetime.fromtimestamp(min(max(epoch_s, _FIRST_S), LAST_SECOND), UTC)


def show_time(epoch_s: float) -> str:
    """Write epoch seconds as RFC 3339 in UTC, to the millisecond."""
    return format_time(moment(round(epoch_s, 3)))
