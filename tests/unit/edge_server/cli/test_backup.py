"""A copy of the database while it is in use."""

import base64
import sqlite3
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import requests

from edge_server.__main__ import main
from edge_server.cli import backup
from edge_server.cli.backup import RestoreError, restore
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.store.files import backup as files_backup
from edge_server.store.files.backup import BackupError, back_up
from edge_server.store.files.restored_work import hold_missions
from tests.support.polling import PATIENCE_S
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, mission_report, plan, telemetry
from tests.unit.edge_server.program import Program

NEW_YEAR_2026 = 1_767_225_600.0
POSTGRESQL = "postgresql+psycopg://edge:s3cret@db.example/edge"


def poses_in(copy: Path) -> int:
    with sqlite3.connect(copy) as connection:
        return int(connection.execute("SELECT count(*) FROM telemetry").fetchone()[0])


def test_a_backup_holds_what_was_acknowledged(edge: Edge, tmp_path: Path) -> None:
    edge.report("pose", telemetry("pose"))
    copy = tmp_path / "copy.sqlite3"
    size = back_up(edge.config.database_path, copy)
    assert size == copy.stat().st_size
    assert stat.S_IMODE(copy.stat().st_mode) == 0o600
    assert poses_in(copy) == 1
    edge.report("pose", telemetry("pose", 1))
    assert poses_in(copy) == 1


@pytest.mark.thorough
def test_a_large_backup_ends_though_reports_come_in_all_the_time(
    edge: Edge, tmp_path: Path
) -> None:
    """Larger than SQLite copies in one step of ours; it would begin again at every commit."""
    for number in range(20):
        edge.report("image", telemetry("image", number) | picture(600_000))
    stop = threading.Event()

    def write() -> None:
        with closing(sqlite3.connect(edge.config.database_path, timeout=30.0)) as connection:
            while not stop.wait(0.002):
                connection.execute(
                    "UPDATE telemetry SET received_at = received_at + 1 WHERE id = 1"
                )
                connection.commit()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        copy = tmp_path / "copy.sqlite3"
        assert back_up(edge.config.database_path, copy) > 12_000_000
    finally:
        stop.set()
        writer.join()


def picture(size: int) -> dict[str, object]:
    jpeg = b"\xff\xd8\xff" + bytes(size) + b"\xff\xd9"
    return {"frame": base64.b64encode(jpeg).decode(), "image_size": len(jpeg)}


def test_a_backup_is_of_one_moment_though_reports_come_in(edge: Edge, tmp_path: Path) -> None:
    stop = threading.Event()

    def write() -> None:
        number = 0
        while not stop.is_set():
            edge.report("pose", telemetry("pose", number))
            number += 1

    writer = threading.Thread(target=write)
    writer.start()
    try:
        copies = [tmp_path / f"{number}.sqlite3" for number in range(5)]
        for copy in copies:
            back_up(edge.config.database_path, copy)
    finally:
        stop.set()
        writer.join()
    for copy in copies:
        with sqlite3.connect(copy) as connection:
            (orphans,) = connection.execute(
                "SELECT count(*) FROM telemetry LEFT JOIN outbox ON record_id = telemetry.id "
                "WHERE outbox.id IS NULL"
            ).fetchone()
        assert orphans == 0


def test_a_backup_overwrites_nothing(edge: Edge, tmp_path: Path) -> None:
    copy = tmp_path / "copy.sqlite3"
    copy.write_text("mine")
    with pytest.raises(BackupError, match="exists"):
        back_up(edge.config.database_path, copy)
    assert copy.read_text() == "mine"


def test_a_failed_backup_leaves_nothing(edge: Edge, tmp_path: Path) -> None:
    with pytest.raises(BackupError, match="cannot write"):
        back_up(edge.config.database_path, tmp_path / "missing" / "copy.sqlite3")
    broken = tmp_path / "broken.sqlite3"
    broken.write_bytes(b"no database at all" * 100)
    with pytest.raises(BackupError, match="cannot write"):
        back_up(broken, tmp_path / "copy.sqlite3")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.sqlite3", "state"]
    with pytest.raises(BackupError, match="no database"):
        back_up(tmp_path / "none", tmp_path / "copy.sqlite3")


@pytest.mark.parametrize("suffix", ["-journal", "-wal", "-shm"])
def test_a_failed_backup_leaves_no_file_of_sqlite(
    edge: Edge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    def fail(_database: Path, part: Path) -> None:
        part.with_name(part.name + suffix).touch()
        raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr(files_backup, "_copy", fail)
    with pytest.raises(BackupError, match="disk I/O error"):
        back_up(edge.config.database_path, tmp_path / "copy.sqlite3")
    assert [path.name for path in tmp_path.iterdir()] == ["state"]


def test_of_backups_at_once_to_one_file_one_is_made_and_the_others_say_why(
    edge: Edge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    edge.report("pose", telemetry("pose"))
    target = tmp_path / "copy.sqlite3"
    together = threading.Barrier(3, timeout=PATIENCE_S)
    copy = files_backup._copy
    ends: list[str] = []

    def copy_together(database: Path, part: Path) -> None:
        together.wait()
        copy(database, part)
        together.wait()

    def make() -> None:
        try:
            back_up(edge.config.database_path, target)
            ends.append("made")
        except BackupError as error:
            ends.append(str(error))

    monkeypatch.setattr(files_backup, "_copy", copy_together)
    threads = [threading.Thread(target=make) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    quicker = f"{target} has been made by another backup meanwhile; a backup overwrites nothing"
    assert sorted(ends) == sorted(["made", quicker, quicker])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy.sqlite3", "state"]
    assert poses_in(target) == 1


def test_a_database_of_a_server_is_pg_dumps_business(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy"
    assert main(["--database-url", POSTGRESQL, "backup", str(copy)]) == WRONG_SETUP
    said = capsys.readouterr().err
    assert "pg_dump" in said
    assert "s3cret" not in said
    assert not copy.exists()


def test_in_a_folder_the_newest_backups_stay(
    edge: Edge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "backups"
    folder.mkdir()
    (folder / "mine.sqlite3").write_text("mine")
    for second in range(4):
        monkeypatch.setattr(time, "time", lambda at=second: NEW_YEAR_2026 + at)
        assert backup.run(edge.config, folder, keep=2) == OK
    assert sorted(path.name for path in folder.iterdir()) == [
        "edge-20260101T000002Z.sqlite3",
        "edge-20260101T000003Z.sqlite3",
        "mine.sqlite3",
    ]


def test_a_folder_that_does_not_exist_does_not_become_a_file(
    edge: Edge, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Such a file would stand in the way of every later backup into that folder."""
    state = ("--state-dir", str(edge.config.state_dir))
    folder = tmp_path / "backups"
    with pytest.raises(SystemExit) as ended:
        main([*state, "backup", f"{folder}/"])
    assert ended.value.code == WRONG_SETUP
    assert f"there is no folder {folder}/" in capsys.readouterr().err
    assert not folder.exists()
    folder.mkdir()
    assert main([*state, "backup", f"{folder}/"]) == OK
    assert len(list(folder.iterdir())) == 1


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Program]:
    program = Program(tmp_path / "state", "http://127.0.0.1:9")
    yield program
    if program.process is not None:
        program.end()


def command(program: Program, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "edge_server", *arguments],
        env=program.environment,
        capture_output=True,
        text=True,
        check=False,
    )


def poses_kept(program: Program) -> int:
    answer = requests.get(
        f"{program.url}/pose/", headers={"X-API-Key": program.key("operator")}, timeout=PATIENCE_S
    )
    answer.raise_for_status()
    return len(answer.json())


def report_pose(program: Program, number: int) -> None:
    requests.post(
        f"{program.url}/pose/",
        json=telemetry("pose", number),
        headers={"X-API-Key": program.key("broker")},
        timeout=PATIENCE_S,
    ).raise_for_status()


def test_a_backup_is_restored_only_while_the_server_is_stopped(
    program: Program, tmp_path: Path
) -> None:
    copy = tmp_path / "copy.sqlite3"
    program.start()
    report_pose(program, 0)
    assert command(program, "backup", str(copy)).returncode == OK
    report_pose(program, 1)
    refused = command(program, "restore", str(copy))
    assert (refused.returncode, poses_kept(program)) == (FAILED, 2)
    assert "stop server and relay first" in refused.stderr
    program.end()
    assert command(program, "restore", str(copy)).returncode == OK
    program.start()
    assert poses_kept(program) == 1
    (former,) = (tmp_path / "state/edge/replaced").glob("*.sqlite3")
    assert poses_in(former) == 2


@pytest.mark.thorough
def test_an_upgrade_is_taken_back_by_the_backup_before_it(program: Program, tmp_path: Path) -> None:
    copy = tmp_path / "copy.sqlite3"
    program.start()
    report_pose(program, 0)
    assert command(program, "backup", str(copy)).returncode == OK
    program.end()
    database = tmp_path / "state/edge/edge.sqlite3"
    with closing(sqlite3.connect(database)) as upgraded, upgraded:
        upgraded.execute("UPDATE alembic_version SET version_num = '9999'")
    refused = command(program, "serve")
    assert refused.returncode == WRONG_SETUP
    assert "use a newer one" in refused.stderr
    assert command(program, "restore", str(copy)).returncode == OK
    program.start()
    assert poses_kept(program) == 1


@pytest.mark.parametrize("content", [b"", b"no database", None])
def test_what_is_no_backup_is_not_restored(
    content: bytes | None, edge: Edge, tmp_path: Path
) -> None:
    source = tmp_path / "source.sqlite3"
    if content is not None:
        source.write_bytes(content)
    edge.report("pose", telemetry("pose"))
    with pytest.raises(RestoreError, match=r"source\.sqlite3"):
        restore(edge.config.database_path, source)
    assert poses_in(edge.config.database_path) == 1


def test_after_a_restoration_nothing_flies_that_nobody_dispatches(
    edge: Edge, tmp_path: Path
) -> None:
    """Since the backup the first was cancelled, the second flown; the third had begun before."""
    edge.register(1, 2, 3)
    for number in (1, 2, 3):
        edge.post_plan(plan(mission(number, vehicle_id=number)))
    queued, accepted, begun = (item["id"] for item in edge.work())
    edge.acknowledge(accepted, "accepted")
    edge.acknowledge(begun, "accepted")
    edge.post("/mission_report/", mission_report(2, 2, 1, 1, mission_id=3, vehicle_id=3), "broker")
    copy = tmp_path / "copy.sqlite3"
    back_up(edge.config.database_path, copy)
    assert hold_missions(copy) == 2
    with closing(sqlite3.connect(copy)) as database:
        states = database.execute(
            "SELECT mission_id, state, held, id FROM work ORDER BY 1"
        ).fetchall()
        assert [state[:3] for state in states] == [
            (1, "queued", 1),
            (2, "queued", 1),
            (3, "accepted", 0),
        ]
        assert states[0][3] == queued
        assert states[1][3] > begun
        assert states[2][3] == begun
        commands = database.execute("SELECT work, count(*) FROM command GROUP BY 1").fetchall()
        assert len({count for _, count in commands}) == 1
        assert {number for number, _ in commands} == {state[3] for state in states}
        assert database.execute("SELECT work_id, mission_id FROM withdrawn").fetchall() == [
            (accepted, 2)
        ]
        assert database.execute("PRAGMA foreign_key_check").fetchall() == []
    assert hold_missions(copy) == 0


def test_a_restored_mission_flies_when_it_is_dispatched(program: Program, tmp_path: Path) -> None:
    def ask(
        method: str, path: str, role: str = "operator", body: object = None
    ) -> "requests.Response":
        return requests.request(
            method,
            f"{program.url}{path}",
            json=body,
            headers={"X-API-Key": program.key(role)},
            timeout=PATIENCE_S,
        )

    def offered() -> list[int]:
        found = ask("GET", "/broker/commands?after=0", "broker").json()["commands"]
        return [item["mission"]["mission_id"] for item in found]

    program.start()
    ask("PUT", "/vehicles/1", "broker", {"link_state": "connected"}).raise_for_status()
    stored = ask("POST", "/plans/", body=plan(mission(7))).json()
    copy = tmp_path / "copy.sqlite3"
    assert command(program, "backup", str(copy)).returncode == OK
    assert ask("DELETE", f"/plans/{stored['id']}").status_code == 204
    program.end()
    restored = command(program, "restore", str(copy))
    assert "1 missions that had not begun are held" in restored.stdout
    program.start()
    assert offered() == []
    assert ask("POST", f"/plans/{stored['id']}/dispatch").status_code == 200
    assert offered() == [7]
