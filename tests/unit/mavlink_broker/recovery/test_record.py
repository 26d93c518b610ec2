"""Two memos of one vehicle make one: what was there first is what was there."""

from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.borrowed_config import ExchangedPlan
from mavlink_broker.microservices.borrowed_parameters import Borrowed
from mavlink_broker.microservices.plan_kinds import FENCE, RALLY
from mavlink_broker.recovery.record import NOTHING, Homeward, Memo, merged

OPERATORS, FIRST, SECOND = ((MissionItem(command=number),) for number in (5001, 5002, 5003))
EARLIER = Memo(
    plans={FENCE: ExchangedPlan(OPERATORS, FIRST)},
    values={"A": Borrowed(1.0, (2.0,)), "B": Borrowed(5.0, (6.0,))},
    homeward=Homeward(mission="1", reason=""),
)
LATER = Memo(
    plans={FENCE: ExchangedPlan(FIRST, SECOND), RALLY: ExchangedPlan((), FIRST)},
    values={"A": Borrowed(2.0, (3.0,)), "C": Borrowed(7.0, (8.0,))},
)


def test_what_was_there_first_comes_back_whatever_was_set_last() -> None:
    both = merged(EARLIER, LATER)
    assert both.plans[FENCE] == ExchangedPlan(OPERATORS, SECOND)
    assert both.plans[RALLY] == ExchangedPlan((), FIRST)
    assert both.values["A"] == Borrowed(1.0, (2.0, 3.0))
    assert (both.values["B"].before, both.values["C"].before) == (5.0, 7.0)
    assert both.homeward == EARLIER.homeward


def test_nothing_adds_nothing() -> None:
    assert merged(NOTHING, LATER) == merged(LATER, NOTHING) == LATER
