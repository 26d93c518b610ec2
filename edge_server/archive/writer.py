"""Writes the archive. A failure of it is logged and counted, and affects no report.

Reports are archived after they are committed to the outbox, in the thread that stored them, so a
killed process loses one report at most. After a failure nothing is written for `PAUSE_S`, so that a
locked or slow file delays few requests.
"""

import logging
import shutil
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from afarcloud.state import MissionReport, Report
from afarcloud.wire import Kind
from edge_server.archive import flights, logs, losses, results, shortage, tables, upkeep
from edge_server.archive.flights import MissionName
from edge_server.archive.losses import Losses
from edge_server.archive.results import Place, Stored
from edge_server.archive.shortage import Room

LOG = logging.getLogger(__name__)
PAUSE_S: Final = 10.0
LOCK_PATIENCE_S: Final = 0.2
STEPS: Final = 20  # Transactions of a cycle of `maintain`
CALM_SHARE: Final = 0.9
"""The oldest flights are dropped from this share of the budget on."""
_MIB: Final = 1024 * 1024
_RESERVE_BYTES: Final = 64 * _MIB
_RESERVE_PART: Final = 4
_DAY_S: Final = 86_400.0
_Result = TypeVar("_Result")


class Received(NamedTuple):
    """A report that is stored in the outbox.

    `mission` is what it is about, and `place` where a picture says that it was taken, if known.
    """

    kind: Kind
    report: Report
    message_id: str | None
    received_at: float
    mission: MissionName | None = None
    place: Place | None = None


class Figures(NamedTuple):
    """State of the archive, for the metrics."""

    is_working: bool
    size_bytes: int
    """With the log of changes, which is written into the file now and then."""
    file_bytes: int
    """What the budget limits."""
    flights: int
    lost: int
    """Reports that could not be archived."""


class FlightArchive:
    """The archive of one edge server; safe to use from several threads."""

    def __init__(
        self,
        path: Path,
        *,
        budget_bytes: int,
        days: float,
        clock: Callable[[], float],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`budget_bytes` is the size of the file at most; 0 switches the archive off.

        `clock` gives epoch seconds, `monotonic` the time of pauses and of a short disk [s].
        """
        self._path = path
        self._budget_bytes = budget_bytes
        self._days = days
        self._clock = clock
        self._monotonic = monotonic
        self._lock = threading.Lock()
        self._connection: sqlite3.Connection | None = None
        self._inode = 0
        self._armed: dict[int, bool] = {}
        self._ids_before: list[tuple[str, int]] = []  # Of a file that was deleted
        self._resume_at = float("-inf")
        self._disk_is_short = False
        self._short_since = 0.0
        self._last_warning = ""
        self._has_failed = False
        self._losses = Losses()
        self._most_lost = 0

    @property
    def is_on(self) -> bool:
        """Whether reports are archived at all."""
        return self._budget_bytes > 0

    def take(self, received: Sequence[Received]) -> None:
        """Archive reports that are stored; call after the commit. Never raises."""

        def write(connection: sqlite3.Connection) -> None:
            for one in received:
                _take(connection, one)

        if received:
            self._attempt(write, [(one.report.vehicle_id, one.received_at) for one in received])

    def take_armed(
        self, vehicle_id: int, recorded_at: datetime | None, received_at: float, *, armed: bool
    ) -> None:
        """Archive that a vehicle is armed or disarmed; call after the commit. Never raises."""
        if self._armed.get(vehicle_id) == armed:
            return
        if self._attempt(
            lambda connection: flights.take_armed(
                connection, vehicle_id, recorded_at, received_at, armed=armed
            ),
            [],
        ):
            self._armed[vehicle_id] = armed

    def acknowledge(self, alarm_id: int, name: str, at: float) -> None:
        """Note who has acknowledged an alarm; the first one stays. Raises sqlite3.Error."""
        with self._lock:
            self._transact(
                lambda connection: connection.execute(
                    "UPDATE alarm SET acknowledged_at = ?, acknowledged_by = ?"
                    " WHERE id = ? AND acknowledged_at IS NULL",
                    (at, name, alarm_id),
                )
            )

    def keep_map(self, flight: int, band: str, about: str, data: bytes, at: float) -> None:
        """Keep the map of a flight in a band, which replaces a former one.

        Raises:
            sqlite3.Error, OSError: if it cannot be written, or the archive has no room for it.
        """
        with self._lock:
            self._write(
                lambda connection: connection.execute(
                    "REPLACE INTO flight_map SELECT id, ?, ?, ?, ? FROM flight"
                    " WHERE id = ? AND dropped = 0",
                    (band, at, about, data, flight),
                )
            )

    @property
    def largest_log_bytes(self) -> int:
        """How large a log may be; 0 if none is kept."""
        return int(logs.SHARE * self._budget_bytes)

    @property
    def has_room(self) -> bool:
        """Whether the disk has room besides what the records may need."""
        return not self._disk_is_short

    def change_logs(self, change: Callable[[sqlite3.Connection], _Result]) -> _Result:
        """Change logs (`edge_server.archive.logs`) in a transaction.

        Raises:
            sqlite3.Error, OSError: if it cannot be written, or the archive has no room for it.
        """
        with self._lock:
            return self._write(change)

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection | None]:
        """Give a connection that sees one state of the archive; None while there is none.

        Raises:
            sqlite3.Error: if the archive cannot be read.
        """
        connection = tables.open_for_reading(self._path) if self.is_on else None
        if connection is None:
            yield None
            return
        with closing(connection):
            connection.execute("BEGIN").close()
            yield connection

    def figures(self) -> Figures:
        """Return the state of the archive."""
        sizes = [file.stat().st_size for file in tables.files_of(self._path) if file.exists()]
        size, file_bytes = sum(sizes), self._path.stat().st_size if self._path.exists() else 0
        count = lost = 0
        try:
            with self.reading() as connection:
                if connection is not None:
                    (count,) = connection.execute(
                        "SELECT count(*) FROM flight WHERE dropped = 0"
                    ).fetchone()
                    lost = losses.total(connection)
            is_working = self.is_on and not (self._has_failed or self._disk_is_short)
        except sqlite3.Error:
            count, is_working = 0, False
        # Never less than before: they may be stored just now, or their file is set aside
        self._most_lost = max(self._most_lost, lost + self._losses.count)
        return Figures(is_working, size, file_bytes, count, self._most_lost)

    def close(self) -> None:
        """Close the file."""
        self._store_losses()
        with self._lock:
            self._close()

    def maintain(self, *, trusts_clock: bool, lacking_bytes: int = 0) -> None:
        """One cycle: drop flights beyond days and budget, and whatever the disk needs.

        Never raises. Flights count as old only by a clock that may be trusted. `lacking_bytes` is
        how much of the disk has to be free so that records are stored again, 0 while they are.
        """
        if not self.is_on or self._monotonic() < self._resume_at:
            return
        try:
            if not self._has_file():
                self._note_room(lacking_bytes)  # Its file may have been deleted to make it
                return
            if trusts_clock:
                self._locked(self._drop_aged)
            self._keep_budget()
            self._spare_disk(lacking_bytes)
        except Exception as error:  # noqa: BLE001  # the housekeeping continues after any error
            with self._lock:
                self._fail(error)
            self._discard_if_needed(lacking_bytes)

    def _attempt(
        self,
        write: Callable[[sqlite3.Connection], object],
        reports: Sequence[tuple[int, float]],
    ) -> bool:
        """Write, or note the reports (vehicle, time of receipt) that are lost."""
        if not self.is_on:
            return False
        if self._disk_is_short or self._monotonic() < self._resume_at:
            self._losses.note(reports)
            return False
        if not self._lock.acquire(timeout=LOCK_PATIENCE_S):
            self._losses.note(reports)
            return False
        try:
            self._write(write)
        except Exception as error:  # noqa: BLE001  # whatever it is, the report is stored
            self._losses.note(reports)
            self._fail(error)
            return False
        finally:
            self._lock.release()
        if self._has_failed:
            LOG.info("the flight archive is written again")
            self._has_failed = False
        self._store_losses()
        return True

    def _store_losses(self) -> None:
        """Store them, if there are any, or do so behind a later report."""
        if not self._losses.count or not self._lock.acquire(timeout=LOCK_PATIENCE_S):
            return
        lost = self._losses.take()
        try:
            self._transact(lambda connection: losses.store(connection, lost))
        except (sqlite3.Error, OSError):
            self._losses.put_back(lost)
        finally:
            self._lock.release()

    def _write(self, write: Callable[[sqlite3.Connection], _Result]) -> _Result:
        """Write; beyond the budget the oldest flight makes room."""
        try:
            return self._transact(write)
        except sqlite3.OperationalError as error:
            if not tables.is_full(error) or not self._transact(upkeep.mark_oldest):
                raise
            while self._transact(upkeep.drop_part):
                continue
            return self._transact(write)

    def _transact(self, write: Callable[[sqlite3.Connection], _Result]) -> _Result:
        connection = self._opened()
        connection.execute("BEGIN IMMEDIATE").close()
        try:
            result = write(connection)
            connection.execute("COMMIT").close()
        except BaseException:
            if connection.in_transaction:
                connection.execute("ROLLBACK").close()
            raise
        return result

    def _opened(self) -> sqlite3.Connection:
        if self._connection is None:
            connection = tables.open_for_writing(self._path, self._budget_bytes)
            try:
                tables.keep_ids_above(connection, self._ids_before)
            except BaseException:
                connection.close()
                raise
            self._connection, self._ids_before = connection, []
            self._inode = self._path.stat().st_ino
        return self._connection

    def _has_file(self) -> bool:
        """Whether there is a file; one that somebody has deleted or replaced is closed."""
        with self._lock:
            inode = self._path.stat().st_ino if self._path.exists() else 0
            if inode != self._inode:
                self._close()
        return inode != 0

    def _close(self) -> None:
        self._armed.clear()
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _fail(self, error: Exception) -> None:
        """Log a failure, once until it works again, and pause; a broken file is set aside."""
        if not self._has_failed:
            LOG.warning("the flight archive cannot be written; reports are stored: %s", error)
        self._has_failed = True
        self._close()
        if tables.is_unusable(error) and self._path.exists():
            tables.set_aside(self._path, str(error))
            return
        self._resume_at = self._monotonic() + PAUSE_S

    def _locked(self, change: Callable[[sqlite3.Connection], _Result]) -> _Result:
        """Change the archive in a transaction of its own, between those of reports."""
        with self._lock:
            return self._transact(change)

    def _drop_aged(self, connection: sqlite3.Connection) -> None:
        now = self._clock()
        flights.end_stale(connection, now)
        upkeep.mark_aged(connection, now - self._days * _DAY_S)

    def _keep_budget(self) -> None:
        """Delete what is marked, and the oldest flights while the budget is nearly used up."""
        for _ in range(STEPS):
            if self._locked(upkeep.drop_part) or self._locked(self._mark_excess_logs):
                continue
            with self._lock:
                used = upkeep.used_bytes(self._opened())
            if used <= CALM_SHARE * self._budget_bytes or not self._locked(upkeep.mark_oldest):
                break
        self._return_pages()

    def _mark_excess_logs(self, connection: sqlite3.Connection) -> bool:
        return logs.mark_excess(connection, self._budget_bytes, self._clock())

    def _return_pages(self) -> None:
        for _ in range(STEPS):
            with self._lock:
                if not upkeep.return_pages(self._opened()):
                    break

    def _spare_disk(self, lacking_bytes: int) -> None:
        """Drop the oldest flights while the disk is short, if that can help."""
        room = self._note_room(lacking_bytes)
        wanted = shortage.wanted_bytes(room, self._monotonic() - self._short_since)
        if not wanted:
            return
        with suppress(sqlite3.Error):  # On a full disk it may need room itself
            self._shrink()
        room = self._note_room(lacking_bytes)
        if room.free >= wanted:
            return
        droppable = self._droppable_bytes()
        if not shortage.can_help(room, droppable, wanted):
            self._warn_once(
                "the disk is nearly full, and not by flights: none is dropped; %d MiB are free, "
                "%d MiB are wanted, the flights that have ended use %d MiB",
                *(size // _MIB for size in (room.free, wanted, droppable)),
            )
            return
        self._warn_once("the disk is nearly full: the oldest flights are dropped from the archive")
        tables.set_aside_path(self._path).unlink(missing_ok=True)
        for _ in range(STEPS):
            if self._free_bytes() >= wanted:
                break
            if not (self._locked(upkeep.drop_part) or self._locked(upkeep.mark_oldest)):
                break
            self._shrink()
        self._note_room(lacking_bytes)

    def _shrink(self) -> None:
        """Return what the file and its log of changes do not need to the disk."""
        self._return_pages()
        with self._lock:
            upkeep.checkpoint(self._opened())

    def _droppable_bytes(self) -> int:
        """Return how much of the disk all flights have that have ended, about."""
        files = (*tables.files_of(self._path), tables.set_aside_path(self._path))
        size = sum(file.stat().st_size for file in files if file.exists())
        with self._lock:
            return max(size - upkeep.running_bytes(self._opened()), 0)

    def _note_room(self, lacking_bytes: int) -> Room:
        """Note whether the disk has room for flights beside the records, and since when not."""
        room = Room(self._free_bytes(), self._reserve_bytes(), lacking_bytes)
        if room.is_short and not self._disk_is_short:
            self._short_since = self._monotonic()
            LOG.warning(
                "the disk is nearly full: nothing is archived; %d MiB are free, the archive leaves "
                "%d MiB",
                *(room.free // _MIB, room.limit // _MIB),
            )
        elif self._disk_is_short and not room.is_short:
            self._last_warning = ""
            LOG.info("the disk has room again: flights are archived")
        self._disk_is_short = room.is_short
        return room

    def _warn_once(self, text: str, *values: int) -> None:
        """Log a warning about a shortage, unless it was the last one."""
        if self._last_warning != text:
            self._last_warning = text
            LOG.warning(text, *values)

    def _discard_if_needed(self, lacking_bytes: int) -> None:
        """Delete the whole archive if records lack its room, and no flight can be dropped."""
        room = Room(self._free_bytes(), self._reserve_bytes(), lacking_bytes)
        wanted = shortage.wanted_bytes(room, 0.0)
        size = sum(file.stat().st_size for file in tables.files_of(self._path) if file.exists())
        if not wanted or not shortage.can_help(room, size, wanted):
            return
        with self._lock:
            LOG.error("the disk is short: the flight archive %s is deleted", self._path)
            with suppress(sqlite3.Error, OSError):  # A broken file has to make room too
                if self._path.exists():
                    self._ids_before = tables.last_ids(self._opened())
            self._close()
            for file in tables.files_of(self._path):
                file.unlink(missing_ok=True)

    def _free_bytes(self) -> int:
        return shutil.disk_usage(self._path.parent).free

    def _reserve_bytes(self) -> int:
        """Return how much of the disk the archive leaves to the records."""
        total = shutil.disk_usage(self._path.parent).total
        return min(_RESERVE_BYTES, total // _RESERVE_PART)


def _take(connection: sqlite3.Connection, received: Received) -> None:
    report = received.report
    at = flights.time_of(connection, report.vehicle_id, report.recorded_at, received.received_at)
    if isinstance(report, MissionReport):
        mission = received.mission or MissionName(report.mission_id, report.plan_id)
        flights.take_mission_report(connection, report, mission, at, received.received_at)
    elif received.message_id is not None:
        results.take(
            connection,
            Stored(
                report, received.kind, received.message_id, at, received.received_at, received.place
            ),
        )
