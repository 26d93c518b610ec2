"""Each request has an id: in the answer, in the error, in the log."""

import logging

import pytest

from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import telemetry


def test_a_well_formed_request_id_is_kept(edge: Edge) -> None:
    for sane in ("7f3a", "a.b-c_D9", "x" * 64):
        answer = edge.ask("GET", "/plans/77", "operator", headers={"X-Request-ID": sane})
        assert answer.headers["X-Request-ID"] == sane
        assert (answer.json or {})["request_id"] == sane


@pytest.mark.first_case
@pytest.mark.parametrize("hostile", ["", "x" * 65, "a b", 'a"b', "caf\xe9", "{}", "a,b"])
def test_another_request_id_is_replaced(edge: Edge, hostile: str) -> None:
    answer = edge.ask("GET", "/plans/77", "operator", headers={"X-Request-ID": hostile})
    assert answer.headers["X-Request-ID"] not in {"", hostile}
    assert (answer.json or {})["request_id"] == answer.headers["X-Request-ID"]


def test_generated_request_ids_differ(edge: Edge) -> None:
    made = {edge.ask("GET", "/healthz", None).headers["X-Request-ID"] for _ in range(20)}
    assert len(made) == 20


def test_each_request_is_one_log_line(edge: Edge, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "edge_server.access")
    edge.report("pose", telemetry("pose"))
    edge.ask("GET", "/plans/77?after=s3cret", "operator")
    edge.ask("GET", "/plans/", None)
    lines = [vars(record) for record in caplog.records if record.name == "edge_server.access"]
    logged = [(line["method"], line["path"], line["status"], line["role"]) for line in lines]
    assert logged == [
        ("POST", "/pose/", 201, "broker"),
        ("GET", "/plans/77", 404, "operator"),
        ("GET", "/plans/", 401, None),
    ]
    assert all(line["duration_ms"] > 0 for line in lines)
    assert "s3cret" not in caplog.text
    assert edge.key("broker") not in caplog.text


def test_a_path_cannot_forge_a_line(edge: Edge, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "edge_server.access")
    edge.ask("GET", "/plans/1%0aedge CRITICAL all is lost", "operator")
    assert "\n" not in caplog.records[-1].getMessage()
