"""Keeps within the disk budget: refuses records without room, thins and drops the backlog.

The use is measured in each cycle of the housekeeping, and whenever a hundredth of the budget has
been stored since; in between, the sizes of stored records are added up.
"""

import logging
import math
import shutil
import threading
from collections.abc import Callable, Sequence
from typing import Final

from edge_server.config import Config
from edge_server.outbox import budget, gaps, thinning
from edge_server.outbox.budget import Level, Usage
from edge_server.outbox.gaps import DroppedRecord, Reason
from edge_server.outbox.queue import PRIORITY
from edge_server.outbox.steady_clock import SteadyClock
from edge_server.outbox.thinning import Intervals
from edge_server.services.errors import FullError
from edge_server.store.connection.database import Database
from edge_server.store.files import ballast, upkeep
from edge_server.store.files.upkeep import CheckpointResult

LOG = logging.getLogger(__name__)
RECORD_BYTES: Final = 500  # Size of a record with its indexes, about
RECEIPTS_KEPT_S: Final = 3600.0  # Even when it is full
MOST_ROWS: Final = 2000  # Per transaction
STEPS: Final = 40  # Transactions per cycle
_LOOK_AGAIN_S: Final = 1.0
"""Pause after nothing could be dropped."""
_MEASURE_SHARE: Final = 0.01
_CALM_SHARE: Final = 0.7
_TIMES_BALLAST: Final = 2
_DATA_PART: Final = 0.4
_PICTURE_PART: Final = 0.3
"""Shares of the disk, at most, whatever the settings allow."""
_MIB: Final = 1024 * 1024
Counter = Callable[[str, str, int], None]
"""Takes kind, reason and number of dropped records."""


def budgets(config: Config, is_shared: bool) -> tuple[int, int]:  # noqa: FBT001  # of a database
    """Return the budgets of records and pictures [bytes]: as set, limited by the disk.

    The rest of a small disk is for the write-ahead log, the ballast and rows until their deletion.
    """
    data, pictures = config.data_budget_mib * _MIB, config.picture_budget_mib * _MIB
    if is_shared:
        return data, pictures
    disk = shutil.disk_usage(config.edge_dir).total
    return min(data, int(_DATA_PART * disk)), min(pictures, int(_PICTURE_PART * disk))


class Space:
    """The disk budget of one edge server; safe to use from several threads."""

    def __init__(
        self,
        config: Config,
        database: Database,
        clock: Callable[[], float],
        wake_relay: Callable[[], None],
    ) -> None:
        self._config = config
        self._database = database
        self._clock = clock
        self._wake_relay = wake_relay
        self._data_budget, self._picture_budget = budgets(config, database.is_shared)
        self._lock = threading.Lock()
        self._making_room = threading.Lock()
        self._usage: Usage | None = None
        self._added_bytes = 0
        self._has_checked_disk = False
        self._has_free_pages = False
        self._nothing_left_until = 0.0
        self._thinned_to = 0
        self._intervals: Intervals = {}
        self._steady_clock = SteadyClock()
        self._newest_receipt_s: float | None = None  # Before the clock may have been set
        self._level_was = Level.NORMAL
        self.count: Counter = _count_nothing
        self.rows_at_once = max(100, min(MOST_ROWS, self._data_budget // 100 // RECORD_BYTES))

    def admit(self, kind: str, picture_bytes: int = 0) -> None:
        """Admit a record, making room if that is needed and possible.

        Raises:
            FullError: if there is no room for it.
        """
        if kind not in budget.URGENT and self._disk_is_full():
            raise FullError("the disk is full; nothing was stored")
        now = self.level()
        if now >= Level.DROPPING and not self._database.is_shared:
            now = self._make_room()
        if not budget.has_room(kind, now):
            raise FullError("the disk budget is used up; nothing was stored")
        with self._lock:
            used = self._usage or Usage(0, 0)
            pictures = used.picture_bytes + picture_bytes
            if picture_bytes and pictures > self._picture_budget:
                raise FullError("the budget for pictures is used up; nothing was stored")
            self._added_bytes += RECORD_BYTES + picture_bytes
            self._usage = Usage(used.data_bytes + RECORD_BYTES, pictures)

    def _disk_is_full(self) -> bool:
        """Whether the relay has released the ballast: the rest is for it and for urgent records.

        Free pages of the file are room too if the file cannot return them to the disk.
        """
        return self._has_checked_disk and not (
            self._config.ballast_path.exists() or self._has_free_pages
        )

    @property
    def lacking_bytes(self) -> int:
        """How much of the disk has to be free so that all records are accepted; 0 while they are.

        The ballast is made again when twice its size is free.
        """
        return ballast.bytes_to_hold(self._config.ballast_path) if self._disk_is_full() else 0

    def level(self) -> Level:
        """Return how full the budget is, by the last measurement and what was stored since."""
        with self._lock:
            found = self._usage
            stale = self._added_bytes > _MEASURE_SHARE * self._data_budget
        return self._level_of(self.measure() if found is None or stale else found)

    def _level_of(self, found: Usage) -> Level:
        return budget.level(found.data_bytes, self._data_budget)

    def measure(self) -> Usage:
        """Measure the use in the database."""
        with self._database.read() as connection:
            found = budget.measure(connection)
            if self._newest_receipt_s is None:
                self._newest_receipt_s = budget.newest_receipt(connection)
        with self._lock:
            self._usage = found
            self._added_bytes = 0
        return found

    def maintain(self, monotonic: float) -> None:
        """One cycle: hold the ballast; delete receipts, thin and drop records as needed."""
        self._watch_clock(monotonic)
        if not self._database.is_shared:
            self._hold_room()
        self._log_level(self.measure())
        for _ in range(1 if self._database.is_shared else STEPS):
            if self.level() < Level.THINNING or not (self._delete_receipts() or self._thin()):
                break
        if self.level() >= Level.DROPPING:
            self._make_room()

    def _hold_room(self) -> None:
        """Hold the ballast; on a disk with little room return free pages of the file to it."""
        ballast.hold_for_start(self._config.start_reserve_path)
        path = self._config.ballast_path
        free = shutil.disk_usage(self._config.edge_dir).free
        if not ballast.hold(path) or free < ballast.size_on(path):
            if not upkeep.hold_room(self._database):
                self.release_ballast()
            if upkeep.checkpoint(self._database) is CheckpointResult.FULL and ballast.release(path):
                LOG.warning("the disk is full; the ballast %s is released", path)
                upkeep.checkpoint(self._database)
            if not upkeep.release_pages(self._database, STEPS) and self._may_release_ballast():
                LOG.info(
                    "the ballast %s is released, since returning free pages to the disk needs room",
                    path,
                )
                ballast.release(path)
                upkeep.release_pages(self._database, STEPS)
            self._has_free_pages = not ballast.hold(path) and upkeep.look(
                self._database
            ).free_bytes > _TIMES_BALLAST * ballast.size_on(path)
        self._has_checked_disk = True

    def release_ballast(self) -> bool:
        """Turn a part of the ballast into free pages of the file; returns whether there was one."""
        path = self._config.ballast_path
        if self._database.is_shared or not ballast.release(path):
            return False
        LOG.warning("the disk is full; a part of the ballast %s becomes free pages", path)
        upkeep.hold_room(self._database)  # At once: another program may take the room
        return True

    def _may_release_ballast(self) -> bool:
        """Whether the free pages of the file exceed the ballast."""
        path = self._config.ballast_path
        if not path.exists():
            return False
        return upkeep.look(self._database).free_bytes > _TIMES_BALLAST * ballast.size_on(path)

    def drop_aged(self, monotonic: float) -> None:
        """Drop records that are too old, and dead letters beyond their budget."""
        now = self._clock()
        if self.trusts_clock(monotonic):
            for kind in PRIORITY.keys() - {gaps.KIND}:
                while self._drop_aged_of(kind, now):
                    continue
        while self._drop_dead_letters():
            continue

    def trusts_clock(self, monotonic: float) -> bool:
        """Whether the wall clock has run steadily for so long that records may count as old.

        One that was just set may be wrong by years.
        """
        self._watch_clock(monotonic)
        return self._steady_clock.is_steady(monotonic)

    def _watch_clock(self, monotonic: float) -> None:
        """Note whether the wall clock was set, and before what time the receipts were stored."""
        was_s = self._steady_clock.watch(self._clock(), monotonic)
        if was_s is not None:
            self._newest_receipt_s = was_s
        elif self._steady_clock.is_steady(monotonic):
            self._newest_receipt_s = math.inf

    def _make_room(self) -> Level:
        """Drop the oldest droppable records until there is room, or none is left."""
        with self._making_room:
            now = self._level_of(self.measure())
            if self._clock() < self._nothing_left_until <= self._clock() + _LOOK_AGAIN_S:
                return now
            while now >= Level.DROPPING:
                if not (self._delete_receipts() or self._drop_oldest()):
                    self._nothing_left_until = self._clock() + _LOOK_AGAIN_S
                    break
                now = self._level_of(self.measure())
                if self._database.is_shared:
                    break  # Its statistics lag behind; the next cycle sees the result
            return now

    def _delete_receipts(self) -> bool:
        """Delete old receipts; returns whether there were any.

        After the clock was set forward, or at a start, they are as old as beside the newest one.
        """
        newest_s = math.inf if self._newest_receipt_s is None else self._newest_receipt_s
        with self._database.write() as connection:
            before = min(self._clock(), newest_s) - RECEIPTS_KEPT_S
            deleted = budget.delete_receipts(connection, before, self.rows_at_once)
        if deleted:
            self.measure()
        return deleted > 0

    def _thin(self) -> bool:
        """Thin the next part of the backlog; returns whether there is more to examine."""
        with self._database.read() as connection:
            found = thinning.to_thin(
                connection, self._thinned_to, self.rows_at_once, self._intervals
            )
        self._thinned_to = found.bookmark
        self._drop(found.to_drop, Reason.THINNED)
        return not found.at_end

    def _drop_oldest(self) -> bool:
        with self._database.read() as connection:
            chosen = thinning.oldest(connection, self.rows_at_once)
        return self._drop(chosen, Reason.BUDGET)

    def _drop_aged_of(self, kind: str, now: float) -> bool:
        is_picture = kind == "image"
        days = self._config.retain_images_days if is_picture else self._config.retain_telemetry_days
        with self._database.read() as connection:
            chosen = thinning.aged(connection, kind, now - days * 86400.0, self.rows_at_once)
        return self._drop(chosen, Reason.AGE)

    def _drop_dead_letters(self) -> bool:
        most = self._config.dead_letter_budget_mib * _MIB
        with self._database.read() as connection:
            chosen = thinning.excess_dead_letters(connection, most, self.rows_at_once)
        return self._drop(chosen, Reason.DEAD_LETTERS)

    def _drop(self, records: Sequence[DroppedRecord], reason: Reason) -> bool:
        """Drop records and declare them; returns whether any were dropped."""
        if not records:
            return False
        with self._database.write() as connection:
            dropped = gaps.drop(connection, records, reason, self._clock())
        return self._note_dropped(dropped, reason)

    def _note_dropped(self, dropped: dict[str, int], reason: Reason) -> bool:
        """Count dropped records; returns whether there were any."""
        for kind, number in dropped.items():
            self.count(kind, reason.value, number)
        if dropped:
            self._wake_relay()
            self.measure()
        return bool(dropped)

    def _log_level(self, found: Usage) -> None:
        """Log how full the budget is, once per change; swings about a bound are logged once."""
        now = self._level_of(found)
        calm = found.data_bytes < _CALM_SHARE * self._data_budget
        if now > self._level_was:
            LOG.warning("disk budget: %s", _WORDS[now])
        elif now < self._level_was and calm:
            LOG.info("disk budget: %s", _WORDS[now])
        else:
            return
        self._level_was = now


_WORDS: Final = {
    Level.NORMAL: "there is room",
    Level.THINNING: "more than 80 % used, state vectors and poses are thinned",
    Level.NO_PICTURES: "more than 95 % used, pictures are refused",
    Level.DROPPING: "used up, the oldest state vectors, poses and batteries are dropped",
    Level.FULL: "used up with its reserve, every record is refused",
}


def _count_nothing(_kind: str, _reason: str, _number: int) -> None:
    """Default of `Space.count`."""
