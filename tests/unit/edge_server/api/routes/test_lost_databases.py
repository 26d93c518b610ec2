"""After the loss of a database, or of a part, work is not taken for other work of the same id."""

import json
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from edge_server.app import context_of, create_app
from edge_server.process import housekeeping
from edge_server.process.preparation import prepare
from edge_server.services import audit
from edge_server.store.files import high_water
from edge_server.store.files.tally import Tally
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, mission, mission_report, plan

PAGE = 4096


def restarted_after(edge: Edge, spoil: Callable[[Path], None]) -> Edge:
    """Stop the edge server, spoil its database, and start it again."""
    edge.context.database.close()
    spoil(edge.config.database_path)
    prepare(edge.config)
    app = create_app(edge.config, clock=edge.clock)
    started = Edge(app.test_client(), context_of(app), edge.clock)
    started.register(1, 2)
    return started


def overwrite(table: str) -> Callable[[Path], None]:
    """Make a change of a file that loses the only page of a table."""

    def spoil(path: Path) -> None:
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            query = "SELECT rootpage FROM sqlite_master WHERE name = ?"
            (page,) = connection.execute(query, (table,)).fetchone()
        content = bytearray(path.read_bytes())
        content[(page - 1) * PAGE : page * PAGE] = b"\xa5" * PAGE
        path.write_bytes(content)

    return spoil


@pytest.mark.first_case
@pytest.mark.parametrize("table", ["plan", "audit_chain", "sqlite_sequence"])
def test_after_a_damage_plans_and_aborts_are_taken_and_audited(edge: Edge, table: str) -> None:
    edge.post_plan(plan(mission(1)))
    started = restarted_after(edge, overwrite(table))
    assert started.post_plan(plan(mission(2))).status_code == 201
    assert started.post("/events/", event(1), "operator").status_code == 201
    lines = started.ask("GET", "/audit/", "admin").text.splitlines()
    assert [json.loads(line)["id"] for line in lines] == [1, 2, 3]
    assert audit.verify(started.context.database).fault is None
    started.context.database.close()


def test_after_lost_rows_of_the_audit_log_other_things_are_still_forgotten(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    started = restarted_after(edge, overwrite("audit"))
    assert started.post_plan(plan(mission(2))).status_code == 201
    housekeeping.delete_old_records(started.context)
    assert audit.verify(started.context.database).fault == "row 1 is missing"
    started.clock.pass_s(2.0 * edge.config.retain_audit_days * 86_400.0)
    housekeeping.delete_old_records(started.context)
    assert audit.verify(started.context.database).fault is None
    started.context.database.close()


def test_lost_commands_have_the_status_that_was_reported(edge: Edge) -> None:
    edge.post_plan(plan(mission(1), mission(2, 2)))
    edge.accept()
    edge.report("mission_report", mission_report(2, 3, 2, mission_id=1))
    edge.report("mission_report", mission_report(4, 3, 4, mission_id=2, vehicle_id=2))
    started = restarted_after(edge, overwrite("command"))
    (shown,) = started.get("/plans/")
    statuses = [
        [one["command_status_id"] for one in each["command_array"]] for each in shown["missions"]
    ]
    assert statuses == [[3, 2, 1], [3, 4, 5]]
    last = mission_report(3, 3, 3, 3, mission_id=1)
    assert started.report("mission_report", last).status_code == 201
    started.context.database.close()


@pytest.mark.first_case
@pytest.mark.parametrize("junk", [b"\x01", b"\xff"])
def test_one_row_that_cannot_be_read_keeps_no_other_work_from_the_broker(
    edge: Edge, junk: bytes
) -> None:
    for number in (1, 2):
        edge.post_plan(plan(mission(number), name=f"field number {number}"))

    def spoil(path: Path) -> None:
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        content = path.read_bytes()
        for text in (b'{"sequence_number":0,"mission_id":1,', b'"name":"field number 1"'):
            assert content.count(text) == 1
            content = content.replace(text, text[:9] + junk + text[10:])
        path.write_bytes(content)

    started = restarted_after(edge, spoil)
    assert started.post("/events/", event(3, maximum_speed=2.0), "operator").status_code == 201
    found = [(item["kind"], item.get("mission", {}).get("mission_id")) for item in started.work()]
    assert found == [("event", None), ("mission", 2)]
    assert [one["name"] for one in started.get("/plans/")] == ["field number 2"]
    started.context.database.close()


def test_a_new_database_gives_no_work_the_id_of_old_work(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    (old,) = edge.work()
    started = restarted_after(edge, Path.unlink)
    started.post_plan(plan(mission(1)))
    (item,) = started.work(after=old["id"])
    assert item["id"] > old["id"]
    started.accept()
    names = {"work_id": old["id"], "plan_id": old["plan_id"]}
    last = mission_report(3, 3, 3, 3, mission_id=2, **names)
    assert started.report("mission_report", last).status_code == 201
    wrong = mission_report(3, 3, 3, 3, mission_id=1, work_id=old["id"])
    assert started.report("mission_report", wrong).status_code == 409
    assert started.get("/plans/1")["plan_status_name"] == "NOT_STARTED"
    started.context.database.close()


def test_lost_counts_of_ids_keep_no_plan_from_being_deleted(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    assert edge.ask("DELETE", "/plans/1", "operator").status_code == 204
    started = restarted_after(edge, overwrite("sqlite_sequence"))
    stored = started.post_plan(plan(mission(1))).json or {}
    assert started.work()[0]["id"] > 1
    assert started.ask("DELETE", f"/plans/{stored['id']}", "operator").status_code == 204
    started.context.database.close()


@pytest.mark.first_case
@pytest.mark.parametrize("table", ["plan", "work"])
def test_the_end_of_a_mission_that_is_lost_is_forwarded(edge: Edge, table: str) -> None:
    edge.post_plan(plan(mission(1), dispatch=False))
    draft = 1
    assert edge.post("/plans/1/dispatch", {}, "operator").status_code == 200
    (item,) = edge.work()
    edge.accept()
    started = restarted_after(edge, overwrite(table))
    names = {"work_id": item["id"], "plan_id": item["plan_id"]}
    last = mission_report(3, 3, 3, 3, mission_id=1, **names)
    assert started.report("mission_report", last | {"work_id": draft}).status_code == 409
    assert started.report("mission_report", last).status_code == 201
    started.context.database.close()


@pytest.mark.first_case
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 2.0**60])
def test_marks_that_cannot_be_are_none(edge: Edge, value: float) -> None:
    path = high_water.path_of(edge.config.database_path)
    tally = Tally(path)
    for name in ("newest_record", "newest_work"):
        tally.put(name, value=value)
    tally.close()
    assert struct.pack("=d", value) in path.read_bytes()
    started = restarted_after(edge, lambda _path: None)
    started.post_plan(plan(mission(1)))
    assert [item["id"] for item in started.work()] == [1]
    started.context.database.close()
