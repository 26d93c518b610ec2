"""Integrity and presence of the database file are checked while the server runs."""

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text

from edge_server.process import housekeeping
from edge_server.store import migrate
from edge_server.store.connection.engines import open_engine, sqlite_url
from edge_server.store.files import integrity
from tests.support.polling import PATIENCE_S
from tests.unit.edge_server.conftest import Edge


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A database with a table of many pages."""
    path = tmp_path / "edge" / "edge.sqlite3"
    migrate.prepare(sqlite_url(path))
    engine = open_engine(sqlite_url(path))
    with engine.begin() as connection:
        connection.execute(text("CREATE TABLE filler (content TEXT)"))
        for _ in range(100):
            connection.execute(text("INSERT INTO filler VALUES (hex(randomblob(2000)))"))
    engine.dispose()
    return path


def spoil_the_middle(path: Path) -> None:
    content = bytearray(path.read_bytes())
    middle = len(content) // 2 // 4096 * 4096
    content[middle : middle + 4096] = b"\xa5" * 4096
    path.write_bytes(content)


def test_an_intact_file_has_no_fault(path: Path) -> None:
    assert integrity.fault_of(path) is None
    housekeeping.check_file(path)
    assert integrity.noted_fault(path) is None


def test_a_fault_deep_in_the_file_is_noted_and_the_next_start_quarantines_it(path: Path) -> None:
    spoil_the_middle(path)
    housekeeping.check_file(path)
    assert integrity.noted_fault(path)
    assert not migrate.is_ready(sqlite_url(path))
    migrate.prepare(sqlite_url(path))
    assert integrity.noted_fault(path) is None
    assert migrate.is_ready(sqlite_url(path))
    assert list((path.parent / "quarantine").glob("*.sqlite3"))


def test_a_missing_file_is_not_created(tmp_path: Path) -> None:
    housekeeping.check_file(tmp_path / "edge.sqlite3")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.first_case
@pytest.mark.parametrize(
    "harm",
    [
        pytest.param(lambda path: integrity.note_fault(path, "row 7 missing"), id="a noted fault"),
        pytest.param(lambda path: path.rename(path.with_suffix(".old")), id="a file taken away"),
    ],
)
def test_the_server_is_restarted(
    edge: Edge, harm: Callable[[Path], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(housekeeping, "FILE_CHECK_AFTER_S", 0.0)
    monkeypatch.setattr(housekeeping, "FILE_LOOK_S", 0.01)
    asked, stopping = threading.Event(), threading.Event()
    watch = threading.Thread(
        target=housekeeping.watch_file, args=(edge.context, stopping, asked.set)
    )
    watch.start()
    assert not asked.wait(0.1)
    harm(edge.config.database_path)
    assert asked.wait(PATIENCE_S)
    watch.join()
    stopping.set()


def test_it_ends_with_the_server(edge: Edge) -> None:
    stopping = threading.Event()
    stopping.set()
    housekeeping.watch_file(edge.context, stopping, lambda: pytest.fail("nothing is wrong"))
