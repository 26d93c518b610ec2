from pathlib import Path

import pytest

from mavlink_broker.mavlink.signing import RETRY_INTERVAL_S, KeyRing

KEY = bytes(range(32))


def put(folder: Path, system: int, contents: bytes, mode: int = 0o600) -> None:
    path = folder / f"signing-{system}.key"
    path.write_bytes(contents)
    path.chmod(mode)


@pytest.mark.parametrize("contents", [KEY, KEY.hex().encode() + b"\n"], ids=["raw", "hex"])
def test_a_key_is_read_raw_or_as_digits(tmp_path: Path, contents: bytes) -> None:
    put(tmp_path, 7, contents)
    ring = KeyRing(tmp_path)
    assert ring.key_of(7, 0.0) == KEY
    assert ring.key_of(8, 0.0) is None


def test_a_key_that_appears_later_is_read(tmp_path: Path) -> None:
    ring = KeyRing(tmp_path)
    assert ring.key_of(7, 0.0) is None
    put(tmp_path, 7, KEY)
    assert ring.key_of(7, RETRY_INTERVAL_S / 2) is None
    assert ring.key_of(7, RETRY_INTERVAL_S) == KEY


@pytest.mark.parametrize(
    ("contents", "mode"),
    [(KEY, 0o640), (KEY[:-1], 0o600), (bytes(32), 0o600), (b"\xff" * 64, 0o600), (b"", 0o600)],
)
def test_an_invalid_key_is_logged_and_not_used(
    tmp_path: Path, contents: bytes, mode: int, caplog: pytest.LogCaptureFixture
) -> None:
    put(tmp_path, 7, contents, mode)
    assert KeyRing(tmp_path).key_of(7, 0.0) is None
    assert "signing-7.key" in caplog.text
