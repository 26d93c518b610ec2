"""Accounts are made, changed and ended by admins; a change takes effect at once."""

from typing import Any

import pytest

from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.api.routes.administration.test_session import (
    PASSWORD,
    Browser,
    make,
    sign_in,
)
from tests.unit.edge_server.conftest import Edge

pytestmark = BOTH_ENGINES

OTHER = "another ten or more characters"


def test_an_account_is_shown_without_its_password(edge: Edge) -> None:
    make(edge, "maria", "farmer")
    Browser(edge)
    shown = edge.get("/users/maria", "admin")
    assert edge.get("/users/", "admin") == [shown]
    assert shown["last_sign_in_at"] is not None
    assert {"name": "maria", "role": "farmer", "has_password": True, "disabled": False}.items() <= (
        shown.items()
    )
    assert "argon2" not in edge.ask("GET", "/users/", "admin").text


@pytest.mark.first_case
@pytest.mark.parametrize("role", ["operator", "farmer", "broker", "cloud"])
def test_only_admins_see_and_change_accounts(edge: Edge, role: str) -> None:
    make(edge)
    body = {"name": "own", "role": "admin", "password": PASSWORD}
    for method, path, sent in (
        ("GET", "/users/", None),
        ("POST", "/users/", body),
        ("PATCH", "/users/maria", {"role": "admin"}),
        ("DELETE", "/users/maria", None),
        ("POST", "/users/maria/link", None),
        ("GET", "/sessions/", None),
    ):
        options = {} if sent is None else {"json": sent}
        assert edge.ask(method, path, role, **options).status_code == 403, (method, path)


def test_a_new_role_counts_at_the_next_request(edge: Edge) -> None:
    make(edge)
    maria = Browser(edge)
    assert maria.page("GET", "/users/").status_code == 403
    edge.ask("PATCH", "/users/maria", "admin", json={"role": "admin"})
    assert maria.page("GET", "/users/").status_code == 200


@pytest.mark.parametrize("change", [{"disabled": True}, {"password": OTHER}])
def test_disabling_and_a_new_password_end_the_sessions(edge: Edge, change: Any) -> None:
    make(edge)
    make(edge, "other")
    maria, other = Browser(edge), Browser(edge, "other")
    assert edge.ask("PATCH", "/users/maria", "admin", json=change).status_code == 200
    assert maria.page("GET", "/plans/").status_code == 401
    assert other.page("GET", "/plans/").status_code == 200
    assert sign_in(edge, name="maria", password=PASSWORD).status_code == 401


def test_a_disabled_account_is_enabled_again(edge: Edge) -> None:
    make(edge)
    edge.ask("PATCH", "/users/maria", "admin", json={"disabled": True})
    edge.ask("PATCH", "/users/maria", "admin", json={"disabled": False})
    assert sign_in(edge, name="maria", password=PASSWORD).status_code == 201


def test_a_deleted_account_leaves_no_session(edge: Edge) -> None:
    make(edge)
    maria = Browser(edge)
    edge.ask("POST", "/users/maria/link", "admin")
    assert edge.ask("DELETE", "/users/maria", "admin").status_code == 204
    assert maria.page("GET", "/plans/").status_code == 401
    assert [edge.count(table) for table in ("account", "session", "sign_in_link")] == [0, 0, 0]
    assert edge.ask("DELETE", "/users/maria", "admin").status_code == 404


def test_an_admin_ends_a_session(edge: Edge) -> None:
    make(edge)
    first, second = Browser(edge), Browser(edge)
    edge.clock.pass_s(1)
    listed = edge.get("/sessions/", "admin")
    assert {one["name"] for one in listed} == {"maria"}
    for one in listed:
        assert one["id"] not in edge.ask("GET", "/users/", "admin").text
    assert edge.ask("DELETE", f"/sessions/{listed[0]['id']}", "admin").status_code == 204
    statuses = {browser.page("GET", "/plans/").status_code for browser in (first, second)}
    assert statuses == {200, 401}
    assert edge.ask("DELETE", f"/sessions/{listed[0]['id']}", "admin").status_code == 404


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({}, "name"),
        ({"name": "a", "password": PASSWORD}, "role"),
        ({"name": "a b", "role": "farmer"}, "name"),
        ({"name": "user/a", "role": "farmer"}, "name"),
        ({"name": "a" * 65, "role": "farmer"}, "name"),
        ({"name": "a", "role": "broker"}, "role"),
        ({"name": "a", "role": "cloud"}, "role"),
        ({"name": "a", "role": "root"}, "role"),
        ({"name": "a", "role": "farmer", "password": "short"}, "password"),
        ({"name": "a", "role": "farmer", "password": "x" * 201}, "password"),
        ({"name": "a", "role": "farmer", "sha256": "x"}, "sha256"),
    ],
)
def test_a_faulty_account_is_refused_with_its_field(edge: Edge, body: Any, field: str) -> None:
    answer = edge.post("/users/", body, "admin")
    assert answer.status_code == 422
    assert field in (answer.json or {})["detail"]["json"]
    assert edge.count("account") == 0


def test_a_name_is_given_once(edge: Edge) -> None:
    make(edge)
    body = {"name": "maria", "role": "admin", "password": OTHER}
    assert edge.post("/users/", body, "admin").status_code == 409
    assert edge.get("/users/maria", "admin")["role"] == "operator"


def test_a_restricted_key_makes_no_account(edge: Edge) -> None:
    limited = {"name": "limited", "role": "admin", "vehicle_ids": [1]}
    key = (edge.post("/keys/", limited, "admin").json or {})["key"]
    body = {"name": "own", "role": "admin", "password": PASSWORD}
    answer = edge.ask("POST", "/users/", None, json=body, headers={"X-API-Key": key})
    assert answer.status_code == 403
    assert edge.count("account") == 0
