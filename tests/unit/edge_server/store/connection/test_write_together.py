"""Pieces of work that share a commit: all of each happens, or nothing of it."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from sqlalchemy import Connection, event, text

from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine, sqlite_url


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """A database with one empty table."""
    database = Database(open_engine(sqlite_url(tmp_path / "edge.sqlite3")))
    with database.write() as connection:
        connection.execute(text("CREATE TABLE kept (number INTEGER PRIMARY KEY)"))
    yield database
    database.close()


def put(number: int) -> Callable[[Connection], int]:
    def work(connection: Connection) -> int:
        connection.execute(text("INSERT INTO kept VALUES (:number)"), {"number": number})
        return number

    return work


def put_and_fail(number: int) -> Callable[[Connection], int]:
    def work(connection: Connection) -> int:
        put(number)(connection)
        raise LookupError(number)

    return work


def kept(database: Database) -> list[int]:
    with database.read() as connection:
        rows = connection.execute(text("SELECT number FROM kept ORDER BY number"))
        return [row[0] for row in rows]


def test_work_alone_is_kept_when_it_returns(database: Database) -> None:
    assert database.write_together(put(7)) == 7
    assert kept(database) == [7]


def test_work_of_one_moment_shares_commits(database: Database) -> None:
    commits: list[Connection] = []
    event.listen(database.engine, "commit", commits.append)
    with ThreadPoolExecutor(32) as pool:
        with database.write():  # Meanwhile all the others queue up
            results = [pool.submit(database.write_together, put(n)) for n in range(32)]
            while len(database._jobs) < 32:
                threading.Event().wait(0.001)
        assert [result.result() for result in results] == list(range(32))
    assert kept(database) == list(range(32))
    assert len(commits) == 2


def test_a_failure_is_one_callers_own(database: Database) -> None:
    works = [put_and_fail(n) if n % 5 == 0 else put(n) for n in range(20)]
    with ThreadPoolExecutor(20) as pool:
        with database.write():
            results = [pool.submit(database.write_together, work) for work in works]
            while len(database._jobs) < 20:
                threading.Event().wait(0.001)
        for number, result in enumerate(results):
            if number % 5 == 0:
                with pytest.raises(LookupError):
                    result.result()
            else:
                assert result.result() == number
    assert kept(database) == [n for n in range(20) if n % 5]


def test_a_failure_alone_leaves_nothing(database: Database) -> None:
    with pytest.raises(LookupError):
        database.write_together(put_and_fail(1))
    assert kept(database) == []
    assert database.write_together(put(1)) == 1


@pytest.mark.thorough
def test_more_writers_than_a_group_takes_are_all_answered(database: Database) -> None:
    """Behind a group that fails comes another one, with the rest."""
    number = 3 * 64 + 5
    works = [put_and_fail(n) if n % 50 == 0 else put(n) for n in range(number)]
    with ThreadPoolExecutor(number) as pool:
        with database.write():  # Meanwhile all the others queue up
            results = [pool.submit(database.write_together, work) for work in works]
            while len(database._jobs) < number:
                threading.Event().wait(0.001)
        for n, result in enumerate(results):
            if n % 50 == 0:
                with pytest.raises(LookupError):
                    result.result()
            else:
                assert result.result() == n
    assert kept(database) == [n for n in range(number) if n % 50]
