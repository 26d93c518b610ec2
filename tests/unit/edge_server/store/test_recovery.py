"""What a broken database still holds is saved: whole rows, in order, and none that never was."""

import json
import logging
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.store import migrate, telemetry, vehicles
from edge_server.store.database import Database
from edge_server.store.engines import open_engine, sqlite_url

RECORDS = 600
PAGE = 4096
POSES = Stream(1, "pose")
ALARMS = Stream(1, "alarm")
Payloads = dict[str, str]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the database is."""
    return tmp_path / "edge" / "edge.sqlite3"


@pytest.fixture
def originals(path: Path) -> Payloads:
    """Fill a database; gives the payloads by message_id."""
    migrate.prepare(sqlite_url(path))
    payloads = {}
    database = Database(open_engine(sqlite_url(path)))
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
        (dead,) = queue.heads(connection, POSES, 0, 1)
        queue.bury(connection, dead, 3, "422")
    database.close()
    return payloads


def spoil(path: Path, change: Callable[[bytearray], None]) -> None:
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)


def saved(path: Path, stream: Stream) -> list[tuple[str, str]]:
    """Message ids and payloads that are due, in their order."""
    database = Database(open_engine(sqlite_url(path)))
    with database.read() as connection:
        heads = queue.heads(connection, stream, 0, 10**6)
    database.close()
    return [(parcel.message_id, parcel.payload) for parcel in heads]


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
    needle = {"telemetry": b'{"sequence_number"'}[table]
    pages = [content[start : start + PAGE] for start in range(0, len(content), PAGE)]
    return [number for number, page in enumerate(pages, 1) if needle in page]


def overwrite(page: int, junk: bytes) -> Callable[[bytearray], None]:
    def change(content: bytearray) -> None:
        start = (page - 1) * PAGE
        content[start : start + PAGE] = junk

    return change


@pytest.mark.parametrize("place", [0.0, 0.3, 0.99])
def test_telegraf18528_a_page_of_records_is_lost_and_the_others_are_saved(
    path: Path, originals: Payloads, place: float
) -> None:
    pages = pages_of(path, "telemetry")
    spoil(path, overwrite(pages[int(place * len(pages))], b"\xa5" * PAGE))
    check(path, originals, at_least=RECORDS - 40)


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


def test_telegraf18528_of_half_a_file_the_half_is_saved(path: Path, originals: Payloads) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2 // PAGE * PAGE])
    check(path, originals, at_least=RECORDS // 6)


def test_a_dead_letter_stays_one_and_no_id_is_used_again(path: Path, originals: Payloads) -> None:
    spoil(path, overwrite(pages_of(path, "telemetry")[-1], b"\0" * PAGE))
    check(path, originals, at_least=1)
    with closing(sqlite3.connect(path)) as connection:
        dead = connection.execute("SELECT last_error FROM outbox WHERE state = 'dead'").fetchall()
        count = connection.execute(
            "SELECT seq FROM sqlite_sequence WHERE name = 'telemetry'"
        ).fetchone()
        vehicle = connection.execute("SELECT vehicle_id FROM vehicle").fetchall()
    assert (dead, count, vehicle) == ([("422",)], (RECORDS,), [(1,)])


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
