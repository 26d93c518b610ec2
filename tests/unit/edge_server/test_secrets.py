"""Secrets that others can read: the mode of our own is restricted, a configured one is refused."""

import errno
import logging
import os
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.process import key_files
from edge_server.process.key_files import SecretFileError
from edge_server.process.preparation import prepare
from edge_server.store.rows.keys import Role

GIVEN = {
    "tls_key_file": "EDGE_TLS_KEY_FILE",
    "cloud_jws_key_file": "CLOUD_JWS_KEY_FILE",
    "cloud_key_file": "CLOUD_KEY_FILE",
}


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """A configured secret."""
    path = tmp_path / "secret"
    path.write_text("secret", encoding="ascii")
    path.chmod(0o600)
    return path


@pytest.mark.parametrize("name", GIVEN)
@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o602, 0o610, 0o777])
def test_a_given_secret_that_others_can_read_is_refused(secret: Path, name: str, mode: int) -> None:
    secret.chmod(mode)
    with pytest.raises(SecretFileError, match=rf"{GIVEN[name]}.*{mode:04o}"):
        key_files.check_given(Config(**{name: secret}))  # type: ignore[arg-type]  # one of three


@pytest.mark.parametrize("mode", [0o600, 0o400])
def test_a_secret_that_only_its_owner_can_read_is_accepted(secret: Path, mode: int) -> None:
    secret.chmod(mode)
    key_files.check_given(Config(tls_key_file=secret, cloud_key_file=secret))


def test_a_missing_secret_is_named(tmp_path: Path) -> None:
    with pytest.raises(SecretFileError, match=r"EDGE_TLS_KEY_FILE.*No such file"):
        key_files.check_given(Config(tls_key_file=tmp_path / "none"))


def test_an_invalid_signature_key_stops_the_start(secret: Path, tmp_path: Path) -> None:
    config = Config(state_dir=tmp_path / "state", cloud_jws_key_file=secret)
    with pytest.raises(SecretFileError, match="CLOUD_JWS_KEY_FILE"):
        prepare(config)
    assert not config.keys_dir.exists()


def test_the_mode_of_our_own_files_is_restricted_at_the_start(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = Config(state_dir=tmp_path)
    prepare(config)
    path = key_files.path_of(config.keys_dir, Role.ADMIN)
    path.chmod(0o644)
    config.database_path.chmod(0o644)
    with caplog.at_level(logging.WARNING):
        prepare(config)
    assert path.stat().st_mode & 0o777 == 0o600
    assert config.database_path.stat().st_mode & 0o777 == 0o600
    assert str(path) in caplog.text
    caplog.clear()
    prepare(config)
    assert str(path) not in caplog.text


@pytest.mark.parametrize("number", [errno.EPERM, errno.EROFS])
def test_a_file_mode_that_cannot_be_changed_is_logged_and_the_start_goes_on(
    tmp_path: Path,
    number: int,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    path = tmp_path / "admin.key"
    path.touch(mode=0o644)

    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "chmod", refuse)
    key_files.restrict(path)
    assert f"{path} can be read by others, and its mode cannot be changed" in caplog.text
