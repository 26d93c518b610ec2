"""What a broken database still holds is saved: whole rows, in order, and none that never was."""

import json
import logging
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.store import migrate
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine, sqlite_url
from edge_server.store.files import high_water, integrity
from edge_server.store.files.high_water import HighWater
from edge_server.store.rows import telemetry, vehicles
from tests.support.databases import empty_sqlite

RECORDS = 600
PAGE = 4096
RECORD = b'{"sequence_number"'
"""How a record begins in the file."""
POSES = Stream(1, "pose")
ALARMS = Stream(1, "alarm")
Payloads = dict[str, str]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the database is."""
    return tmp_path / "edge" / "edge.sqlite3"


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Payloads]:
    """A database with records, and their payloads by message_id."""
    path = tmp_path_factory.mktemp("filled") / "edge" / "edge.sqlite3"
    payloads = {}
    database = Database(open_engine(empty_sqlite(path)))
    with database.write() as connection:
        vehicles.put(connection, 1, {"link_state": "connected"}, 0.0)
        for number in range(RECORDS):
            stream = ALARMS if number % 10 == 0 else POSES
            message_id = f"{number:026d}"
            body = {"sequence_number": number, "filler": "x" * 200, "message_id": message_id}
            payloads[message_id] = json.dumps(body)
            record_id = telemetry.add(
                connection,
                kind=stream.kind,
                vehicle_id=1,
                message_id=message_id,
                payload=payloads[message_id],
                received_at=float(number),
            )
            queue.enqueue(connection, record_id, stream)
        (dead,) = queue.read_queued(connection, POSES, 0, 1)
        queue.mark_dead(connection, dead, 3, "422", 12.5)
    database.close()
    return path, payloads


@pytest.fixture
def originals(filled: tuple[Path, Payloads], path: Path) -> Payloads:
    """Put a copy of the database where it belongs; gives the payloads by message_id."""
    database, payloads = filled
    shutil.copytree(database.parent, path.parent)
    return payloads


def spoil(path: Path, change: Callable[[bytearray], None]) -> None:
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)


def saved(path: Path, stream: Stream) -> list[tuple[str, str]]:
    """Message ids and payloads that are due, in their order."""
    database = Database(open_engine(sqlite_url(path)))
    with database.read() as connection:
        queued = queue.read_queued(connection, stream, 0, 10**6)
    database.close()
    return [(record.message_id, record.payload) for record in queued]


def check(path: Path, originals: Payloads, at_least: int) -> None:
    """So many were saved; each is what it was, and in its place."""
    migrate.prepare(sqlite_url(path))
    assert len(list((path.parent / "quarantine").glob("*.sqlite3"))) == 1
    assert list(path.parent.glob("*.new*")) == list(path.parent.glob("*.graft")) == []
    number = 0
    for stream in (POSES, ALARMS):
        found = saved(path, stream)
        number += len(found)
        assert all(originals[message_id] == payload for message_id, payload in found)
        keys = [message_id for message_id, _ in found]
        assert keys == sorted(keys)
    assert number >= at_least


def pages_of(path: Path, table: str) -> list[int]:
    """Numbers of the leaf pages of a table, from 1, found by what stands in them."""
    content = path.read_bytes()
    needle = {"telemetry": RECORD}[table]
    pages = [content[start : start + PAGE] for start in range(0, len(content), PAGE)]
    return [number for number, page in enumerate(pages, 1) if needle in page]


def overwrite(page: int, junk: bytes) -> Callable[[bytearray], None]:
    def change(content: bytearray) -> None:
        start = (page - 1) * PAGE
        content[start : start + PAGE] = junk

    return change


@pytest.mark.first_case
@pytest.mark.parametrize("place", [0.0, 0.3, 0.99])
def test_telegraf18528_a_page_of_records_is_lost_and_the_others_are_saved(
    path: Path, originals: Payloads, place: float
) -> None:
    pages = pages_of(path, "telemetry")
    spoil(path, overwrite(pages[int(place * len(pages))], b"\xa5" * PAGE))
    check(path, originals, at_least=RECORDS - 40)


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(8))
def test_telegraf18528_whatever_page_is_hit_no_record_is_changed(
    path: Path, originals: Payloads, seed: int
) -> None:
    random = Random(seed)
    page = random.randrange(1, path.stat().st_size // PAGE + 1)
    spoil(path, overwrite(page, random.randbytes(PAGE)))
    check(path, originals, at_least=0)


def test_telegraf18528_without_its_first_page_the_records_are_saved(
    path: Path, originals: Payloads
) -> None:
    spoil(path, overwrite(1, b"\xa5" * PAGE))
    check(path, originals, at_least=RECORDS - 1)


@pytest.mark.thorough
def test_telegraf18528_of_half_a_file_the_half_is_saved(path: Path, originals: Payloads) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2 // PAGE * PAGE])
    kept = path.read_bytes().count(RECORD)
    assert kept > 0
    check(path, originals, at_least=kept)


def test_a_dead_letter_stays_one_and_no_id_is_used_again(path: Path, originals: Payloads) -> None:
    spoil(path, overwrite(pages_of(path, "telemetry")[-1], b"\0" * PAGE))
    check(path, originals, at_least=1)
    with closing(sqlite3.connect(path)) as connection:
        query = "SELECT last_error, rejected_at FROM outbox WHERE state = 'dead'"
        dead = connection.execute(query).fetchall()
        count = connection.execute(
            "SELECT seq FROM sqlite_sequence WHERE name = 'telemetry'"
        ).fetchone()
        vehicle = connection.execute("SELECT vehicle_id FROM vehicle").fetchall()
    assert (dead, count, vehicle) == ([("422", 12.5)], (RECORDS,), [(1,)])


def test_a_lost_row_of_the_outbox_loses_no_record(path: Path, originals: Payloads) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("DELETE FROM outbox WHERE id % 2 = 0")
        connection.commit()
    spoil(path, overwrite(pages_of(path, "telemetry")[3], b"\xa5" * PAGE))
    check(path, originals, at_least=RECORDS - 40)


def test_it_is_told_at_critical(
    path: Path, originals: Payloads, caplog: pytest.LogCaptureFixture
) -> None:
    spoil(path, overwrite(pages_of(path, "telemetry")[0], b"\xa5" * PAGE))
    with caplog.at_level(logging.CRITICAL):
        check(path, originals, at_least=1)
    (line,) = caplog.records
    assert "was broken" in line.getMessage()
    assert "rows of telemetry" in line.getMessage()


def test_a_replacement_that_was_finished_is_taken(path: Path, originals: Payloads) -> None:
    path.rename(path.with_name(path.name + ".new"))
    migrate.prepare(sqlite_url(path))
    assert len(saved(path, POSES)) + len(saved(path, ALARMS)) == len(originals) - 1


def schema_pages(path: Path) -> list[int]:
    """Numbers of the pages that say what tables there are, except the first."""
    content = path.read_bytes()
    pages = [content[start : start + PAGE] for start in range(0, len(content), PAGE)]
    return [n for n, page in enumerate(pages, 1) if n > 1 and b"CREATE TABLE" in page]


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(6))
def test_a_flipped_bit_in_the_schema_loses_no_record(
    path: Path, originals: Payloads, seed: int
) -> None:
    draw = Random(seed)
    page = draw.choice(schema_pages(path))
    content = path.read_bytes()[(page - 1) * PAGE : page * PAGE]
    used = [place for place, byte in enumerate(content) if byte and place > 8]
    place = (page - 1) * PAGE + draw.choice(used)

    def flip(content: bytearray) -> None:
        content[place] ^= 1 << draw.randrange(8)

    spoil(path, flip)
    integrity.note_fault(path, "found while it was read")
    check(path, originals, at_least=RECORDS - 1)


def test_schema_pages_that_are_gone_lose_no_record(path: Path, originals: Payloads) -> None:
    pages = schema_pages(path)
    assert pages
    for page in [1, *pages]:
        spoil(path, overwrite(page, b"\xa5" * PAGE))
    check(path, originals, at_least=RECORDS - 1)


@pytest.mark.first_case
@pytest.mark.parametrize("is_empty", [False, True])
def test_a_database_that_is_gone_beside_its_log_gives_what_the_log_holds(
    path: Path, caplog: pytest.LogCaptureFixture, *, is_empty: bool
) -> None:
    migrate.prepare(sqlite_url(path))
    database = Database(open_engine(sqlite_url(path)))
    add(database, 100)
    log = path.with_name(path.name + "-wal")
    kept = log.read_bytes()
    assert len(kept) > PAGE
    database.close()
    path.unlink()
    if is_empty:
        path.touch()
    log.write_bytes(kept)
    migrate.prepare(sqlite_url(path))
    assert [key for key, _ in saved(path, POSES)] == [f"{number:026d}" for number in range(100)]
    assert "its write-ahead log still exists" in caplog.text
    assert (path.parent / "quarantine").exists()


@pytest.mark.first_case
@pytest.mark.parametrize("how", ["deleted", "emptied", "log cut", "log broken", "log deleted"])
def test_what_was_acknowledged_and_is_unknown_is_said_by_its_ids(
    path: Path, caplog: pytest.LogCaptureFixture, how: str
) -> None:
    migrate.prepare(sqlite_url(path))
    database = Database(open_engine(sqlite_url(path)))
    log = path.with_name(path.name + "-wal")
    add(database, 10)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    early = path.read_bytes()
    mark = HighWater(high_water.path_of(path))
    for number in range(10, 40):
        mark.raise_to(add(database, 1, number))
    changes = log.read_bytes()
    database.close()
    log.unlink(missing_ok=True)
    path.write_bytes(early)
    if how == "deleted":
        path.unlink()
    elif how == "emptied":
        path.write_bytes(b"")
    elif how == "log cut":
        log.write_bytes(changes[: len(changes) // 2])
    elif how == "log broken":
        middle = len(changes) // 2
        log.write_bytes(changes[:middle] + bytes([changes[middle] ^ 1]) + changes[middle + 1 :])
    migrate.prepare(sqlite_url(path))
    there = len(saved(path, POSES))
    assert there < 40
    assert (
        f"records up to 40 were acknowledged: those from {there + 1} to 40 are lost" in caplog.text
    )
    database = Database(open_engine(sqlite_url(path)))
    assert add(database, 1, 99) == 41
    database.close()
    caplog.clear()
    migrate.prepare(sqlite_url(path))
    assert caplog.text == ""


def add(database: Database, number: int, first: int = 0) -> int:
    """Keep some poses; returns the id of the last one."""
    record_id = 0
    for sequence_number in range(first, first + number):
        message_id = f"{sequence_number:026d}"
        body = {"sequence_number": sequence_number, "message_id": message_id}
        with database.write() as connection:
            record_id = telemetry.add(
                connection,
                kind="pose",
                vehicle_id=1,
                message_id=message_id,
                payload=json.dumps(body),
                received_at=float(sequence_number),
            )
            queue.enqueue(connection, record_id, POSES)
    return record_id


def root_page(path: Path, table: str) -> int:
    """Number of the page above all rows of a table, or of its only one."""
    with closing(sqlite3.connect(path)) as connection:
        (number,) = connection.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = ?", (table,)
        ).fetchone()
    return int(number)


def add_plans(path: Path, number: int, *, deleted: int = 0) -> None:
    """Keep plans of one mission each, many enough for several pages; some are deleted again."""
    with closing(sqlite3.connect(path)) as connection:
        for plan_id in range(1, number + deleted + 1):
            body = json.dumps({"name": "x" * 400, "number": plan_id})
            connection.execute(
                "INSERT INTO plan (id, plan_id, body, received_at, expires_at, warnings) "
                "VALUES (?, ?, ?, 1.0, 2.5, '[]')",
                (plan_id, f"{plan_id:026d}", body),
            )
            connection.execute(
                "INSERT INTO work (kind, vehicle_id, plan, mission_id, sequence_number, body, "
                "state, status_id, created_at, expires_at) "
                "VALUES ('mission', 1, ?, ?, 0, '{}', 'queued', 1, 1.0, 2.5)",
                (plan_id, plan_id),
            )
        for field_id in range(1, 6):
            body = json.dumps({"name": None, "boundary": [[0.5, 0.5], [0.5, 1.5], [1.5, 1.5]]})
            connection.execute("INSERT INTO field VALUES (?, ?, 1.0, 1.0)", (field_id, body))
        connection.commit()
        connection.execute("PRAGMA foreign_keys=ON")
        connection.execute("DELETE FROM plan WHERE id > ?", (number,))
        connection.commit()
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def kept(path: Path, query: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute(query).fetchall()


@pytest.mark.first_case
@pytest.mark.usefixtures("originals")
@pytest.mark.parametrize("table", ["plan", "work"])
def test_rows_below_a_page_that_is_lost_are_saved_of_other_tables_too(
    path: Path, table: str, caplog: pytest.LogCaptureFixture
) -> None:
    add_plans(path, 120, deleted=60)
    spoil(path, overwrite(root_page(path, table), b"\xa5" * PAGE))
    migrate.prepare(sqlite_url(path))
    plans = kept(path, "SELECT id, json_extract(body, '$.number'), received_at FROM plan")
    assert plans == [(number, number, 1.0) for number in range(1, 121)]
    works = kept(path, "SELECT plan, mission_id, state, held FROM work ORDER BY plan")
    is_held = int(table == "work")  # Nobody knows whether that was its last state
    assert works == [(number, number, "queued", is_held) for number in range(1, 121)]
    assert f"rows of {table} from 1 on" in caplog.text
    assert "records from" not in caplog.text


@pytest.mark.usefixtures("originals")
def test_vehicles_and_fields_are_not_taken_for_each_other(path: Path) -> None:
    add_plans(path, 1)
    for page in (1, *schema_pages(path)):
        spoil(path, overwrite(page, b"\xa5" * PAGE))
    migrate.prepare(sqlite_url(path))
    assert kept(path, "SELECT vehicle_id FROM vehicle") == [(1,)]
    assert kept(path, "SELECT id FROM field") == [(number,) for number in range(1, 6)]
    assert kept(path, "SELECT id FROM plan") == [(1,)]


@pytest.mark.usefixtures("originals")
def test_a_key_that_is_lost_does_not_open_again(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(
            "INSERT INTO access_key (prefix, role, sha256, created_at) "
            "VALUES ('0badc0de', 'admin', zeroblob(32), 1.0)"
        )
        connection.commit()
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    for page in (1, *schema_pages(path)):
        spoil(path, overwrite(page, b"\xa5" * PAGE))
    migrate.prepare(sqlite_url(path))
    assert kept(path, "SELECT prefix FROM access_key") == []
