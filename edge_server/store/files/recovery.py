"""Copies the readable rows of a broken SQLite file into a new database.

Every statement that reads a damaged page fails, so each table is read by rowid up to the damage and
on from the first row behind it. Then rows are added from pages to which no link leads any more:
records, and the data of people. A mission that is found so is held until an operator dispatches it,
since its progress is unknown.

A file whose first page is lost, which locates everything else, is read with the first page of the
new database: a file of the same version has its tables in the same places. Rows that do not fit our
tables are left out.

The file in quarantine itself is only read.
"""

import json
import logging
import mmap
import shutil
import sqlite3
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple
from urllib.parse import quote

from sqlalchemy import Table

from afarcloud.enumerations import Status
from edge_server.store.files import found_by_shape, salvage
from edge_server.store.rows.tables import METADATA, audit_chain, outbox, telemetry

LOG = logging.getLogger(__name__)
_CHUNK: Final = 1000
_LARGEST_ROWID: Final = 2**63 - 1
_PAGE_SIZE_AT: Final = 16
_PAGES_AT: Final = 28  # In the header (SQLite file format, section 1.3)
_FREELIST_AT: Final = 32
_WAL_VERSIONS_AT: Final = 18


class Recovered(NamedTuple):
    """How many rows were recovered, by table; `whole` if all were readable.

    `damaged_from` is by table the first id from which on some could not be read in their order.
    """

    rows: dict[str, int]
    whole: bool
    damaged_from: Mapping[str, int] = MappingProxyType({})


def recover(broken: Path, fresh: Path) -> Recovered:
    """Copy what can be read of a broken database into a new, empty one of the newest shape.

    All of it is in one transaction; a disk without room for it leaves the new one empty.
    """
    if not broken.stat().st_size:
        return _recover_from_log(broken, fresh)
    scratch = fresh.with_name(fresh.name + ".graft")
    try:
        with (
            closing(sqlite3.connect(fresh, isolation_level=None)) as target,
            closing(_open(broken, fresh, scratch)) as source,
        ):
            target.execute("PRAGMA foreign_keys=OFF")
            target.execute("BEGIN IMMEDIATE")
            found = _copy_all(source, target, broken)
            target.execute("COMMIT")
    except (sqlite3.DatabaseError, OSError) as error:
        LOG.critical("nothing can be saved of %s: %s", broken, error)
        return Recovered({}, whole=False)
    finally:
        scratch.unlink(missing_ok=True)
    return found


def _recover_from_log(broken: Path, fresh: Path) -> Recovered:
    """Recover the records in the log of an empty database; SQLite would delete such a log."""
    with closing(sqlite3.connect(fresh, isolation_level=None)) as target:
        target.execute("BEGIN IMMEDIATE")
        records = _salvage(broken, target)
        _insert(target, "outbox", [column.name for column in outbox.columns], _due({}, target))
        target.execute("COMMIT")
    return Recovered(
        {"telemetry": records} if records else {}, whole=False, damaged_from={"telemetry": 1}
    )


def _open(broken: Path, fresh: Path, scratch: Path) -> sqlite3.Connection:
    """Open the broken file, or a copy of it with another first page."""
    connection = _open_to_read(broken)
    try:
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        connection.execute("SELECT max(rowid) FROM alembic_version").fetchone()
    except sqlite3.DatabaseError:
        connection.close()
        _graft(broken, fresh, scratch)
        return _open_to_read(scratch)
    return connection


def _open_to_read(path: Path) -> sqlite3.Connection:
    """Open without changing a byte; the log of changes beside the file is read if there is one."""
    has_log = path.with_name(path.name + "-wal").exists()
    how = "mode=ro" if has_log else "mode=ro&immutable=1"
    return sqlite3.connect(f"file:{quote(str(path))}?{how}", uri=True, isolation_level=None)


def _graft(broken: Path, fresh: Path, scratch: Path) -> None:
    """Copy a file under the first page of a new database."""
    with closing(sqlite3.connect(fresh)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    with fresh.open("rb") as file:
        head = bytearray(file.read(_PAGE_SIZE_AT + 2))
        (page_size,) = struct.unpack_from(">H", head, _PAGE_SIZE_AT)
        head += file.read(page_size - len(head))
    shutil.copyfile(broken, scratch)
    pages = max(broken.stat().st_size // page_size, 1)
    struct.pack_into(">I", head, _PAGES_AT, pages)
    struct.pack_into(">II", head, _FREELIST_AT, 0, 0)
    head[_WAL_VERSIONS_AT : _WAL_VERSIONS_AT + 2] = b"\1\1"
    with scratch.open("rb+") as file:
        file.write(head)


def _copy_all(source: sqlite3.Connection, target: sqlite3.Connection, broken: Path) -> Recovered:
    rows: dict[str, int] = {}
    whole = True
    damaged_from: dict[str, int] = {}
    for table in METADATA.sorted_tables:
        reader = _Reader(source, table.name, [column.name for column in table.columns])
        kept = _outbox_rows(reader, target) if table is outbox else iter(reader)
        if table is telemetry:
            kept = (row for row in kept if _is_record(row))
        elif table.name in found_by_shape.JSON_COLUMNS:
            kept = reader.legible(table.name)
        columns = [column.name for column in outbox.columns] if table is outbox else reader.columns
        if table is audit_chain:
            rows[table.name] = _take_over_ends(target, columns, kept)
        else:
            rows[table.name] = _insert(target, table.name, columns, kept)
        if not reader.whole:
            damaged_from[table.name] = reader.damaged_from or 1
        if table is telemetry and not reader.whole:
            rows[table.name] += _salvage(broken, target)
        whole = whole and reader.whole
    damaged = [table for table in found_by_shape.TABLES if table.name in damaged_from]
    for name, number in _salvage_by_shape(broken, target, damaged).items():
        rows[name] += number
    _delete_delivered(target)
    _drop_orphans(target)
    _append_behind_the_newest(target)
    if "command" in damaged_from:
        _add_lost_commands(target)
    if damaged_from.keys() & {"plan", "work"}:
        _keep_only_ids_withdrawn(target)
    _continue_ids(source, target)
    found = {name: number for name, number in rows.items() if number}
    return Recovered(found, whole, damaged_from)


def _salvage(broken: Path, target: sqlite3.Connection) -> int:
    """Add the records that stand in pages to which no link leads any more."""
    columns = _columns(target, "telemetry")
    log = broken.with_name(broken.name + "-wal")
    with _mapped(broken) as file:
        whole = (
            {**dict(zip(columns, row.values, strict=True)), "id": row.rowid}
            for row in salvage.rows(file, log.read_bytes() if log.exists() else b"")
            if len(row.values) == len(columns) and row.rowid > 0
        )
        return _insert(target, "telemetry", columns, filter(_is_sound, whole))


def _columns(target: sqlite3.Connection, table: str) -> list[str]:
    """Return the columns of a table in the order of its rows."""
    return [row[1] for row in target.execute(f'PRAGMA table_info("{table}")').fetchall()]


def _salvage_by_shape(
    broken: Path, target: sqlite3.Connection, damaged: Sequence[Table]
) -> dict[str, int]:
    """Add the rows of other tables that stand in pages to which no link leads any more."""
    added = dict.fromkeys((table.name for table in damaged), 0)
    if not damaged:
        return added
    names = {table: _columns(target, table.name) for table in damaged}
    log = broken.with_name(broken.name + "-wal")
    with _mapped(broken) as file:
        for found in salvage.live_rows(file, log.read_bytes() if log.exists() else b""):
            for table in damaged:
                row = found_by_shape.row_of(table, names[table], found)
                if row is not None:
                    added[table.name] += _insert(target, table.name, list(row), [row])
    return added


@contextmanager
def _mapped(path: Path) -> Iterator[bytes | mmap.mmap]:
    """Map a file's content, so that only the parts that are read are in memory."""
    if not path.stat().st_size:
        yield b""
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        yield content


def _is_sound(row: dict[str, Any]) -> bool:
    """Whether a row that was found outside of any table is a record of this server."""
    return isinstance(row["kind"], str) and isinstance(row["vehicle_id"], int) and _is_record(row)


def _delete_delivered(target: sqlite3.Connection) -> None:
    """Delete records that the cloud has confirmed: deleted rows may still be in a page."""
    target.execute("DELETE FROM telemetry WHERE message_id IN (SELECT message_id FROM tombstone)")


class _Reader:
    """The rows of a table that can be read, as dicts, in the order of their rowids."""

    def __init__(self, source: sqlite3.Connection, table: str, wanted: Sequence[str]) -> None:
        self._source = source
        self._table = table
        self.columns = self._known(wanted)
        self.whole = bool(self.columns)
        self.damaged_from: int | None = None if self.columns else 1

    def _known(self, wanted: Sequence[str]) -> list[str]:
        try:
            rows = self._source.execute(f'PRAGMA table_info("{self._table}")').fetchall()
        except sqlite3.DatabaseError:
            return []
        there = {row[1] for row in rows}
        return [name for name in wanted if name in there]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        if not self.columns:
            return
        names = ", ".join(f'"{name}"' for name in self.columns)
        query = f'SELECT rowid, {names} FROM "{self._table}" WHERE rowid >= ? ORDER BY rowid'  # noqa: S608  # our own names
        start: int | None = -_LARGEST_ROWID
        while start is not None:
            after = start
            try:
                for row in self._source.execute(query, (start,)):
                    after = row[0] + 1
                    yield dict(zip(self.columns, row[1:], strict=True))
            except (sqlite3.DatabaseError, UnicodeDecodeError):
                self.whole = False
                if self.damaged_from is None:
                    self.damaged_from = max(after, 1)
                start = self._behind_the_damage(max(after, 1))
            else:
                start = None

    def legible(self, table: str) -> Iterator[dict[str, Any]]:
        """Return the rows whose JSON can be read; the others are damaged."""
        for row in self:
            if found_by_shape.has_readable_json(table, row):
                yield row
                continue
            self.whole = False
            if self.damaged_from is None:
                self.damaged_from = int(row[self.columns[0]])

    def _behind_the_damage(self, bad: int) -> int | None:
        """The first rowid after a bad one from which reading continues; None when there is none."""
        step, good = 1, None
        last = self._last_rowid()
        while bad + step <= last:
            if self._can_read(bad + step):
                good = bad + step
                break
            step *= 2
        if good is None:
            return None
        low = bad + step // 2
        while good - low > 1:
            middle = (low + good) // 2
            low, good = (low, middle) if self._can_read(middle) else (middle, good)
        return good

    def _can_read(self, rowid: int) -> bool:
        query = f'SELECT * FROM "{self._table}" WHERE rowid >= ? ORDER BY rowid LIMIT 1'  # noqa: S608  # our own names
        try:
            return self._source.execute(query, (rowid,)).fetchone() is not None
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            return False

    def _last_rowid(self) -> int:
        found = 0
        for query in (
            f'SELECT max(rowid) FROM "{self._table}"',  # noqa: S608  # our own names
            f"SELECT seq FROM sqlite_sequence WHERE name = '{self._table}'",  # noqa: S608  # as above
        ):
            with suppress(sqlite3.DatabaseError):
                row = self._source.execute(query).fetchone()
                found = max(found, int(row[0] or 0)) if row else found
        return found


def _is_record(row: dict[str, Any]) -> bool:
    """Whether a row is a whole record: its JSON names its own message_id."""
    try:
        body = json.loads(row["payload"])
    except (TypeError, ValueError, RecursionError):
        return False
    return isinstance(body, dict) and body.get("message_id") == row["message_id"]


def _outbox_rows(reader: _Reader, target: sqlite3.Connection) -> Iterator[dict[str, Any]]:
    """Return a row for each recovered record, in the order of the records.

    A record whose row is lost is queued again: record and row are only deleted together.
    """
    known = {row["record_id"]: row for row in reader}
    yield from _due(known, target)


def _due(known: dict[int, dict[str, Any]], target: sqlite3.Connection) -> Iterator[dict[str, Any]]:
    records = target.execute("SELECT id, vehicle_id, kind FROM telemetry ORDER BY id").fetchall()
    for record_id, vehicle_id, kind in records:
        row = known.get(record_id, {})
        is_dead = row.get("state") == "dead" and row.get("last_error") is not None
        yield {
            "id": record_id,
            "record_id": record_id,
            "vehicle_id": vehicle_id,
            "kind": kind,
            "state": "dead" if is_dead else "queued",
            "attempts": row.get("attempts", 0) if is_dead else 0,
            "last_error": row.get("last_error") if is_dead else None,
            "rejected_at": row.get("rejected_at") if is_dead else None,
            "sent": bool(row.get("sent", True)),  # Of a lost row nobody knows: it may have been
        }


def _insert(
    target: sqlite3.Connection, table: str, columns: Sequence[str], rows: Iterable[dict[str, Any]]
) -> int:
    """Insert rows; one that breaks a rule of the table is left out."""
    if not columns:
        return 0
    before = target.total_changes
    chunk: list[dict[str, Any]] = []
    for row in rows:
        chunk.append(row)
        if len(chunk) == _CHUNK:
            _insert_chunk(target, table, columns, chunk)
            chunk.clear()
    _insert_chunk(target, table, columns, chunk)
    return target.total_changes - before


def _insert_chunk(
    target: sqlite3.Connection, table: str, columns: Sequence[str], rows: list[dict[str, Any]]
) -> None:
    names = ", ".join(f'"{name}"' for name in columns)
    values = ", ".join(f":{name}" for name in columns)
    target.executemany(f'INSERT OR IGNORE INTO "{table}" ({names}) VALUES ({values})', rows)  # noqa: S608  # our own names


def _take_over_ends(
    target: sqlite3.Connection, columns: Sequence[str], rows: Iterable[dict[str, Any]]
) -> int:
    """Put the ends of the audit log in the place of those that a new database begins with."""
    values = ", ".join(f'"{name}" = :{name}' for name in columns)
    query = f"UPDATE OR IGNORE audit_chain SET {values}"  # noqa: S608  # our own names
    return sum(target.execute(query, row).rowcount for row in rows)


def _append_behind_the_newest(target: sqlite3.Connection) -> None:
    """Continue the audit log behind its newest row if its ends are lost."""
    target.execute(
        "UPDATE audit_chain SET last_id = newest.id, last_hash = newest.hash "
        "FROM (SELECT id, hash FROM audit ORDER BY id DESC LIMIT 1) AS newest "
        "WHERE last_id < newest.id"
    )


def _add_lost_commands(target: sqlite3.Connection) -> None:
    """Add lost commands of missions with the status of the last report.

    Commands that it does not list, which only a report of a long mission omits, have not started,
    or have ended with their mission.
    """
    query = "SELECT id, body, report, status_id FROM work WHERE kind = 'mission'"
    for work_id, body, report, status in target.execute(query).fetchall():
        listed = json.loads(report)["command_report_array"] if report else []
        reported = {one["command_id"]: one["command_status_id"] for one in listed}
        has_ended = Status(status).is_terminal
        rest = Status.FINISHED if status == Status.FINISHED else Status.ABORTED
        for entry in json.loads(body).get("command_array", []):
            known = reported.get(entry["command_id"], Status.NOT_STARTED)
            if has_ended and not Status(known).is_terminal:
                known = rest
            target.execute(
                "INSERT OR IGNORE INTO command (work, command_id, status_id) VALUES (?, ?, ?)",
                (work_id, entry["command_id"], int(known)),
            )


def _drop_orphans(target: sqlite3.Connection) -> None:
    """Delete rows that refer to a row that was not recovered, until there are none."""
    while orphans := target.execute("PRAGMA foreign_key_check").fetchall():
        for table, rowid, *_ in orphans:
            target.execute(f'DELETE FROM "{table}" WHERE rowid = ?', (rowid,))  # noqa: S608  # our own names


def _keep_only_ids_withdrawn(target: sqlite3.Connection) -> None:
    """Keep only the ids of withdrawn work: its plan may have continued with lost work."""
    target.execute("UPDATE withdrawn SET plan_id = '', vehicle_id = 0, mission_id = -1")


def _continue_ids(source: sqlite3.Connection, target: sqlite3.Connection) -> None:
    """Continue the ids of the broken database, so that none is reused."""
    with suppress(sqlite3.DatabaseError):
        for name, last in source.execute("SELECT name, seq FROM sqlite_sequence").fetchall():
            if not isinstance(last, int) or not 0 < last < 2**53 or name not in METADATA.tables:
                continue
            target.execute(
                "INSERT INTO sqlite_sequence SELECT ?, 0 WHERE NOT EXISTS "
                "(SELECT 1 FROM sqlite_sequence WHERE name = ?)",
                (name, name),
            )
            target.execute(
                "UPDATE sqlite_sequence SET seq = max(seq, ?) WHERE name = ?", (last, name)
            )
