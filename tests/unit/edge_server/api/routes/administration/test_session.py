"""People sign in and out; what a browser sends by itself changes nothing."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from werkzeug.test import TestResponse

from edge_server.app import context_of, create_app
from edge_server.config import Config
from tests.unit.edge_server.api.access.test_audit_trail import audit_rows
from tests.unit.edge_server.conftest import Clock, Edge
from tests.unit.edge_server.documents import plan

PASSWORD = "nine words are better than one"
WRONG = "wrong name or password, or the account is disabled"


def make(edge: Edge, name: str = "maria", role: str = "operator", **more: Any) -> None:
    body = {"name": name, "role": role, "password": PASSWORD} | more
    answer = edge.post("/users/", body, "admin")
    assert answer.status_code == 201, answer.json


def sign_in(edge: Edge, address: str = "192.0.2.1", **body: Any) -> TestResponse:
    place = {"REMOTE_ADDR": address}
    return edge.ask("POST", "/session/", None, json=body, environ_overrides=place)


class Browser:
    """Sends the cookie of one session; as `page` also its CSRF token."""

    def __init__(
        self, edge: Edge, name: str = "maria", password: str = PASSWORD, address: str = "192.0.2.1"
    ) -> None:
        self._edge = edge
        answer = sign_in(edge, address, name=name, password=password)
        assert answer.status_code == 201, answer.json
        self.session = answer.json or {}
        self.cookie = answer.headers["Set-Cookie"]
        self.secret = self.cookie.partition(";")[0].partition("=")[2]
        edge.client.delete_cookie("session")

    def ask(self, method: str, path: str, body: Any = None, **headers: str) -> TestResponse:
        """Send a request that any site could make the browser send."""
        options = {} if body is None else {"json": body}
        self._edge.client.set_cookie("session", self.secret)
        answer = self._edge.ask(method, path, None, headers=headers, **options)
        self._edge.client.delete_cookie("session")
        return answer

    def page(self, method: str, path: str, body: Any = None) -> TestResponse:
        """Send a request of the console."""
        token = {"X-CSRF-Token": self.session["csrf_token"]}
        return self.ask(method, path, body, **token)


def test_a_person_has_the_permissions_of_the_account(edge: Edge) -> None:
    make(edge)
    maria = Browser(edge)
    assert (maria.session["name"], maria.session["role"]) == ("maria", "operator")
    assert maria.page("GET", "/session/").json == maria.session
    assert maria.page("POST", "/plans/", plan()).status_code == 201
    assert maria.page("GET", "/keys/").status_code == 403
    rows = edge.ask("GET", "/audit/", "admin").text
    assert '"who": "user/maria"' in rows
    assert PASSWORD not in rows


def test_no_script_and_no_other_site_reads_or_sends_the_cookie(edge: Edge) -> None:
    make(edge)
    attributes = {part.strip() for part in Browser(edge).cookie.split(";")}
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= attributes


@pytest.mark.parametrize("token", [None, "", "0" * 64, "ä"])
def test_a_write_without_the_csrf_token_is_refused(edge: Edge, token: str | None) -> None:
    make(edge)
    maria = Browser(edge)
    headers = {} if token is None else {"X-CSRF-Token": token}
    answer = maria.ask("POST", "/plans/", plan(), **headers)
    assert answer.status_code == 403
    assert "X-CSRF-Token" in (answer.json or {})["message"]
    assert edge.count("plan") == 0
    assert maria.ask("GET", "/plans/").status_code == 200


def test_the_token_of_one_session_is_not_that_of_another(edge: Edge) -> None:
    make(edge)
    first, second = Browser(edge), Browser(edge)
    token = first.session["csrf_token"]
    headers = {"X-CSRF-Token": token}
    assert second.ask("POST", "/plans/", plan(), **headers).status_code == 403


def test_signing_out_ends_this_session_alone(edge: Edge) -> None:
    make(edge)
    first, second = Browser(edge), Browser(edge)
    assert first.page("DELETE", "/session/").status_code == 204
    assert first.page("GET", "/plans/").status_code == 401
    assert second.page("GET", "/plans/").status_code == 200


def test_a_session_expires(edge: Edge) -> None:
    make(edge)
    maria = Browser(edge)
    edge.clock.pass_s(edge.config.session_hours * 3600 - 1)
    assert maria.page("GET", "/plans/").status_code == 200
    edge.clock.pass_s(1)
    answer = maria.page("GET", "/plans/")
    assert answer.status_code == 401
    assert "sign in again" in (answer.json or {})["message"]


def test_a_wrong_password_and_an_unknown_name_have_the_same_answer(edge: Edge) -> None:
    make(edge)
    make(edge, "linked", password=None)
    make(edge, "old")
    edge.ask("PATCH", "/users/old", "admin", json={"disabled": True})
    for name, password in (
        ("maria", "not the password"),
        ("nobody", PASSWORD),
        ("linked", PASSWORD),
        ("old", PASSWORD),
    ):
        answer = sign_in(edge, name=name, password=password)
        assert (answer.status_code, (answer.json or {})["message"]) == (401, WRONG), name
        assert "Set-Cookie" not in answer.headers


def test_failed_sign_ins_are_in_the_audit_log(edge: Edge) -> None:
    make(edge)
    sign_in(edge, name="maria", password="a guess that is wrong")
    rows = edge.ask("GET", "/audit/", "admin").text
    assert '"who": "user/maria"' in rows
    assert '"result": "401"' in rows
    assert "a guess that is wrong" not in rows


@pytest.fixture
def strict(config: Config) -> Iterator[Edge]:
    """An edge server at which an address signs in twice a minute."""
    clock = Clock()
    app = create_app(replace(config, sign_ins_per_minute=2), clock=clock)
    context = context_of(app)
    yield Edge(app.test_client(), context, clock)
    context.close()


def test_guessing_is_throttled_by_address_and_says_when_to_try_again(strict: Edge) -> None:
    make(strict)
    for _ in range(2):
        assert sign_in(strict, name="maria", password="a guess").status_code == 401
    answer = sign_in(strict, name="maria", password=PASSWORD)
    assert answer.status_code == 429
    assert int(answer.headers["Retry-After"]) >= 1
    assert sign_in(strict, "192.0.2.2", name="maria", password=PASSWORD).status_code == 201


def test_guessing_from_many_addresses_is_throttled_by_name(strict: Edge) -> None:
    make(strict)
    for number in range(12):
        answer = sign_in(strict, f"192.0.2.{number}", name="maria", password="a guess")
        assert answer.status_code == 401
    assert sign_in(strict, "198.51.100.1", name="maria", password=PASSWORD).status_code == 429
    assert sign_in(strict, "198.51.100.1", name="nobody", password=PASSWORD).status_code == 401


def test_guessing_from_many_addresses_does_not_lock_a_person_out(strict: Edge) -> None:
    """Where she has signed in before, she does so again; elsewhere her name is blocked."""
    make(strict)
    assert sign_in(strict, "198.51.100.1", name="maria", password=PASSWORD).status_code == 201
    for number in range(12):
        sign_in(strict, f"192.0.2.{number}", name="maria", password="a guess")
    assert sign_in(strict, "198.51.100.2", name="maria", password=PASSWORD).status_code == 429
    assert sign_in(strict, "198.51.100.1", name="maria", password=PASSWORD).status_code == 201
    assert sign_in(strict, "198.51.100.1", name="maria", password="a guess").status_code == 429


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"name": "maria"},
        {"password": PASSWORD},
        {"name": "maria", "password": PASSWORD, "link": "x"},
        {"name": "maria", "link": "x"},
        {"name": "", "password": PASSWORD},
        {"name": "user/maria", "password": PASSWORD},
        {"name": "maria\x00", "password": PASSWORD},
        {"name": "maria", "password": ["x"]},
        {"name": "maria", "password": "x" * 201},
        {"name": "m" * 65, "password": PASSWORD},
        {"name": "maria", "password": PASSWORD, "role": "admin"},
        [],
    ],
)
def test_a_body_that_is_no_sign_in_is_refused(edge: Edge, body: Any) -> None:
    make(edge)
    answer = edge.ask("POST", "/session/", None, json=body)
    assert answer.status_code == 422
    assert edge.count("session") == 0


class TestALink:
    """Signs in once."""

    def make(self, edge: Edge) -> str:
        make(edge, password=None)
        answer = edge.ask("POST", "/users/maria/link", "admin")
        assert answer.status_code == 201
        shown = answer.json or {}
        assert shown["path"] == f"/console/#link={shown['link']}"
        return str(shown["link"])

    def test_signs_in_once(self, edge: Edge) -> None:
        token = self.make(edge)
        answer = sign_in(edge, link=token)
        assert (answer.status_code, (answer.json or {})["name"]) == (201, "maria")
        again = sign_in(edge, link=token)
        assert again.status_code == 401
        assert "used already" in (again.json or {})["message"]

    def test_is_in_the_audit_log_as_refused_when_it_is_used_again(self, edge: Edge) -> None:
        token = self.make(edge)
        sign_in(edge, link=token)
        sign_in(edge, link=token)
        results = [row[3] for row in audit_rows(edge) if row[1] == "session.create"]
        assert results == ["done", "401"]

    def test_expires(self, edge: Edge) -> None:
        token = self.make(edge)
        edge.clock.pass_s(600)
        assert sign_in(edge, link=token).status_code == 401
        assert edge.count("session") == 0

    def test_of_a_disabled_account_signs_nobody_in(self, edge: Edge) -> None:
        token = self.make(edge)
        edge.ask("PATCH", "/users/maria", "admin", json={"disabled": True})
        assert sign_in(edge, link=token).status_code == 401

    def test_is_not_stored(self, edge: Edge) -> None:
        token = self.make(edge)
        path = edge.config.database_path
        stored = b"".join(file.read_bytes() for file in path.parent.glob("edge.sqlite3*"))
        assert token.encode() not in stored


def test_the_secret_of_a_session_is_no_key(edge: Edge) -> None:
    make(edge)
    secret = Browser(edge).secret
    for headers in ({"X-API-Key": secret}, {"Authorization": f"Bearer {secret}"}):
        assert edge.ask("GET", "/plans/", None, headers=headers).status_code == 401


def test_a_key_in_the_request_takes_precedence_over_the_cookie(edge: Edge) -> None:
    make(edge, role="admin")
    maria = Browser(edge)
    key = {"X-API-Key": edge.key("farmer")}
    assert maria.ask("GET", "/session/", **key).json == {
        "name": "farmer",
        "role": "farmer",
        "csrf_token": None,
        "expires_at": None,
    }
    assert maria.ask("GET", "/plans/", **{"X-API-Key": "wrong"}).status_code == 401


@pytest.mark.parametrize("value", ["", "fs_", "fs_00000000_" + "0" * 64, "x" * 3000, "fm_\xff"])
def test_a_cookie_that_is_no_session_is_refused(edge: Edge, value: str) -> None:
    edge.client.set_cookie("session", value)
    answer = edge.ask("GET", "/plans/", None)
    assert answer.status_code == 401


def test_the_oldest_of_many_sessions_ends(edge: Edge) -> None:
    make(edge)
    browsers = []
    for number in range(21):
        edge.clock.pass_s(1)
        browsers.append(Browser(edge, address=f"192.0.2.{number}"))
    assert browsers[0].page("GET", "/plans/").status_code == 401
    assert browsers[1].page("GET", "/plans/").status_code == 200
    assert edge.count("session") == 20


@pytest.mark.parametrize("name", ["%00", "%ff", "a%20b", "..", "\u00e4", "x" * 64, "-"])
def test_a_path_that_names_no_account_is_a_404(edge: Edge, name: str) -> None:
    assert edge.ask("GET", f"/users/{name}", "admin").status_code == 404


@pytest.mark.parametrize(
    "body",
    [
        rb'{"name": "maria", "password": "\ud800 is half of a character"}',
        rb'{"name": "maria", "password": "nul \u0000 within"}',
        rb'{"link": "\ud800"}',
        rb'{"link": "\u0000"}',
    ],
)
def test_a_secret_of_strange_characters_is_refused_and_costs_nothing(
    edge: Edge, body: bytes
) -> None:
    make(edge)
    answer = edge.ask("POST", "/session/", None, data=body, content_type="application/json")
    assert answer.status_code in {400, 401, 422}
    assert sign_in(edge, name="maria", password=PASSWORD).status_code == 201
