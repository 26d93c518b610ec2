"""What every service needs: the database, the clock, whom to wake."""

import threading
from collections.abc import Callable
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

WAITING_LIMIT = 8


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
