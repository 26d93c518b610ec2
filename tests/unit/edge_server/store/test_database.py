"""Transactions: durable, exclusive for writers, all or nothing."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from edge_server.store.database import Database, to_json
from edge_server.store.engines import open_engine, sqlite_url
from edge_server.store.tables import METADATA


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """A database with our tables."""
    engine = open_engine(sqlite_url(tmp_path / "edge.sqlite3"))
    METADATA.create_all(engine)
    database = Database(engine)
    yield database
    database.close()


@pytest.mark.parametrize(
    ("pragma", "wanted"),
    [("journal_mode", "wal"), ("synchronous", 2), ("foreign_keys", 1), ("busy_timeout", 5000)],
)
def test_every_connection_has_our_pragmas(database: Database, pragma: str, wanted: object) -> None:
    with database.read() as connection:
        assert connection.execute(text(f"PRAGMA {pragma}")).scalar_one() == wanted


def test_a_failed_transaction_leaves_nothing(database: Database) -> None:
    def register_twice() -> None:
        with database.write() as connection:
            for _ in range(2):
                connection.execute(text("INSERT INTO vehicle VALUES (1, '{}', 0, 0)"))

    with pytest.raises(IntegrityError):
        register_twice()
    with database.read() as connection:
        assert connection.execute(text("SELECT count(*) FROM vehicle")).scalar_one() == 0


def test_what_one_writer_read_no_other_writer_changes(database: Database) -> None:
    with database.write() as connection:
        connection.execute(text("INSERT INTO vehicle VALUES (1, '0', 0, 0)"))

    def count_up() -> None:
        for _ in range(20):
            with database.write() as connection:
                seen = int(connection.execute(text("SELECT state FROM vehicle")).scalar_one())
                connection.execute(
                    text("UPDATE vehicle SET state = :state"), {"state": str(seen + 1)}
                )

    threads = [threading.Thread(target=count_up) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with database.read() as connection:
        assert connection.execute(text("SELECT state FROM vehicle")).scalar_one() == "80"


WORK = "work (kind, sequence_number, state, created_at, expires_at)"


@pytest.mark.parametrize(
    "row",
    [
        f"INSERT INTO {WORK} VALUES ('mission', 0, 'queued', 0, 0)",
        f"INSERT INTO {WORK} VALUES ('latest_state_vector', 0, 'lost', 0, 0)",
        "INSERT INTO outbox (record_id, vehicle_id, kind) VALUES (77, 1, 'pose')",
    ],
)
def test_impossible_rows_are_impossible(database: Database, row: str) -> None:
    with pytest.raises(IntegrityError), database.write() as connection:
        connection.execute(text(row))


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_nan_is_never_written(number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json({"number": number})
