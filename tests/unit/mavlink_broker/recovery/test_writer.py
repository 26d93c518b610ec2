"""The thread that brings pages onto the disk: nobody waits for it, and it tries again."""

import logging
import threading
import time
from pathlib import Path

import pytest

from mavlink_broker.recovery import writer as writer_module
from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.progress import Note
from mavlink_broker.recovery.record import NOTHING, Homeward, Memo, Owner
from mavlink_broker.recovery.writer import JournalWriter

OWNER = Owner(1, "")
PATIENCE_S = 20.0


def memo(number: int) -> Memo:
    return Memo(homeward=Homeward(mission=str(number), reason=""))


class Loop:
    """Waits to be woken, as the broker's loop does."""

    def __init__(self) -> None:
        self._woken = threading.Event()
        self.settled: list[int] = []

    def wake(self) -> None:
        self._woken.set()

    def wait_for(self, writer: JournalWriter, number: int) -> None:
        """Wait until a page is settled."""
        end = time.monotonic() + PATIENCE_S
        while number not in self.settled:
            assert time.monotonic() < end
            self._woken.wait(0.1)
            self._woken.clear()
            self.settled += [settled for _, settled in writer.take_settled()]


def test_a_page_is_on_the_disk_when_it_is_settled(tmp_path: Path) -> None:
    loop, folder = Loop(), JournalFolder(tmp_path / "broker")
    writer = JournalWriter(folder, loop.wake)
    writer.put(Note(OWNER, 1, memo(1)))
    loop.wait_for(writer, 1)
    assert folder.read_all() == {OWNER: memo(1)}
    writer.close()


def test_the_next_run_recalls_what_this_one_has_noted(tmp_path: Path) -> None:
    first = JournalWriter(JournalFolder(tmp_path), lambda: None)
    assert first.recall(OWNER) == NOTHING
    for number in range(20):
        first.put(Note(OWNER, number, memo(number)))
    first.close()
    second = JournalWriter(JournalFolder(tmp_path), lambda: None)
    assert second.recall(OWNER) == memo(19)
    second.close()


def test_a_disk_that_refuses_is_told_of_once_and_tried_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer_module, "TRY_AGAIN_S", 0.05)
    place = tmp_path / "broker"
    place.write_text("a file where the folder should be")
    loop = Loop()
    with caplog.at_level(logging.WARNING):
        writer = JournalWriter(JournalFolder(place), loop.wake)
        for number in (1, 2, 3):
            writer.put(Note(OWNER, number, memo(number)))
            loop.wait_for(writer, number)
        refusals = [told for told in caplog.messages if "no journal is kept" in told]
        assert len(refusals) == 1
        assert str(place) in refusals[0]
        place.unlink()
        loop.settled.clear()
        loop.wait_for(writer, 3)
        writer.close()
    assert JournalFolder(place).read_all() == {OWNER: memo(3)}
    assert [told for told in caplog.messages if "takes the broker's journal again" in told]
