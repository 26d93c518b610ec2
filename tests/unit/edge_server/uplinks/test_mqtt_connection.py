"""Who we are to the broker, and what is reported of it when it cannot be read."""

from pathlib import Path

import pytest

from edge_server.uplinks.mqtt_connection import LoginError, own_client_id, read_login


def written(folder: Path, content: bytes, mode: int = 0o600) -> Path:
    file = folder / "login"
    file.write_bytes(content)
    file.chmod(mode)
    return file


def test_the_password_may_hold_colons_and_any_letters(tmp_path: Path) -> None:
    file = written(tmp_path, "farm:s:ä cret\n".encode())
    assert read_login(file) == ("farm", "s:ä cret")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o660, 0o700 | 0o010])
def test_a_file_that_others_may_touch_is_refused(tmp_path: Path, mode: int) -> None:
    file = written(tmp_path, b"farm:secret", mode)
    with pytest.raises(LoginError, match="chmod 600") as refusal:
        read_login(file)
    assert "secret" not in str(refusal.value)


@pytest.mark.parametrize(
    "content", [b"", b"secret", b":secret", b"\xff\xfe:secret", b"\n\n", b"u:" + b"secret" * 6000]
)
def test_a_file_without_a_login_is_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(LoginError, match="login") as refusal:
        read_login(written(tmp_path, content))
    assert "secret" not in str(refusal.value)


def test_no_file_or_a_folder_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(LoginError, match="cannot be read"):
            read_login(path)


def test_a_name_is_drawn_once(tmp_path: Path) -> None:
    names = [own_client_id(tmp_path / "a"), own_client_id(tmp_path / "a")]
    assert names[0] == names[1]
    assert names[0] != own_client_id(tmp_path / "b")
    assert names[0].isalnum()
    assert len(names[0]) <= 23


@pytest.mark.parametrize("content", [b"", b"\xff\xff", b"two words", b"a/b"])
def test_a_broken_name_is_drawn_anew(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    name = own_client_id(tmp_path / "a")
    assert name.isalnum()
    assert own_client_id(tmp_path / "a") == name


def test_a_name_that_cannot_be_kept_serves_for_now(tmp_path: Path) -> None:
    assert own_client_id(tmp_path / "no" / "folder").isalnum()
