"""Every answer has the security headers and shows no internals."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from edge_server.api.headers import HEADERS
from edge_server.app import context_of, create_app
from edge_server.config import Config
from tests.unit.edge_server.conftest import Clock, Edge
from tests.unit.edge_server.documents import plan, telemetry

ASKED: list[tuple[str, str, str | None, Any]] = [
    ("GET", "/healthz", None, None),
    ("GET", "/plans/", None, None),
    ("GET", "/plans/", "operator", None),
    ("GET", "/nothing", "operator", None),
    ("PATCH", "/plans/", "operator", None),
    ("OPTIONS", "/plans/", "operator", None),
    ("POST", "/plans/", "farmer", plan()),
    ("POST", "/plans/", "operator", plan()),
    ("POST", "/plans/", "operator", {}),
    ("POST", "/keys/", "admin", {"name": "a", "role": "farmer"}),
    ("GET", "/audit/", "admin", None),
]


@pytest.mark.first_case
@pytest.mark.parametrize(("method", "path", "role", "body"), ASKED)
def test_every_answer_has_the_security_headers(
    edge: Edge, method: str, path: str, role: str | None, body: Any
) -> None:
    options = {} if body is None else {"json": body}
    answer = edge.ask(method, path, role, **options)
    for name, value in HEADERS.items():
        assert answer.headers[name] == value
    assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
    assert "Strict-Transport-Security" not in answer.headers


def test_the_documentation_page_keeps_its_stricter_policy(edge: Edge) -> None:
    rules = edge.ask("GET", "/docs", "operator").headers.getlist("Content-Security-Policy")
    assert len(rules) == 1
    assert "default-src 'none'" in rules[0]


def test_with_tls_the_answer_has_strict_transport_security(config: Config) -> None:
    app = create_app(replace(config, tls_certificate_file=Path("certificate.pem")))
    answer = Edge(app.test_client(), context_of(app), Clock()).ask("GET", "/healthz", None)
    assert "max-age" in answer.headers["Strict-Transport-Security"]
    context_of(app).close()


def test_an_internal_error_shows_no_internals(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("secret words at /home/farm/edge.py")

    monkeypatch.setattr("edge_server.services.planning.plans.page", fail)
    answer = edge.ask("GET", "/plans/", "operator")
    assert answer.status_code == 500
    assert "secret" not in answer.text
    assert "Traceback" not in answer.text
    assert answer.headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.first_case
@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_no_answer_has_nan_or_infinity(edge: Edge, number: str) -> None:
    raw = json.dumps(plan()).replace('"altitude": 5.0', f'"altitude": {number}', 1)
    answer = edge.ask("POST", "/plans/", "operator", data=raw, content_type="application/json")
    assert answer.status_code == 422
    for word in ("NaN", "Infinity", "1e999"):
        assert word not in answer.text


@pytest.mark.first_case
@pytest.mark.parametrize("number", ["1e-400", "-0.001e-330", "4E-999"])
def test_a_number_that_would_become_0_is_refused_by_its_field(edge: Edge, number: str) -> None:
    raw = json.dumps(plan()).replace('"altitude": 5.0', f'"altitude": {number}', 1)
    answer = edge.ask("POST", "/plans/", "operator", data=raw, content_type="application/json")
    assert answer.status_code == 422
    ((path, faults),) = (answer.json or {})["detail"]["json"].items()
    assert path == "missions.0.command_array.0.parameters.altitude"
    assert "closer to 0 than a double can represent" in str(faults)


@pytest.mark.first_case
@pytest.mark.parametrize("zero", ["0.0", "-0.0", "0e-400", "0.000E5"])
def test_zero_is_zero_however_it_is_written(edge: Edge, zero: str) -> None:
    raw = json.dumps(plan()).replace('"longitude": -3.7382', f'"longitude": {zero}')
    answer = edge.ask("POST", "/plans/", "operator", data=raw, content_type="application/json")
    assert answer.status_code == 201


@pytest.mark.first_case
@pytest.mark.parametrize("moment", ["1", "1795262400", "-1", "1e3", "2026-11-21", "12:00:00Z"])
def test_a_time_is_a_date_and_an_hour(edge: Edge, moment: str) -> None:
    answer = edge.report("pose", telemetry("pose") | {"recorded_at": moment})
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["json"]) == ["recorded_at"]


@pytest.mark.first_case
@pytest.mark.parametrize("nest", ["[{}]", '{{"a": {}}}'])
def test_a_body_nests_twenty_levels_and_no_more(edge: Edge, nest: str) -> None:
    def post(levels: int) -> int:
        raw = "1"
        for _ in range(levels):
            raw = nest.format(raw)
        options = {"data": raw, "content_type": "application/json"}
        return edge.ask("POST", "/plans/", "operator", **options).status_code

    assert post(20) == 422
    assert post(21) == 400
    assert post(900) == 400
