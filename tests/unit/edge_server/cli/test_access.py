"""Keys and the audit log on the terminal."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text

from edge_server.__main__ import main
from edge_server.config import Config
from edge_server.process import key_files, preparation
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role, StoredKey

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command over a state folder; gives exit code, stdout, stderr."""
    monkeypatch.setattr("edge_server.logs.configure", lambda *_: None)

    def call(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main(["--state-dir", str(tmp_path), *arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


def known(tmp_path: Path) -> dict[str, StoredKey]:
    database = preparation.open_database(Config(state_dir=tmp_path))
    with database.read() as connection:
        found = {key.prefix: key for key in keys.everything(connection)}
    database.close()
    return found


def test_the_life_of_a_key(run: Run, tmp_path: Path) -> None:
    code, secret, _ = run("keys", "create", "broker", "north", "--vehicle", "1", "--hours", "2")
    prefix = keys.prefix_of(secret.strip())
    assert code == OK
    assert prefix is not None
    made = known(tmp_path)[prefix]
    assert (made.role, made.vehicle_ids) == ("broker", frozenset({1}))
    code, listed, _ = run("keys", "list")
    assert f"{prefix}  broker    active   north" in listed
    assert secret.strip().rpartition("_")[2] not in listed
    assert run("keys", "create", "farmer", "north")[0] == FAILED
    assert run("keys", "revoke", "north")[0] == OK
    assert known(tmp_path)[prefix].revoked_at is not None
    code, _, complaint = run("keys", "revoke", "north")
    assert (code, complaint) == (FAILED, "edge server: no active key north\n")


def test_rotation_with_overlap_leaves_both_keys_valid(run: Run, tmp_path: Path) -> None:
    old = keys.prefix_of(run("keys", "create", "farmer", "tablet", "--scope", "read")[1].strip())
    assert old is not None
    code, output, complaint = run("keys", "rotate", "tablet", "--overlap-hours", "1")
    new = keys.prefix_of(output.strip())
    assert code == OK
    assert new is not None
    assert "is valid until" in complaint
    found = known(tmp_path)
    assert found[new].scopes == found[old].scopes == frozenset({keys.Scope.READ})
    assert found[new].expires_at is None
    now = found[new].created_at
    assert found[old].is_valid(now + 3590)
    assert not found[old].is_valid(now + 3610)
    assert (found[new].name, found[old].name) == ("tablet", f"tablet.replaced-{old}")
    assert run("keys", "revoke", "tablet")[0] == OK
    assert known(tmp_path)[new].revoked_at is not None
    assert run("keys", "revoke", old)[0] == OK


def test_a_roles_file_is_rotated_and_other_keys_of_the_role_stay(run: Run, tmp_path: Path) -> None:
    other = keys.prefix_of(run("keys", "create", "farmer", "tablet")[1].strip())
    assert other is not None
    path = key_files.path_of(tmp_path / "keys", Role.FARMER)
    old = keys.prefix_of(key_files.read(path) or "")
    assert old is not None
    assert run("keys", "rotate", "farmer")[0] == OK
    new = keys.prefix_of(key_files.read(path) or "")
    found = known(tmp_path)
    assert found[old].revoked_at is not None
    assert [key.prefix for key in found.values() if key.name == "farmer"] == [new]
    assert found[other].revoked_at is None


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("create", "root", "a"), "role"),
        (("create", "farmer", "a b"), "name"),
        (("create", "farmer", "a", "--scope", "all"), "scopes"),
        (("create", "broker", "a", "--vehicle", "0"), "vehicle_ids"),
    ],
)
def test_an_invalid_key_request_is_named(run: Run, arguments: tuple[str, ...], word: str) -> None:
    code, _, complaint = run("keys", *arguments)
    assert code == WRONG_SETUP
    assert word in complaint


@pytest.mark.parametrize(
    ("command", "flag", "allowed"),
    [
        (("keys", "create", "farmer", "tablet"), "--hours", "above 0, at most 8784"),
        (("keys", "rotate", "farmer"), "--overlap-hours", "0 to 8784"),
        (("users", "link", "maria"), "--minutes", "above 0, at most 10080"),
    ],
)
@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "-1", "1e300", "8784000"])
def test_a_duration_that_none_can_have_is_refused(
    run: Run,
    capsys: pytest.CaptureFixture[str],
    command: tuple[str, ...],
    flag: str,
    allowed: str,
    value: str,
) -> None:
    with pytest.raises(SystemExit) as ended:
        run(*command, f"{flag}={value}")
    assert ended.value.code == WRONG_SETUP
    complaint = capsys.readouterr().err.splitlines()[-1]
    assert complaint.endswith(f"error: argument {flag}: must be {allowed}, not {value}")


def test_the_longest_and_shortest_durations_are_accepted(run: Run) -> None:
    assert run("keys", "create", "farmer", "tablet", "--hours", "8784")[0] == OK
    assert run("keys", "rotate", "tablet", "--overlap-hours", "0")[0] == OK
    with pytest.raises(SystemExit):
        run("keys", "create", "farmer", "other", "--hours", "0")


def test_the_log_is_exported_and_verified(run: Run, tmp_path: Path) -> None:
    run("keys", "create", "farmer", "tablet")
    run("keys", "rotate", "broker")
    rows = [json.loads(line) for line in run("audit", "export")[1].splitlines()]
    assert [(row["role"], row["action"]) for row in rows] == [
        ("shell", "keys.create"),
        ("shell", "keys.rotate"),  # The new key
        ("shell", "keys.rotate"),  # The old one
    ]
    assert run("audit", "verify") == (OK, "3 rows, intact\n", "")
    database = preparation.open_database(Config(state_dir=tmp_path))
    with database.write() as connection:
        connection.execute(text("DROP TRIGGER audit_never_changes"))
        connection.execute(text("UPDATE audit SET object = 'keys/other' WHERE id = 2"))
    database.close()
    code, _, complaint = run("audit", "verify")
    assert code == FAILED
    assert "row 2 has been changed" in complaint


def test_a_key_whose_file_cannot_be_written_is_not_made_and_the_old_one_stays(
    run: Run, tmp_path: Path
) -> None:
    assert run("migrate")[0] == OK
    before = known(tmp_path)
    (tmp_path / "keys" / "farmer.new").mkdir()  # In the way, as a read-only folder of secrets is
    code, _, complaint = run("keys", "rotate", "farmer")
    assert code == FAILED
    assert "farmer.new" in complaint
    assert known(tmp_path) == before


def test_a_key_that_is_replaced_twice_in_its_overlap_keeps_its_name(
    run: Run, tmp_path: Path
) -> None:
    run("migrate")
    for _ in range(2):
        assert run("keys", "rotate", "farmer", "--overlap-hours", "24")[0] == OK
    names = sorted(key.name for key in known(tmp_path).values() if key.name.startswith("farmer"))
    replaced = [name.removeprefix("farmer.replaced-") for name in names[1:]]
    assert names[0] == "farmer"
    assert len(replaced) == 2
    assert set(replaced) < set(known(tmp_path))
