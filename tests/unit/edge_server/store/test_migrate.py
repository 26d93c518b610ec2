"""The database's shape: made, kept, taken back, refused, set aside."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import CheckConstraint, Engine, inspect, text

from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.store import migrate
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine, sqlite_url
from edge_server.store.migrations import partial_indexes  # noqa: F401  # they complete METADATA
from edge_server.store.rows import plans, telemetry, vehicles, work
from edge_server.store.rows.plans import StoredPlan
from edge_server.store.rows.tables import METADATA
from tests.support.databases import BOTH_ENGINES, PostgresServer, count_outbox
from tests.unit.edge_server import documents


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a database will be."""
    return tmp_path / "edge" / "edge.sqlite3"


@pytest.fixture
def url(engine_name: str, path: Path, request: pytest.FixtureRequest) -> Iterator[str]:
    """URL of a database that holds nothing at all."""
    if engine_name == "sqlite":
        yield sqlite_url(path)
        return
    server: PostgresServer = request.getfixturevalue("postgres")
    name = server.create()
    yield server.url(name)
    server.drop(name)


@pytest.fixture
def engine(url: str) -> Iterator[Engine]:
    """A database at the newest shape."""
    migrate.prepare(url)
    engine = open_engine(url)
    yield engine
    engine.dispose()


def fill(engine: Engine) -> None:
    """Put a row into every table that people care for."""
    with Database(engine).write() as connection:
        vehicles.put(connection, 1, {"link_state": "connected"}, 0.0)
        plan_row = plans.add(connection, StoredPlan(0, "0" * 26, {}, 0.0, 9.0, []))
        body = documents.mission()
        work.add_mission(connection, plan_row=plan_row, body=body, now=0.0, expires_at=9.0)
        record_id = telemetry.add(
            connection,
            kind="pose",
            vehicle_id=1,
            message_id="0" * 26,
            payload="{}",
            received_at=0.0,
        )
        queue.enqueue(connection, record_id, Stream(1, "pose"))


@pytest.mark.first_case
@BOTH_ENGINES
def test_the_migrations_make_what_the_code_uses(engine: Engine) -> None:
    with engine.connect() as connection:
        found = compare_metadata(MigrationContext.configure(connection), METADATA)
    assert found == []


@pytest.mark.first_case
@BOTH_ENGINES
def test_constraints_are_in_the_migrated_database(engine: Engine) -> None:
    inspector = inspect(engine)
    for table in METADATA.tables.values():
        wanted = {
            str(check.name).removeprefix(f"ck_{table.name}_")
            for check in table.constraints
            if isinstance(check, CheckConstraint)
        }
        made = {
            str(check["name"]).removeprefix(f"ck_{table.name}_")
            for check in inspector.get_check_constraints(table.name)
        }
        assert made == wanted, table.name


@pytest.mark.first_case
@BOTH_ENGINES
def test_down_and_up_again_on_a_filled_database(engine: Engine) -> None:
    fill(engine)
    migrate.migrate(engine, "base")
    assert set(inspect(engine).get_table_names()) <= {"alembic_version", "sqlite_sequence"}
    assert migrate.revision(engine) is None
    migrate.migrate(engine, migrate.HEAD)
    assert migrate.revision(engine) == migrate.HEAD
    fill(engine)


@pytest.mark.first_case
@BOTH_ENGINES
def test_preparing_again_keeps_what_is_there(url: str, engine: Engine) -> None:
    fill(engine)
    migrate.prepare(url)
    with Database(engine).read() as connection:
        assert count_outbox(connection) == 1


@pytest.mark.first_case
@BOTH_ENGINES
def test_programs_that_start_together_make_one_database(url: str, path: Path) -> None:
    with ThreadPoolExecutor(4) as together:
        list(together.map(migrate.prepare, [url] * 4))
    assert migrate.is_ready(url)
    assert not (path.parent / "quarantine").exists()


@pytest.mark.parametrize("engine_name", ["postgresql"], indirect=True)
def test_a_newer_database_of_a_server_is_not_touched(url: str, engine: Engine) -> None:
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    assert not migrate.is_ready(url)
    with pytest.raises(migrate.NewerDatabaseError):
        migrate.prepare(url)
    assert migrate.revision(engine) == "9999"


def test_a_database_that_cannot_hold_every_letter_is_refused(postgres: PostgresServer) -> None:
    postgres.administer("CREATE DATABASE narrow TEMPLATE template0 ENCODING 'LATIN1' LOCALE 'C'")
    with pytest.raises(migrate.StoreError, match="LATIN1"):
        migrate.prepare(postgres.url("narrow"))


def test_a_server_that_does_not_answer_is_told_without_the_password() -> None:
    url = "postgresql+psycopg://edge:s3cret@127.0.0.1:9/edge"
    with pytest.raises(migrate.StoreError) as caught:
        migrate.prepare(url)
    assert "127.0.0.1" in str(caught.value)
    assert "s3cret" not in str(caught.value)


def test_a_newer_database_is_not_touched(path: Path, engine: Engine) -> None:
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    engine.dispose()
    before = path.read_bytes()
    assert not migrate.is_ready(sqlite_url(path))
    with pytest.raises(migrate.NewerDatabaseError):
        migrate.prepare(sqlite_url(path))
    assert path.read_bytes() == before


def test_a_missing_database_is_not_ready(path: Path) -> None:
    assert not migrate.is_ready(sqlite_url(path))
    assert not path.exists()
    migrate.prepare(sqlite_url(path))
    assert migrate.is_ready(sqlite_url(path))


@pytest.mark.first_case
@pytest.mark.parametrize("start", [0, 100, 4096])
def test_telegraf18528_flipped_bytes_go_to_quarantine(path: Path, start: int) -> None:
    migrate.prepare(sqlite_url(path))
    spoiled = bytearray(path.read_bytes())
    spoiled[start : start + 2000] = b"\xa5" * 2000
    path.write_bytes(spoiled)
    migrate.prepare(sqlite_url(path))
    assert migrate.is_ready(sqlite_url(path))
    (kept,) = (path.parent / "quarantine").iterdir()
    assert kept.read_bytes() == bytes(spoiled)


def test_telegraf18528_a_truncated_file_goes_to_quarantine(path: Path) -> None:
    migrate.prepare(sqlite_url(path))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    migrate.prepare(sqlite_url(path))
    assert migrate.is_ready(sqlite_url(path))
    assert len(list((path.parent / "quarantine").iterdir())) == 1


def test_two_quarantines_in_one_second_are_both_kept(path: Path) -> None:
    for number in range(2):
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"broken {number}", encoding="ascii")
        migrate.set_aside(path, "now")
    assert len(list((path.parent / "quarantine").iterdir())) == 2
