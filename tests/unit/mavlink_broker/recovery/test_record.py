"""Two records of one vehicle are merged: the original values are those of the earlier one."""

from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import OverriddenParameter, OverriddenPlan
from mavlink_broker.microservices.mission_protocol import FENCE, RALLY
from mavlink_broker.vehicle.recovery_record import (
    EMPTY_RECORD,
    PendingReturn,
    RecoveryRecord,
    merge_records,
)

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
