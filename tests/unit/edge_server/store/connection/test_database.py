"""Transactions: durable, exclusive where they must be, all or nothing; on each engine."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError, IntegrityError

from edge_server.store.connection import failures, locks
from edge_server.store.connection.database import Database, Topic, to_json
from edge_server.store.connection.engines import SESSION, open_engine
from edge_server.store.connection.locks import WORK
from tests.support.databases import BOTH_ENGINES, PostgresServer
from tests.support.system import wait_for

ON_POSTGRESQL = pytest.mark.parametrize("engine_name", ["postgresql"], indirect=True)
ON_SQLITE = pytest.mark.parametrize("engine_name", ["sqlite"], indirect=True)


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    """A database with our tables."""
    database = Database(open_engine(database_url))
    yield database
    database.close()


@pytest.mark.first_case
@ON_SQLITE
@pytest.mark.parametrize(
    ("pragma", "wanted"),
    [("journal_mode", "wal"), ("synchronous", 2), ("foreign_keys", 1), ("busy_timeout", 5000)],
)
def test_every_connection_has_our_pragmas(database: Database, pragma: str, wanted: object) -> None:
    with database.read() as connection:
        assert connection.execute(text(f"PRAGMA {pragma}")).scalar_one() == wanted


@ON_POSTGRESQL
def test_every_session_has_our_settings(database: Database) -> None:
    with database.write() as connection:
        rows = connection.execute(
            text("SELECT name, setting || coalesce(unit, '') FROM pg_settings")
        )
        found = {row[0]: row[1] for row in rows}
    assert found["synchronous_commit"] == "on"
    assert found["lock_timeout"] == "5000ms"
    assert all(name in found for name in SESSION)


@ON_POSTGRESQL
def test_a_reader_sees_one_state(database: Database) -> None:
    with database.read() as reading:
        before = reading.execute(text("SELECT count(*) FROM vehicle")).scalar_one()
        with database.write() as writing:
            writing.execute(text("INSERT INTO vehicle VALUES (1, '{}', 0, 0)"))
        assert reading.execute(text("SELECT count(*) FROM vehicle")).scalar_one() == before
        with pytest.raises(DBAPIError, match="read-only"):
            reading.execute(text("DELETE FROM vehicle"))


@ON_SQLITE
def test_a_writer_within_a_writer_is_an_error_and_waits_for_nobody(database: Database) -> None:
    with (
        database.write(),
        pytest.raises(RuntimeError, match="within another"),
        database.write(),
    ):
        pytest.fail("two writers at once")
    with database.write() as connection:
        connection.execute(text("CREATE TABLE afterwards (id INTEGER)"))


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_failed_transaction_leaves_nothing(database: Database) -> None:
    def register_twice() -> None:
        with database.write() as connection:
            for _ in range(2):
                connection.execute(text("INSERT INTO vehicle VALUES (1, '{}', 0, 0)"))

    with pytest.raises(IntegrityError):
        register_twice()
    with database.read() as connection:
        assert connection.execute(text("SELECT count(*) FROM vehicle")).scalar_one() == 0


@pytest.mark.first_case
@BOTH_ENGINES
def test_what_one_writer_read_under_a_lock_no_other_writer_changes(database: Database) -> None:
    with database.write() as connection:
        connection.execute(text("INSERT INTO vehicle VALUES (1, '0', 0, 0)"))

    def count_up(_: int) -> None:
        for _ in range(20):
            with database.write(WORK) as connection:
                seen = int(connection.execute(text("SELECT state FROM vehicle")).scalar_one())
                connection.execute(
                    text("UPDATE vehicle SET state = :state"), {"state": str(seen + 1)}
                )

    with ThreadPoolExecutor(4) as together:
        list(together.map(count_up, range(4)))
    with database.read() as connection:
        assert connection.execute(text("SELECT state FROM vehicle")).scalar_one() == "80"


@ON_POSTGRESQL
def test_a_lock_is_free_again_when_its_transaction_ends(database: Database) -> None:
    for _ in range(2):
        with database.write(WORK) as connection:
            locks.take(connection, [WORK])  # Held already: costs nothing
            with database.write(locks.of_vehicle(1)):
                pass  # Another lock is another's


@pytest.mark.thorough
@ON_POSTGRESQL
def test_writers_that_wait_for_each_other_are_told_apart(database: Database) -> None:
    """One of them is beaten and may try again; neither waits for ever."""
    both_hold = threading.Barrier(2)

    def cross(first: int) -> str:
        try:
            with database.write(locks.of_vehicle(first)) as connection:
                both_hold.wait()
                locks.take(connection, [locks.of_vehicle(3 - first)])
        except DBAPIError as error:
            kinds = failures.is_conflict(error), failures.is_busy(error), failures.is_lost(error)
            return "beaten" if kinds == (True, True, False) else repr(error)
        return "done"

    with ThreadPoolExecutor(2) as together:
        assert sorted(together.map(cross, [1, 2])) == ["beaten", "done"]


@ON_POSTGRESQL
def test_a_lock_that_is_held_too_long_is_a_busy_database(database: Database) -> None:
    with database.write(WORK), database.engine.connect() as other:
        other.execute(text("SET lock_timeout = '50ms'"))
        with pytest.raises(DBAPIError) as caught:
            locks.take(other, [WORK])
    assert failures.is_busy(caught.value)
    assert not failures.is_conflict(caught.value)


@ON_POSTGRESQL
def test_a_session_that_is_cut_is_a_lost_database_and_the_next_one_is_not(
    database: Database,
) -> None:
    cut = text("SELECT pg_terminate_backend(pg_backend_pid())")
    with pytest.raises(DBAPIError) as caught, database.write() as connection:
        connection.execute(cut)
    assert failures.is_lost(caught.value)
    with database.read() as connection:
        assert connection.execute(text("SELECT 1")).scalar_one() == 1


def test_a_server_that_is_not_there_is_a_lost_database(postgres: PostgresServer) -> None:
    database = Database(open_engine(postgres.url("nothing").replace("edge-pg-", "nobody-")))
    with pytest.raises(DBAPIError) as caught, database.read() as connection:
        connection.execute(text("SELECT 1"))
    assert failures.is_lost(caught.value)
    assert not failures.is_full(caught.value)
    database.close()


WORK_COLUMNS = "work (kind, sequence_number, state, created_at, expires_at)"


@pytest.mark.first_case
@BOTH_ENGINES
@pytest.mark.parametrize(
    "row",
    [
        f"INSERT INTO {WORK_COLUMNS} VALUES ('mission', 0, 'queued', 0, 0)",
        f"INSERT INTO {WORK_COLUMNS} VALUES ('latest_state_vector', 0, 'lost', 0, 0)",
        "INSERT INTO outbox (record_id, vehicle_id, kind) VALUES (77, 1, 'pose')",
    ],
)
def test_impossible_rows_are_impossible(database: Database, row: str) -> None:
    with pytest.raises(IntegrityError), database.write() as connection:
        connection.execute(text(row))


@ON_POSTGRESQL
def test_a_notice_reaches_who_listens_and_comes_after_what_it_tells_of(
    database: Database, database_url: str
) -> None:
    heard: list[str] = []
    other = Database(open_engine(database_url))
    other.listen(heard.append)
    wait_for(lambda: Topic.WORK in heard, "the first look")
    heard.clear()
    database.announce(Topic.DUE)
    database.announce(Topic.WORK)
    wait_for(lambda: {*heard} == {Topic.DUE, Topic.WORK}, "word of both")
    other.close()


@pytest.mark.thorough
@ON_POSTGRESQL
def test_who_listens_hears_again_after_the_server_was_away(
    database: Database, database_url: str, postgres: PostgresServer
) -> None:
    heard: list[str] = []
    other = Database(open_engine(database_url))
    other.listen(heard.append)
    wait_for(lambda: Topic.WORK in heard, "the first look")
    heard.clear()
    postgres.administer(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query LIKE 'LISTEN%'"
    )
    wait_for(lambda: Topic.WORK in heard, "a look after the gap")
    heard.clear()
    wait_for(_hears(database, heard), "a notice after the gap")
    other.close()


def _hears(database: Database, heard: list[str]) -> Callable[[], bool]:
    def answer() -> bool:
        database.announce(Topic.DUE)
        return Topic.DUE in heard

    return answer


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_nan_is_never_written(number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json({"number": number})
