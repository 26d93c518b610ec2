"""Key files: created once, readable by their owner, replaced by rotation."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.process import key_files
from edge_server.store import migrate
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine
from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role


@pytest.fixture
def config(tmp_path: Path) -> Config:
    """A state folder with a database and no keys."""
    config = Config(state_dir=tmp_path)
    migrate.prepare(config.database)
    return config


@pytest.fixture
def database(config: Config) -> Iterator[Database]:
    """The database."""
    database = Database(open_engine(config.database))
    yield database
    database.close()


def opens(database: Database, key: str | None) -> str | None:
    """Role of a key."""
    assert key is not None
    with database.read() as connection:
        for stored in keys.active(connection):
            if stored.sha256 == keys.digest(key):
                return stored.role
    return None


def test_every_role_gets_a_key_that_only_its_owner_can_read(
    config: Config, database: Database
) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    for role in Role:
        path = key_files.path_of(config.keys_dir, role)
        assert path.stat().st_mode & 0o777 == 0o600
        assert opens(database, key_files.read(path)) == role
    assert (
        len({key_files.path_of(config.keys_dir, role).read_text(encoding="ascii") for role in Role})
        == 5
    )


def test_keys_survive_a_restart(config: Config, database: Database) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    before = {path: path.read_text(encoding="ascii") for path in config.keys_dir.iterdir()}
    key_files.ensure(database, config.keys_dir, 1.0)
    assert {path: path.read_text(encoding="ascii") for path in config.keys_dir.iterdir()} == before


def test_a_new_database_adopts_the_keys_in_the_files(config: Config, database: Database) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    key = key_files.read(key_files.path_of(config.keys_dir, Role.BROKER))
    migrate.set_aside(config.database_path, "lost")
    migrate.prepare(config.database)
    new = Database(open_engine(config.database))
    key_files.ensure(new, config.keys_dir, 1.0)
    assert opens(new, key) == "broker"
    new.close()


def test_a_removed_file_is_not_written_again(config: Config, database: Database) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    path = key_files.path_of(config.keys_dir, Role.ADMIN)
    key = key_files.read(path)
    path.unlink()
    key_files.ensure(database, config.keys_dir, 1.0)
    assert not path.exists()
    assert opens(database, key) == "admin"


def test_rotation_revokes_the_old_key(config: Config, database: Database) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    path = key_files.path_of(config.keys_dir, Role.CLOUD)
    old = key_files.read(path)
    assert key_files.rotate(database, config.keys_dir, Role.CLOUD, 1.0) == path
    assert opens(database, old) is None
    assert opens(database, key_files.read(path)) == "cloud"
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.first_case
@pytest.mark.parametrize("content", [b"", b"hello", b"\xff\xfe", b"fm_00_00"])
def test_a_file_without_a_key_is_not_changed(
    config: Config, database: Database, content: bytes
) -> None:
    path = key_files.path_of(config.keys_dir, Role.FARMER)
    path.parent.mkdir()
    path.write_bytes(content)
    key_files.ensure(database, config.keys_dir, 0.0)
    assert path.read_bytes() == content
