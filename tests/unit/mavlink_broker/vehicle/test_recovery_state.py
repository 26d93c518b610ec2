"""What is noted of a vehicle is in its record, and a recalled record is noted again."""

from mavlink_broker.autopilots.families import ModeRole
from mavlink_broker.vehicle.control_authority import ObservedMode
from mavlink_broker.vehicle.recovery_record import (
    EMPTY_RECORD,
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecoveryRecord,
)
from mavlink_broker.vehicle.recovery_state import RecoveryState
from mavlink_broker.vehicle.telemetry import Position, Snapshot

ABORT = PendingAbort(work_id=7, event_type=1)
RETURN = PendingReturn(mission="3/plan", reason="GPS lost")
LIVE = LiveCommandProgress(name="3/plan/1201/2")


def noted() -> RecoveryState:
    state = RecoveryState()
    state.note_abort(ABORT)
    state.note_return(RETURN)
    state.note_live(LIVE)
    state.note_segment("3/plan/1201/1", 41.5)
    state.note_flying("3/plan/1201/1")
    place = Snapshot(armed=True, position=Position(58.0, 15.0, 30.0, 0.0))
    brake = ObservedMode("BRAKE", ModeRole.PAUSED, armed=True)
    state.hover.begin(place, brake, in_this_mode=True)
    return state


def test_a_recalled_record_gives_the_same_record() -> None:
    record = noted().record
    again = RecoveryState()
    again.recall(record)
    assert again.record == record
    assert (again.live, again.segment) == (LIVE, "3/plan/1201/1")


def test_what_is_cleared_leaves_the_record_empty() -> None:
    state = noted()
    state.clear_abort()
    state.clear_return()
    state.clear_commands()
    state.hover.end()
    assert state.record == EMPTY_RECORD


def test_an_abort_stays_noted_while_its_missions_may_be_handed_out_again() -> None:
    state = RecoveryState()
    state.note_abort(ABORT)
    state.hold_abort(ABORT)
    state.clear_abort()
    assert state.record.abort == ABORT
    state.release_abort()
    assert state.record.abort is None


def test_another_vehicle_begins_with_the_aborts_alone() -> None:
    state = noted()
    state.forget()
    assert state.record == RecoveryRecord(abort=noted().record.abort)


def test_without_a_journal_everything_counts_as_stored() -> None:
    assert noted().is_stored
