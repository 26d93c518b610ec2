"""Whether what must outlive the broker is on the disk: waited for, but never for long."""

import logging

import pytest

from mavlink_broker.recovery.progress import PATIENCE_S, Diary
from mavlink_broker.recovery.record import NOTHING, Homeward, Memo, Owner

OWNER = Owner(1, "")
ONE = Memo(homeward=Homeward(mission="1/plan", reason="GPS"))
OTHER = Memo(homeward=Homeward(mission="2/plan", reason="GPS"))


def opened(memo: Memo = NOTHING) -> Diary:
    diary = Diary(in_use=True)
    diary.open(OWNER, memo)
    return diary


def test_without_a_disk_everything_counts_as_kept() -> None:
    diary = Diary()
    assert diary.see(ONE, 0.0) is None
    assert diary.is_kept(ONE)
    assert diary.is_settled


def test_before_it_is_known_whose_it_is_nothing_is_kept() -> None:
    diary = Diary(in_use=True)
    assert not diary.is_kept(NOTHING)
    assert diary.see(ONE, 0.0) is None
    assert diary.is_settled


def test_what_is_new_is_kept_when_the_disk_says_so() -> None:
    diary = opened()
    assert diary.is_kept(NOTHING)
    assert not diary.is_kept(ONE)
    note = diary.see(ONE, 0.0)
    assert note is not None
    assert (note.owner, note.memo) == (OWNER, ONE)
    assert not diary.is_kept(ONE)
    assert not diary.is_settled
    diary.settle(note.number)
    assert diary.is_kept(ONE)
    assert not diary.is_kept(OTHER)


def test_what_stands_there_already_is_no_news() -> None:
    diary = opened(ONE)
    assert diary.see(ONE, 0.0) is None
    assert diary.is_kept(ONE)


def test_the_newest_page_counts() -> None:
    diary = opened()
    first, second = diary.see(ONE, 0.0), diary.see(OTHER, 0.0)
    assert first is not None
    assert second is not None
    diary.settle(first.number)
    assert not diary.is_settled
    diary.settle(second.number)
    assert diary.is_kept(OTHER)


def test_a_disk_that_does_not_answer_is_not_waited_for(caplog: pytest.LogCaptureFixture) -> None:
    diary = opened()
    with caplog.at_level(logging.WARNING):
        diary.see(ONE, 0.0)
        diary.see(OTHER, PATIENCE_S - 0.1)
        assert not diary.is_kept(OTHER)
        diary.see(OTHER, PATIENCE_S)
        assert diary.is_kept(OTHER)
        diary.see(ONE, PATIENCE_S + 1.0)
        assert diary.is_kept(ONE)
    assert len(caplog.messages) == 1


def test_a_disk_that_answers_again_is_waited_for_again() -> None:
    diary = opened()
    diary.see(ONE, 0.0)
    diary.see(ONE, PATIENCE_S)
    late = diary.see(OTHER, PATIENCE_S + 1.0)
    assert late is not None
    diary.settle(late.number)
    diary.see(ONE, PATIENCE_S + 2.0)
    assert not diary.is_kept(ONE)
