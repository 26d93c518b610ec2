"""An administrator makes backups and sees which there are."""

import errno
import shutil
import sqlite3
import stat
import threading
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import Mock

import pytest

from edge_server.config import Config
from edge_server.services.administration import backups
from edge_server.store.files import backup
from tests.unit.edge_server.cli.test_backup import poses_in
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import telemetry


def make(edge: Edge, role: str = "admin") -> Any:
    edge.clock.pass_s(1.0)  # They are named by the second
    return edge.ask("POST", "/backups/", role)


def test_a_backup_is_made_and_listed(edge: Edge) -> None:
    assert edge.get("/backups/", "admin")["backups"] == []
    edge.report("pose", telemetry("pose"))
    answer = make(edge)
    assert answer.status_code == 201, answer.json
    path = Path(answer.json["path"])
    assert path.parent == edge.config.backups_dir
    assert poses_in(path) == 1
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert answer.json["size_bytes"] == path.stat().st_size
    found = edge.get("/backups/", "admin")
    assert found["backups"] == [answer.json]
    assert (found["folder"], found["fault"]) == (str(edge.config.backups_dir), None)
    log = edge.ask("GET", "/audit", "admin").get_data(as_text=True)
    assert f"backups/{path.name}" in log


def test_the_newest_is_first_and_the_oldest_go(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backups, "KEPT", 2)
    names = [make(edge).json["name"] for _ in range(3)]
    (edge.config.backups_dir / "mine.sqlite3").write_bytes(b"")
    listed = [one["name"] for one in edge.get("/backups/", "admin")["backups"]]
    assert listed == [names[2], names[1]]
    assert (edge.config.backups_dir / "mine.sqlite3").exists()


@pytest.mark.parametrize("role", ["farmer", "operator", "broker", "cloud"])
def test_backups_are_for_administrators(edge: Edge, role: str) -> None:
    assert edge.ask("GET", "/backups/", role).status_code == 403
    assert make(edge, role).status_code == 403
    assert not edge.config.backups_dir.exists()


def test_one_is_made_at_a_time(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on = threading.Event(), threading.Event()
    whole = backup.back_up

    def slowly(database: Path, target: Path) -> int:
        begun.set()
        assert go_on.wait(30.0)
        return whole(database, target)

    monkeypatch.setattr(backup, "back_up", slowly)
    first: list[int] = []
    thread = threading.Thread(target=lambda: first.append(backups.make(edge.context)["size_bytes"]))
    thread.start()
    assert begun.wait(30.0)
    assert make(edge).status_code == 429
    go_on.set()
    thread.join()
    assert first[0] > 0
    assert make(edge).status_code == 201


class Disk(NamedTuple):
    total: int
    used: int
    free: int


def test_a_full_disk_is_left_alone(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(10**9, 9 * 10**8, 10**8))
    answer = make(edge)
    assert answer.status_code == 507
    assert "MiB of free disk" in answer.json["message"]
    assert list(edge.config.backups_dir.iterdir()) == []


def full_for_sqlite() -> sqlite3.OperationalError:
    error = sqlite3.OperationalError("database or disk is full")
    error.sqlite_errorcode = sqlite3.SQLITE_FULL
    return error


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 507),
        (OSError(errno.EDQUOT, "Disk quota exceeded"), 507),
        (OSError(errno.EIO, "Input/output error"), 503),
        (full_for_sqlite(), 507),
        (sqlite3.OperationalError("disk I/O error"), 503),
    ],
)
def test_a_disk_that_fills_up_meanwhile_is_full(
    edge: Edge, monkeypatch: pytest.MonkeyPatch, error: Exception, status: int
) -> None:
    monkeypatch.setattr(backup, "_copy", Mock(side_effect=error))
    answer = make(edge)
    assert answer.status_code == status
    assert str(error) in answer.json["message"]
    assert list(edge.config.backups_dir.iterdir()) == []


def test_a_disk_that_is_too_full_for_the_folder_is_full(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    error = OSError(errno.ENOSPC, "No space left on device")
    monkeypatch.setattr(Path, "mkdir", Mock(side_effect=error))
    assert make(edge).status_code == 507


def test_a_folder_that_cannot_be_written_is_named(edge: Edge) -> None:
    edge.config.backups_dir.write_bytes(b"a file in its place")
    answer = make(edge)
    assert answer.status_code == 503
    assert "backups" in answer.json["message"]


def test_the_folder_is_a_setting(tmp_path: Path) -> None:
    assert Config(state_dir=tmp_path).backups_dir == tmp_path / "backups"
    assert Config(backups_folder=tmp_path / "disk").backups_dir == tmp_path / "disk"
