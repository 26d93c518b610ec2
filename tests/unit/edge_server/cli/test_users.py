"""Accounts on the terminal."""

import io
import sqlite3
from pathlib import Path

import pytest

from edge_server.app import context_of, create_app
from edge_server.config import Config
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from tests.unit.edge_server.cli.test_access import Run, run

__all__ = ["run"]
PASSWORD = "nine words are better than one"


def typed(monkeypatch: pytest.MonkeyPatch, password: str = PASSWORD) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(password + "\n"))


def audited(tmp_path: Path) -> list[tuple[str, str, str]]:
    with sqlite3.connect(Config(state_dir=tmp_path).database_path) as connection:
        query = "SELECT role, action, object FROM audit WHERE action LIKE 'users.%' ORDER BY id"
        return list(connection.execute(query))


def status_of_sign_in(tmp_path: Path, **body: str) -> int:
    app = create_app(Config(state_dir=tmp_path))
    status = app.test_client().post("/session/", json=body).status_code
    context_of(app).database.close()
    return status


def test_the_life_of_an_account(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    typed(monkeypatch)
    assert run("users", "create", "maria", "operator") == (OK, "", "")
    assert status_of_sign_in(tmp_path, name="maria", password=PASSWORD) == 201
    code, listed, _ = run("users", "list")
    assert (code, listed.split()[:3]) == (OK, ["maria", "operator", "active"])
    typed(monkeypatch, "ten other characters")
    assert run("users", "password", "maria")[0] == OK
    assert status_of_sign_in(tmp_path, name="maria", password=PASSWORD) == 401
    assert run("users", "disable", "maria")[0] == OK
    assert status_of_sign_in(tmp_path, name="maria", password="ten other characters") == 401
    assert run("users", "delete", "maria")[0] == OK
    assert run("users", "delete", "maria") == (
        FAILED,
        "",
        "edge server: there is no account maria\n",
    )
    assert audited(tmp_path)[:2] == [
        ("shell", "users.create", "users/maria"),
        ("shell", "users.password", "users/maria"),
    ]


def test_a_link_signs_in_once_and_creates_the_account(run: Run, tmp_path: Path) -> None:
    code, printed, _ = run("users", "link", "maria", "--role", "operator")
    assert code == OK
    address, _, token = printed.strip().partition("#link=")
    assert address == "http://127.0.0.1:8000/console/"
    assert audited(tmp_path) == [
        ("shell", "users.create", "users/maria"),
        ("shell", "users.link", "users/maria"),
    ]
    assert status_of_sign_in(tmp_path, link=token) == 201
    assert status_of_sign_in(tmp_path, link=token) == 401
    assert run("users", "link", "maria", "--role", "operator")[0] == OK
    code, printed, complaint = run("users", "link", "maria", "--role", "admin")
    assert (code, printed) == (FAILED, "")
    assert "maria has the role operator" in complaint
    assert "operator" in run("users", "list")[1]


@pytest.mark.parametrize(
    ("arguments", "code", "named"),
    [
        (("create", "maria", "pilot"), WRONG_SETUP, "role"),
        (("create", "maria", "broker"), WRONG_SETUP, "role"),
        (("create", "a b", "farmer"), WRONG_SETUP, "name"),
        (("link", "nobody"), FAILED, "nobody"),
        (("password", "nobody"), FAILED, "nobody"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    code: int,
    named: str,
) -> None:
    typed(monkeypatch)
    found, printed, complaint = run("users", *arguments)
    assert (found, printed) == (code, "")
    assert named in complaint
    assert complaint.count("\n") == 1
    assert audited(tmp_path) == []


def test_a_short_password_is_refused(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    typed(monkeypatch, "short")
    code, _, complaint = run("users", "create", "maria", "farmer")
    assert code == WRONG_SETUP
    assert "password" in complaint
    assert "short" not in complaint.replace("should", "")
