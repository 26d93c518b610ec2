"""Whether the newest recovery record is on the disk: waited for, but never for long."""

import logging

import pytest

from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    WRITE_TIMEOUT_S,
    PendingReturn,
    RecordTracker,
    RecoveryRecord,
    VehicleIdentity,
)

IDENTITY = VehicleIdentity(1, "")
ONE = RecoveryRecord(pending_return=PendingReturn(mission="1/plan", reason="GPS"))
OTHER = RecoveryRecord(pending_return=PendingReturn(mission="2/plan", reason="GPS"))


def loaded_tracker(record: RecoveryRecord = EMPTY_RECORD) -> RecordTracker:
    tracker = RecordTracker(in_use=True)
    tracker.load(IDENTITY, record)
    return tracker


def test_without_a_disk_every_record_counts_as_stored() -> None:
    tracker = RecordTracker()
    assert tracker.update(ONE, 0.0) is None
    assert tracker.is_stored(ONE)
    assert tracker.is_settled


def test_no_record_is_stored_before_the_identity_is_known() -> None:
    tracker = RecordTracker(in_use=True)
    assert not tracker.is_stored(EMPTY_RECORD)
    assert tracker.update(ONE, 0.0) is None
    assert tracker.is_settled


def test_a_new_record_is_stored_when_the_disk_confirms_it() -> None:
    tracker = loaded_tracker()
    assert tracker.is_stored(EMPTY_RECORD)
    assert not tracker.is_stored(ONE)
    update = tracker.update(ONE, 0.0)
    assert update is not None
    assert (update.identity, update.record) == (IDENTITY, ONE)
    assert not tracker.is_stored(ONE)
    assert not tracker.is_settled
    tracker.confirm(update.number)
    assert tracker.is_stored(ONE)
    assert not tracker.is_stored(OTHER)


def test_an_unchanged_record_is_not_written() -> None:
    tracker = loaded_tracker(ONE)
    assert tracker.update(ONE, 0.0) is None
    assert tracker.is_stored(ONE)


def test_the_newest_record_counts() -> None:
    tracker = loaded_tracker()
    first, second = tracker.update(ONE, 0.0), tracker.update(OTHER, 0.0)
    assert first is not None
    assert second is not None
    tracker.confirm(first.number)
    assert not tracker.is_settled
    tracker.confirm(second.number)
    assert tracker.is_stored(OTHER)


def test_a_disk_that_does_not_answer_is_not_waited_for(caplog: pytest.LogCaptureFixture) -> None:
    tracker = loaded_tracker()
    with caplog.at_level(logging.WARNING):
        tracker.update(ONE, 0.0)
        tracker.update(OTHER, WRITE_TIMEOUT_S - 0.1)
        assert not tracker.is_stored(OTHER)
        tracker.update(OTHER, WRITE_TIMEOUT_S)
        assert tracker.is_stored(OTHER)
        tracker.update(ONE, WRITE_TIMEOUT_S + 1.0)
        assert tracker.is_stored(ONE)
    assert len(caplog.messages) == 1


def test_a_disk_that_answers_again_is_waited_for_again() -> None:
    tracker = loaded_tracker()
    tracker.update(ONE, 0.0)
    tracker.update(ONE, WRITE_TIMEOUT_S)
    late = tracker.update(OTHER, WRITE_TIMEOUT_S + 1.0)
    assert late is not None
    tracker.confirm(late.number)
    tracker.update(ONE, WRITE_TIMEOUT_S + 2.0)
    assert not tracker.is_stored(ONE)
