"""Recovery records in a folder: a crash leaves the old one or the new one."""

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.microservices.config_overrides import OverriddenParameter
from mavlink_broker.recovery.encoding import MAX_BYTES, encode
from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.record import (
    EMPTY_RECORD,
    PendingReturn,
    RecoveryRecord,
    VehicleIdentity,
)

ONE, OTHER = VehicleIdentity(1, ""), VehicleIdentity(1, "00ff")
OLD = RecoveryRecord(borrowed={"CIRCLE_RATE": OverriddenParameter(20.0, (5.0,))})
NEW = RecoveryRecord(pending_return=PendingReturn(mission="1/plan", reason="GPS"))
STEPS = ("write", "fsync", "replace")


class KilledError(Exception):
    """The program is killed."""


def dies_at(monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    """Have the program killed before one of the steps of a write."""

    def die(*_: Any, **__: Any) -> None:
        raise KilledError

    if step == "replace":
        monkeypatch.setattr(Path, "replace", die)
    else:
        monkeypatch.setattr(os, "fsync" if step == "fsync" else "fdopen", die)


def test_each_vehicle_has_a_record_of_its_own(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path / "broker")
    folder.write(ONE, OLD)
    folder.write(OTHER, NEW)
    assert folder.read_all() == {ONE: OLD, OTHER: NEW}


def test_a_missing_folder_is_empty_and_not_created(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path / "broker")
    assert folder.read_all() == {}
    folder.write(ONE, EMPTY_RECORD)
    assert not folder.path.exists()


def test_the_file_of_an_empty_record_is_removed(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path)
    folder.write(ONE, OLD)
    folder.write(ONE, EMPTY_RECORD)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("step", STEPS)
def test_a_program_killed_during_a_write_leaves_the_old_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    folder = JournalFolder(tmp_path)
    folder.write(ONE, OLD)
    with monkeypatch.context() as patched:
        dies_at(patched, step)
        with pytest.raises(KilledError):
            folder.write(ONE, NEW)
    assert folder.read_all() == {ONE: OLD}
    folder.write(ONE, NEW)
    assert folder.read_all() == {ONE: NEW}


@pytest.mark.parametrize("length", range(0, len(encode(ONE, NEW)), 13))
def test_an_incomplete_write_leaves_the_old_record(tmp_path: Path, length: int) -> None:
    folder = JournalFolder(tmp_path)
    folder.write(ONE, OLD)
    (tmp_path / "vehicle-1.tmp").write_bytes(encode(ONE, NEW)[:length])
    assert folder.read_all() == {ONE: OLD}


def spoilt(content: bytes) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        path.write_bytes(content)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (spoilt(b""), "does not begin like a recovery record"),
        (spoilt(encode(ONE, OLD)[:-7]), "checksum"),
        (spoilt(encode(VehicleIdentity(2, ""), OLD)), "it is the record of system 2"),
        (spoilt(b"x" * (MAX_BYTES + 1)), "larger than"),
        (Path.mkdir, "not a regular file"),
        (os.mkfifo, "not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "not a regular file"),
    ],
)
def test_an_invalid_file_is_renamed_and_logged(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    spoil: Callable[[Path], None],
    reason: str,
) -> None:
    folder = JournalFolder(tmp_path)
    folder.write(OTHER, NEW)
    spoil(tmp_path / "vehicle-1.json")
    with caplog.at_level(logging.WARNING):
        assert folder.read_all() == {OTHER: NEW}
    (logged,) = caplog.messages
    assert "vehicle-1.json is rejected" in logged
    assert reason in logged
    assert os.path.lexists(tmp_path / "vehicle-1.bad")
    caplog.clear()
    assert folder.read_all() == {OTHER: NEW}
    assert caplog.messages == []
