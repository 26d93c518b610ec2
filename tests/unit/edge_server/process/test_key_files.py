"""Key files: created once, readable by their owner, replaced by rotation."""

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from unittest.mock import Mock

import pytest

from edge_server.config import Config
from edge_server.process import key_files
from edge_server.services.administration import keys as service
from edge_server.services.errors import ConflictError
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


class KilledError(BaseException):
    """Stands for the end of the process; no handler of an error runs as if it went on."""


STEPS = [
    (keys, "add"),
    (key_files, "_write_draft"),
    (service, "retire"),
    (key_files, "_put_in_place"),
]


@pytest.mark.parametrize("is_behind", [False, True], ids=["before", "behind"])
@pytest.mark.parametrize(("module", "step"), STEPS, ids=[step for _, step in STEPS])
@pytest.mark.parametrize("overlap_s", [0.0, 3600.0])
def test_an_interrupted_rotation_leaves_a_valid_key_and_the_next_one_ends_the_others(
    config: Config,
    database: Database,
    monkeypatch: pytest.MonkeyPatch,
    module: ModuleType,
    step: str,
    overlap_s: float,
    *,
    is_behind: bool,
) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    path = key_files.path_of(config.keys_dir, Role.BROKER)
    do = getattr(module, step)

    def be_killed(*arguments: object) -> None:
        if is_behind:
            do(*arguments)
        raise KilledError

    with monkeypatch.context() as patch:
        patch.setattr(module, step, be_killed)
        with pytest.raises(KilledError):
            key_files.rotate(database, config.keys_dir, Role.BROKER, 1.0, overlap_s)
    assert is_valid(database, key_files.read(path))
    key_files.ensure(database, config.keys_dir, 2.0)
    assert is_valid(database, key_files.read(path))
    key_files.rotate(database, config.keys_dir, Role.BROKER, 3.0)
    key = key_files.read(path)
    assert is_valid(database, key)
    with database.read() as connection:
        valid = [one for one in keys.active(connection) if one.role == "broker"]
    assert [one.sha256 for one in valid] == [keys.digest(key or "")]
    assert [one.name for one in valid] == ["broker"]


def is_valid(database: Database, key: str | None) -> bool:
    """Whether a key opens the broker's requests without an end."""
    with database.read() as connection:
        stored = keys.find(connection, keys.prefix_of(key or "") or "")
    return stored is not None and stored.is_valid(1e9)


def test_what_an_interrupted_rotation_has_left_is_named_at_the_start(
    config: Config,
    database: Database,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    key_files.ensure(database, config.keys_dir, 1.0)
    assert not caplog.records
    with monkeypatch.context() as patch:
        patch.setattr(key_files, "_put_in_place", Mock(side_effect=KilledError))
        with pytest.raises(KilledError):
            key_files.rotate(database, config.keys_dir, Role.BROKER, 1.0)
    (left,) = [one for one in everything(database) if one.created_at == 1.0]
    key_files.ensure(database, config.keys_dir, 2.0)
    assert f"`keys revoke {left.prefix}`" in caplog.text


def everything(database: Database) -> list[keys.StoredKey]:
    """All keys of the database."""
    with database.read() as connection:
        return keys.everything(connection)


def test_of_two_rotations_at_once_one_gives_way(
    config: Config, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    key_files.ensure(database, config.keys_dir, 0.0)
    path = key_files.path_of(config.keys_dir, Role.CLOUD)
    write_draft = key_files._write_draft

    def write_draft_of_another(path: Path, key: str) -> None:
        write_draft(path, key)
        write_draft(path, keys.generate())

    with monkeypatch.context() as patch:
        patch.setattr(key_files, "_write_draft", write_draft_of_another)
        with pytest.raises(ConflictError, match="somebody else"):
            key_files.rotate(database, config.keys_dir, Role.CLOUD, 1.0)
    assert opens(database, key_files.read(path)) == "cloud"


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
