"""What is noted of a vehicle is in its record, and a recalled record is noted again."""

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import OverriddenParameter, OverriddenPlan
from mavlink_broker.microservices.mission_protocol import FENCE, RALLY
from mavlink_broker.vehicle.control_authority import ObservedMode
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecoveryRecord,
    RecoveryState,
    merge_records,
)
from mavlink_broker.vehicle.telemetry import Position, Snapshot

ABORT = PendingAbort(work_id=7, event_type=1)
RETURN = PendingReturn(mission="3/plan", reason="GPS lost")
LIVE = LiveCommandProgress(name="3/plan/1201/2")


def noted() -> RecoveryState:
    state = RecoveryState()
    state.abort = ABORT
    state.pending_return = RETURN
    state.live = LIVE
    state.note_segment("3/plan/1201/1", 41.5)
    state.note_flying("3/plan/1201/1")
    place = Snapshot(armed=True, position=Position(58.0, 15.0, 30.0, 0.0))
    brake = ObservedMode("BRAKE", ModeRole.PAUSED, armed=True)
    state.hover.begin(place, brake, in_this_mode=True)
    return state


def test_a_recalled_record_gives_the_same_record() -> None:
    record = noted().record
    again = RecoveryState()
    again.recall(record, 0.0)
    assert again.record == record
    assert (again.live, again.segment) == (LIVE, "3/plan/1201/1")


def test_what_is_cleared_leaves_the_record_empty() -> None:
    state = noted()
    state.abort = None
    state.pending_return = None
    state.clear_commands()
    state.hover.end()
    assert state.record == EMPTY_RECORD


def test_an_abort_stays_noted_while_its_missions_may_be_handed_out_again() -> None:
    state = RecoveryState()
    state.abort = ABORT
    state.held_abort = ABORT
    state.abort = None
    assert state.record.abort == ABORT
    state.held_abort = None
    assert state.record.abort is None


def test_another_vehicle_begins_with_the_aborts_alone() -> None:
    state = noted()
    state.forget()
    assert state.record == RecoveryRecord(abort=noted().record.abort)


def test_without_a_journal_everything_counts_as_stored() -> None:
    assert noted().is_stored


OPERATORS, FIRST, SECOND = ((MissionItem(command=number),) for number in (5001, 5002, 5003))
EARLIER = RecoveryRecord(
    plans={FENCE: OverriddenPlan(OPERATORS, FIRST)},
    values={"A": OverriddenParameter(1.0, (2.0,)), "B": OverriddenParameter(5.0, (6.0,))},
    pending_return=PendingReturn(mission="1", reason=""),
)
LATER = RecoveryRecord(
    plans={FENCE: OverriddenPlan(FIRST, SECOND), RALLY: OverriddenPlan((), FIRST)},
    values={"A": OverriddenParameter(2.0, (3.0,)), "C": OverriddenParameter(7.0, (8.0,))},
)


def test_the_original_value_of_the_earlier_record_counts() -> None:
    both = merge_records(EARLIER, LATER)
    assert both.plans[FENCE] == OverriddenPlan(OPERATORS, SECOND)
    assert both.plans[RALLY] == OverriddenPlan((), FIRST)
    assert both.values["A"] == OverriddenParameter(1.0, (2.0, 3.0))
    assert (both.values["B"].before, both.values["C"].before) == (5.0, 7.0)
    assert both.pending_return == EARLIER.pending_return


def test_an_empty_record_changes_nothing() -> None:
    assert merge_records(EMPTY_RECORD, LATER) == merge_records(LATER, EMPTY_RECORD) == LATER
