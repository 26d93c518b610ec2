from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.drivers.key_file import KEY_LENGTH, KeyFileError, read_key

KEY = bytes(range(32))


def key_file(folder: Path, contents: bytes, mode: int = 0o600) -> Path:
    path = folder / "signing.key"
    path.unlink(missing_ok=True)
    path.write_bytes(contents)
    path.chmod(mode)
    return path


@pytest.mark.parametrize(
    "contents",
    [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n"],
    ids=["raw", "hex", "HEX"],
)
def test_a_key_is_read_raw_or_as_digits(tmp_path: Path, contents: bytes) -> None:
    assert read_key(key_file(tmp_path, contents)) == KEY


@given(st.binary(min_size=KEY_LENGTH, max_size=KEY_LENGTH).filter(any))
def test_any_32_bytes_but_zeros_are_a_key(
    tmp_path_factory: pytest.TempPathFactory, key: bytes
) -> None:
    folder = tmp_path_factory.mktemp("keys")
    assert read_key(key_file(folder, key)) == key
    assert read_key(key_file(folder, key.hex().encode() + b"\n")) == key


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_key_that_others_may_touch_is_none(tmp_path: Path, mode: int) -> None:
    with pytest.raises(KeyFileError, match=r"signing.key.*chmod"):
        read_key(key_file(tmp_path, KEY, mode))


@pytest.mark.parametrize(
    "contents", [b"", bytes(32), b"0" * 64, KEY[:31], KEY.hex().encode()[:-1], b"\xff" * 64]
)
def test_anything_else_is_refused_by_name(tmp_path: Path, contents: bytes) -> None:
    with pytest.raises(KeyFileError, match=r"signing.key"):
        read_key(key_file(tmp_path, contents))


def test_a_missing_file_is_told_as_such(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_key(tmp_path / "none.key")
