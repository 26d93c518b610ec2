"""Secrets: each is what its program takes, is made once, and is nobody else's."""

import base64
import hashlib
import shutil
import stat
from pathlib import Path

import pytest

from deploy import secret_files
from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role
from edge_server.uplinks.mqtt_connection import read_login
from mavlink_broker.mavlink.signing import KeyRing
from uav_firmware.drivers.key_file import read_key


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with secrets: a password is hashed slowly, on purpose."""
    made = tmp_path_factory.mktemp("made") / "secrets"
    secret_files.prepare(made, vehicles=2)
    return made


@pytest.fixture
def folder(prepared: Path, tmp_path: Path) -> Path:
    """A copy of it for one test."""
    return Path(shutil.copytree(prepared, tmp_path / "secrets"))


def test_every_role_has_its_own_access_key(folder: Path) -> None:
    found = {(folder / f"{role.value}.key").read_text().strip() for role in Role}
    assert len(found) == len(Role)
    assert all(keys.prefix_of(key) for key in found)


@pytest.mark.thorough
def test_vehicle_and_broker_read_the_same_signing_key(folder: Path) -> None:
    ring = KeyRing(folder)
    first, second = (read_key(folder / f"signing-{number}.key") for number in (1, 2))
    assert (ring.key_of(1, 0.0), ring.key_of(2, 0.0)) == (first, second)
    assert first != second


def test_nobody_but_the_owner_reads_a_secret(folder: Path) -> None:
    modes = {stat.S_IMODE(file.stat().st_mode) for file in folder.iterdir()}
    assert modes == {0o400}
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.thorough
def test_the_mqtt_broker_knows_who_logs_in_without_the_passwords(folder: Path) -> None:
    lines = (folder / "mosquitto.passwd").read_text().splitlines()
    for line, name in zip(lines, ("uplink.key", "cloud-mqtt.key"), strict=True):
        login = read_login(folder / name)
        user, _, hashed = line.partition(":")
        _, kind, rounds, salt, digest = hashed.split("$")
        again = hashlib.pbkdf2_hmac(
            "sha512", login.password.encode(), base64.b64decode(salt), int(rounds)
        )
        assert (user, kind) == (login.user, "7")
        assert base64.b64decode(digest) == again
        assert login.password not in line


def test_the_edge_server_has_the_password_of_the_database(folder: Path) -> None:
    password = (folder / "postgres.password").read_text().strip()
    assert (folder / "pgpass").read_text() == f"*:*:*:*:{password}\n"


def test_a_second_run_changes_nothing(folder: Path) -> None:
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert secret_files.prepare(folder, vehicles=2) == []
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def test_a_second_run_adds_what_is_missing(folder: Path) -> None:
    (folder / "farmer.key").unlink()
    assert secret_files.prepare(folder, vehicles=3) == ["farmer.key", "signing-3.key"]


def test_one_is_replaced_and_the_rest_stay(folder: Path) -> None:
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert secret_files.main([str(folder), "--replace", "broker.key"]) == 0
    after = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert {name for name in after if after[name] != before[name]} == {"broker.key"}


def test_what_is_no_secret_of_ours_is_not_replaced(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(folder.iterdir())
    assert secret_files.main([str(folder), "--replace", "butcher.key"]) == 1
    assert "butcher.key" in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before


def test_a_folder_that_cannot_be_written_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert secret_files.main([str(tmp_path / "file")]) == 1
    assert "file" in capsys.readouterr().err
