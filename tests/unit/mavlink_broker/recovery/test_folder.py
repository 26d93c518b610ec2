"""Pages in a folder: the old one or the new one, whenever the program dies; nothing hostile."""

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.microservices.borrowed_parameters import Borrowed
from mavlink_broker.recovery.encoding import LARGEST_BYTES, encode
from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.record import NOTHING, Homeward, Memo, Owner

ONE, OTHER = Owner(1, ""), Owner(1, "00ff")
OLD = Memo(borrowed={"CIRCLE_RATE": Borrowed(20.0, (5.0,))})
NEW = Memo(homeward=Homeward(mission="1/plan", reason="GPS"))
STEPS = ("write", "fsync", "replace")


class KilledError(Exception):
    """The program ends here."""


def dies_at(monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    """Let the program die before one of the steps of a write."""

    def die(*_: Any, **__: Any) -> None:
        raise KilledError

    if step == "replace":
        monkeypatch.setattr(Path, "replace", die)
    else:
        monkeypatch.setattr(os, "fsync" if step == "fsync" else "fdopen", die)


def test_each_vehicle_has_a_page_of_its_own(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path / "broker")
    folder.write(ONE, OLD)
    folder.write(OTHER, NEW)
    assert folder.read_all() == {ONE: OLD, OTHER: NEW}


def test_a_folder_that_nobody_has_made_is_empty_and_stays_so(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path / "broker")
    assert folder.read_all() == {}
    folder.write(ONE, NOTHING)
    assert not folder.path.exists()


def test_a_page_with_nothing_on_it_is_removed(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path)
    folder.write(ONE, OLD)
    folder.write(ONE, NOTHING)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("step", STEPS)
def test_a_program_that_dies_in_a_write_leaves_the_old_page(
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
def test_a_write_that_the_machine_cut_short_leaves_the_old_page(
    tmp_path: Path, length: int
) -> None:
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
        (spoilt(b""), "does not begin like a page"),
        (spoilt(encode(ONE, OLD)[:-7]), "checksum"),
        (spoilt(encode(Owner(2, ""), OLD)), "it is the page of system 2"),
        (spoilt(b"x" * (LARGEST_BYTES + 1)), "larger than"),
        (Path.mkdir, "no plain file"),
        (os.mkfifo, "no plain file"),
        (lambda path: path.symlink_to("/dev/zero"), "no plain file"),
    ],
)
def test_what_is_no_page_is_set_aside_with_one_sentence(
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
    (told,) = caplog.messages
    assert "vehicle-1.json is not believed" in told
    assert reason in told
    assert os.path.lexists(tmp_path / "vehicle-1.bad")
    caplog.clear()
    assert folder.read_all() == {OTHER: NEW}
    assert caplog.messages == []
