"""The role matrix, cell by cell, and that no route is without one."""

import itertools
import re
from typing import Any

import pytest

from edge_server.api.routes.planning.fields import EXAMPLE as FIELD
from edge_server.api.routes.planning.plan_files import EXAMPLE as PLAN_FILE
from edge_server.api.routes.planning.surveys import EXAMPLE as SURVEY
from edge_server.app import context_of, create_app
from edge_server.config import Config
from edge_server.store.rows.keys import Role
from tests.unit.edge_server.conftest import Clock, Edge
from tests.unit.edge_server.documents import (
    TELEMETRY,
    VEHICLE_LOG,
    event,
    plan,
    speed_event,
    telemetry,
)

EVERYBODY = {"farmer", "operator", "admin", "broker", "cloud"}
PEOPLE = EVERYBODY - {"broker"}
ULID = "01K9Z4T1W8F6Q2M3N5P7R9S0VX"

MATRIX: list[tuple[str, str, set[str], Any]] = [
    ("GET", "/plans/", EVERYBODY, None),
    ("GET", "/plans/1", EVERYBODY, None),
    ("GET", f"/plans/{ULID}", EVERYBODY, None),
    ("POST", "/plans/", {"operator", "admin", "cloud"}, plan()),
    ("POST", "/plans/", {"farmer", "operator", "admin", "cloud"}, plan(dispatch=False)),
    ("POST", "/plans/1/dispatch", {"operator", "admin"}, None),
    ("POST", f"/plans/{ULID}/dispatch", {"operator", "admin"}, None),
    ("PUT", "/plans/1", {"operator", "admin", "cloud"}, plan()),
    ("PUT", "/plans/1", {"farmer", "operator", "admin", "cloud"}, plan(dispatch=False)),
    ("PUT", f"/plans/{ULID}", {"operator", "admin", "cloud"}, plan()),
    ("POST", "/plans/1/close", {"operator", "admin"}, {"reason": "lost"}),
    ("POST", f"/plans/{ULID}/close", {"operator", "admin"}, {"reason": "lost"}),
    ("DELETE", "/plans/1", {"operator", "admin"}, None),
    ("DELETE", f"/plans/{ULID}", {"operator", "admin"}, None),
    ("GET", "/vehicles/", EVERYBODY, None),
    ("GET", "/vehicles/1", EVERYBODY, None),
    ("PUT", "/vehicles/1", {"broker", "operator", "admin"}, {"link_state": "lost"}),
    ("DELETE", "/vehicles/1", {"admin"}, None),
    ("POST", "/vehicles/1/release", {"operator", "admin"}, {"reason": "looked at"}),
    ("GET", "/vehicles/1/logs", {"broker"}, None),
    ("PUT", "/vehicles/1/logs/maria", {"broker"}, VEHICLE_LOG),
    ("PATCH", "/vehicles/1/logs/maria?offset=0", {"broker"}, {}),
    ("DELETE", "/vehicles/1/logs/maria", {"broker"}, None),
    ("GET", "/broker/commands", {"broker"}, None),
    ("POST", "/broker/commands/1/ack", {"broker"}, {"status": "accepted"}),
    ("POST", "/latest_state_vector/", PEOPLE, {"sequence_number": 3}),
    ("POST", "/surveys/", {"farmer", "operator", "admin"}, dict(SURVEY)),
    ("POST", "/events/", PEOPLE, event()),
    ("POST", "/events/", {"operator", "admin", "cloud"}, speed_event()),
    ("GET", "/events/", EVERYBODY, None),
    ("GET", "/events/1", EVERYBODY, None),
    ("PUT", "/events/1", PEOPLE, event()),
    ("PUT", "/events/1", {"operator", "admin", "cloud"}, speed_event()),
    ("DELETE", "/events/1", {"operator", "admin"}, None),
    ("POST", "/fields/", {"farmer", "operator", "admin"}, dict(FIELD)),
    ("GET", "/fields/", EVERYBODY, None),
    ("GET", "/fields/1", EVERYBODY, None),
    ("PUT", "/fields/1", {"farmer", "operator", "admin"}, dict(FIELD)),
    ("DELETE", "/fields/1", {"operator", "admin"}, None),
    ("POST", "/plans/import?vehicle_id=1", {"farmer", "operator", "admin"}, dict(PLAN_FILE)),
    ("POST", "/plans/import?vehicle_id=1&dispatch=true", {"operator", "admin"}, dict(PLAN_FILE)),
    ("GET", "/plans/1?format=plan", EVERYBODY, None),
    ("GET", "/plans/1?format=waypoints", EVERYBODY, None),
    ("GET", "/dead_letters/", {"operator", "admin"}, None),
    ("GET", "/dead_letters/1", {"operator", "admin"}, None),
    ("POST", "/dead_letters/1/retry", {"operator", "admin"}, None),
    ("POST", "/dead_letters/retry", {"operator", "admin"}, None),
    ("GET", "/dead_letters/export", {"operator", "admin"}, None),
    ("PUT", "/dead_letters/1", {"admin"}, telemetry("pose")),
    ("DELETE", "/dead_letters/1", {"admin"}, None),
    ("GET", "/openapi.json", EVERYBODY, None),
    ("GET", "/docs", EVERYBODY, None),
    ("GET", "/docs/try.js", EVERYBODY, None),
    ("GET", "/metrics", {"operator", "admin"}, None),
    ("GET", "/storage", {"admin"}, None),
    ("GET", "/backups/", {"admin"}, None),
    ("POST", "/backups/", {"admin"}, None),
    ("GET", "/keys/", {"admin"}, None),
    ("POST", "/keys/", {"admin"}, {"name": "another", "role": "farmer"}),
    ("GET", "/keys/0123abcd", {"admin"}, None),
    ("DELETE", "/keys/0123abcd", {"admin"}, None),
    ("GET", "/audit/", {"admin"}, None),
    ("GET", "/live/", EVERYBODY, None),
    ("GET", "/session/", EVERYBODY, None),
    ("DELETE", "/session/", EVERYBODY, None),
    ("GET", "/users/", {"admin"}, None),
    ("POST", "/users/", {"admin"}, {"name": "maria", "role": "farmer"}),
    ("GET", "/users/maria", {"admin"}, None),
    ("PATCH", "/users/maria", {"admin"}, {"role": "operator"}),
    ("DELETE", "/users/maria", {"admin"}, None),
    ("POST", "/users/maria/link", {"admin"}, None),
    ("GET", "/sessions/", {"admin"}, None),
    ("DELETE", "/sessions/0123abcd", {"admin"}, None),
    ("GET", "/flights/", PEOPLE, None),
    ("GET", "/flights/1", PEOPLE, None),
    ("GET", "/flight_maps/", PEOPLE, None),
    ("GET", "/flights/1/track", PEOPLE, None),
    ("GET", "/flights/1/pictures", PEOPLE, None),
    ("GET", "/flights/1/pictures/1", PEOPLE, None),
    ("GET", "/flights/1/pictures/1/thumbnail", PEOPLE, None),
    ("GET", "/flights/1/footprints", PEOPLE, None),
    ("GET", "/flights/1/observations", PEOPLE, None),
    ("GET", "/flights/1/log", PEOPLE, None),
    ("GET", "/flights/1/logs", PEOPLE, None),
    ("GET", "/flights/1/logs/1", PEOPLE, None),
    ("GET", "/flights/1/map", PEOPLE, None),
    ("POST", "/flights/1/map", {"operator", "admin"}, None),
    ("GET", "/flights/1/map/picture", PEOPLE, None),
    ("GET", "/maps/", PEOPLE, None),
    ("GET", "/maps/farm.pmtiles", PEOPLE, None),
    ("GET", "/maps/farm.pmtiles/picture", PEOPLE, None),
    ("GET", "/videos/", PEOPLE, None),
    ("GET", "/videos/1", PEOPLE, None),
    ("GET", "/alarms/history/", PEOPLE, None),
    ("POST", "/alarms/history/1/acknowledge", {"operator", "admin"}, None),
    ("POST", "/telemetry/", {"broker"}, {"records": [{"pose": telemetry("pose")}]}),
]
for _kind in TELEMETRY:
    MATRIX += [
        ("POST", f"/{_kind}/", {"broker"}, telemetry(_kind)),
        ("GET", f"/{_kind}/", PEOPLE, None),
        ("GET", f"/{_kind}/1", PEOPLE, None),
        ("PUT", f"/{_kind}/1", {"admin"}, telemetry(_kind)),
        ("DELETE", f"/{_kind}/1", {"admin"}, None),
    ]
OPEN = {
    ("GET", "/healthz"),
    ("GET", "/readyz"),
    ("GET", "/console"),
    ("GET", "/console/fleet"),
    ("POST", "/session"),
}
PLACES = (
    ("int64", "1"),
    (r"string\(length=26\)", ULID),
    (r"string\(length=8\)", "0123abcd"),
    (r"string\(maxlength=64\)", "maria"),
    (r"string\(maxlength=200\)", "farm.pmtiles"),
    ("path", "fleet"),
)
"""Values in a path, by converter."""
WITHOUT_VEHICLES = (
    *(
        "/openapi.json",
        "/docs",
        "/metrics",
        "/storage",
        "/backups",
        "/audit",
        "/keys",
        "/fields",
        "/maps",
        "/session",
        "/users",
        "/live",
    ),
)
"""Paths of resources without a vehicle."""


@pytest.mark.first_case
@pytest.mark.parametrize("row", MATRIX, ids=lambda row: f"{row[0]} {row[1]}")
def test_a_row_of_the_matrix(edge: Edge, row: tuple[str, str, set[str], Any]) -> None:
    method, path, allowed, body = row
    options = {} if body is None else {"json": body}
    for role in Role:
        status = edge.ask(method, path, role, **options).status_code
        assert (status != 403) == (role.value in allowed), (role, status)
        assert status not in {401, 500}
    assert edge.ask(method, path, None, **options).status_code == 401


def test_every_route_is_in_the_matrix(edge: Edge) -> None:
    rules = list(edge.client.application.url_map.iter_rules())
    adapter = edge.client.application.url_map.bind("localhost")
    covered = {
        adapter.match(path.partition("?")[0], method=method)[0]
        for method, path in itertools.chain(((m, p) for m, p, *_ in MATRIX), OPEN)
    }
    assert {rule.endpoint for rule in rules} - covered == set()


@pytest.mark.thorough
def test_every_cell_of_every_spelling_of_every_route(edge: Edge) -> None:
    """Each rule and method of the app by each role and without a key, against the table."""
    adapter = edge.client.application.url_map.bind("localhost")
    table: dict[tuple[str, str], set[str]] = {}
    for method, path, allowed, _ in MATRIX:
        endpoint = adapter.match(path.partition("?")[0], method=method)[0]
        table.setdefault((endpoint, method), set()).update(allowed)
    cells = 0
    for rule in edge.client.application.url_map.iter_rules():
        path = rule.rule
        for shape, value in PLACES:
            path = re.sub(rf"<{shape}:\w+>", value, path)
        assert "<" not in path, rule
        for method in sorted((rule.methods or set()) - {"HEAD", "OPTIONS"}):
            if (method, path.rstrip("/")) in OPEN:
                continue
            allowed = table[rule.endpoint, method]  # A route without a row fails here
            options: dict[str, Any] = {} if method == "GET" else {"json": {}}
            assert edge.ask(method, path, None, **options).status_code == 401, path
            for role in Role:
                status = edge.ask(method, path, role, **options).status_code
                assert (status == 403) == (role.value not in allowed), (method, path, role)
                assert status not in {401, 500}
                cells += 1
    assert cells > 500


@pytest.mark.thorough
def test_a_key_for_another_vehicle_reaches_nothing(edge: Edge) -> None:
    """Every row of the table once more, by keys that are restricted to vehicle 9."""
    edge.post_plan(plan())
    for kind in TELEMETRY:
        edge.report(kind, telemetry(kind))
    edge.post("/events/", speed_event(), "operator")
    keys = {}
    for role in Role:
        wanted = {"name": f"ninth-{role}", "role": role, "vehicle_ids": [9]}
        keys[role.value] = (edge.post("/keys/", wanted, "admin").json or {})["key"]
    before = [edge.count(table) for table in ("plan", "work", "telemetry", "event", "vehicle")]
    for method, path, allowed, body in MATRIX:
        if path.startswith(WITHOUT_VEHICLES):
            continue
        for name in sorted(allowed - {"cloud"}):  # A signature is needed besides
            headers = {"X-API-Key": keys[name]}
            options = {} if body is None else {"json": body}
            answer = edge.ask(method, path, None, headers=headers, **options)
            if path == "/telemetry/":
                assert {one["status"] for one in (answer.json or {})["records"]} == {403}
            elif answer.status_code == 200:
                found = answer.json or {}
                assert not found or found["commands"] == [], (method, path, name)
            else:
                assert answer.status_code in {403, 404}, (method, path, name)
    after = [edge.count(table) for table in ("plan", "work", "telemetry", "event", "vehicle")]
    assert after == before


@pytest.mark.thorough
def test_a_route_without_roles_refuses_all(config: Config) -> None:
    app = create_app(config)
    app.view_functions = app.view_functions | {"plans.page": lambda: "secret"}
    edge = Edge(app.test_client(), context_of(app), Clock())
    for role in Role:
        assert edge.ask("GET", "/plans/", role).status_code == 403
    edge.context.close()


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/", "/nothing", "/plans/1", "/pose/", "/broker/commands"])
def test_without_a_key_every_path_is_a_401(edge: Edge, path: str) -> None:
    answer = edge.ask("GET", path, None)
    assert answer.status_code == 401
    assert answer.headers["WWW-Authenticate"].startswith("Bearer")


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/healthz/"])
def test_health_needs_no_key(edge: Edge, path: str) -> None:
    answer = edge.ask("GET", path, None)
    assert answer.status_code == 200
    assert (answer.json or {})["database"] == "ok"


def test_both_headers_carry_a_key(edge: Edge) -> None:
    key = edge.key("operator")
    for headers in ({"Authorization": f"Bearer {key}"}, {"X-API-Key": key}):
        assert edge.ask("GET", "/plans/", None, headers=headers).status_code == 200


@pytest.mark.first_case
@pytest.mark.parametrize(
    "spoil",
    [
        lambda key: key[:-1] + ("0" if key[-1] != "0" else "1"),
        lambda key: key[:-1],
        lambda key: key + "0",
        lambda key: key.upper(),
        lambda key: key.replace("fm_", "xx_"),
        lambda _: "",
        lambda _: "fm_00000000_" + "0" * 64,
        lambda _: "\xe9" * 40,
    ],
)
def test_an_altered_key_is_refused(edge: Edge, spoil: Any) -> None:
    headers = {"X-API-Key": spoil(edge.key("admin"))}
    assert edge.ask("GET", "/plans/", None, headers=headers).status_code == 401


def test_keys_are_not_in_the_database(edge: Edge) -> None:
    raw = edge.config.database_path.read_bytes()
    for role in Role:
        assert edge.key(role).rpartition("_")[2].encode() not in raw
