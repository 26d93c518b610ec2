"""Reports that could not be archived: how many of which vehicle, and when.

They are counted in memory until the archive can be written again, and are stored then: a flight
shows how many of its reports it lacks, also after a restart.
"""

import sqlite3
import threading
from collections.abc import Iterable
from typing import Final, NamedTuple

from edge_server.archive import tables

KEPT: Final = 1000
"""Rows; older ones are deleted, with the flights that they are about."""
MERGED_S: Final = 60.0
"""Losses of a vehicle within the same minute are one row."""


class Loss(NamedTuple):
    """Reports of a vehicle that are missing, received between two times [s since 1970]."""

    vehicle_id: int
    since: float
    until: float
    reports: int


class Losses:
    """What is not stored yet; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._losses: dict[tuple[int, float], Loss] = {}

    @property
    def count(self) -> int:
        """How many reports these are."""
        with self._lock:
            return sum(loss.reports for loss in self._losses.values())

    def note(self, received: Iterable[tuple[int, float]]) -> None:
        """Note reports by vehicle and time of receipt."""
        self.put_back(Loss(vehicle_id, at, at, 1) for vehicle_id, at in received)

    def put_back(self, losses: Iterable[Loss]) -> None:
        """Note what could not be stored."""
        with self._lock:
            for loss in losses:
                key = self._key_of(loss)
                before = self._losses.get(key, loss._replace(reports=0))
                self._losses[key] = Loss(
                    loss.vehicle_id,
                    min(before.since, loss.since),
                    max(before.until, loss.until),
                    before.reports + loss.reports,
                )

    def _key_of(self, loss: Loss) -> tuple[int, float]:
        """Vehicle and minute, so that no loss counts for two flights; of too many the last one."""
        key = loss.vehicle_id, loss.since // MERGED_S
        if key in self._losses or len(self._losses) < KEPT:
            return key
        of_vehicle = (one for one in reversed(self._losses) if one[0] == loss.vehicle_id)
        return next(of_vehicle, key)

    def take(self) -> list[Loss]:
        """Give them to be stored."""
        with self._lock:
            taken = list(self._losses.values())
            self._losses.clear()
            return taken


def store(connection: sqlite3.Connection, losses: list[Loss]) -> None:
    """Store them."""
    connection.executemany(
        "INSERT INTO lost (vehicle_id, since, until, reports) VALUES (?, ?, ?, ?)", losses
    )
    connection.execute("DELETE FROM lost WHERE id <= (SELECT max(id) FROM lost) - ?", (KEPT,))


def total(connection: sqlite3.Connection) -> int:
    """Return how many lost reports are stored."""
    return _sum(connection, "SELECT sum(reports) FROM lost", ())


def of_flight(connection: sqlite3.Connection, flight: sqlite3.Row) -> int:
    """Return how many reports of its vehicle were lost during a flight."""
    return _sum(
        connection,
        "SELECT sum(reports) FROM lost WHERE vehicle_id = ? AND until >= ? AND since <= ?",
        (flight["vehicle_id"], flight["started_at"], flight["ended_at"] or float("inf")),
    )


def _sum(connection: sqlite3.Connection, query: str, values: tuple[float, ...]) -> int:
    try:
        (found,) = connection.execute(query, values).fetchone()
    except sqlite3.OperationalError as error:
        if not tables.lacks_table(error):
            raise
        return 0
    return int(found or 0)
