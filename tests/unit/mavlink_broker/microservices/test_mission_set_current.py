"""The current item is set and confirmed by the vehicle."""

from mavlink_broker.mavlink.dialect import Message, MissionCurrent, mavlink
from mavlink_broker.microservices.command import Accepted, Refused, RoundTrip
from mavlink_broker.microservices.mission_protocol import MissionSetCurrent
from tests.unit.mavlink_broker.microservices.harness import (
    ROUTE,
    acknowledgement,
    kinds,
    received,
    tick_until,
)

SET = mavlink.MAV_CMD_DO_SET_MISSION_CURRENT


def select() -> MissionSetCurrent:
    one = MissionSetCurrent(0, ROUTE, RoundTrip())
    one.start(0.0)
    return one


def current(seq: int) -> Message:
    return received(MissionCurrent(seq))


def test_an_acknowledgement_alone_is_not_enough() -> None:
    one = select()
    assert kinds(one.receive(acknowledgement(SET, 0), 0.1)) == ["COMMAND_LONG"]
    assert one.outcome is None
    one.receive(current(4), 0.2)
    assert one.outcome is None
    one.receive(current(0), 0.3)
    assert one.outcome == Accepted()


def test_an_index_from_before_the_command_proves_nothing() -> None:
    one = select()
    one.receive(current(0), 0.1)
    assert one.outcome is None


def test_a_refusal_leads_to_the_older_message() -> None:
    one = select()
    sent = one.receive(acknowledgement(SET, mavlink.MAV_RESULT_UNSUPPORTED), 0.1)
    assert kinds(sent) == ["MISSION_SET_CURRENT", "COMMAND_LONG"]
    one.receive(current(0), 0.2)
    assert one.outcome == Accepted()


def test_a_vehicle_that_stays_at_its_old_item_is_not_started() -> None:
    one = select()
    one.receive(acknowledgement(SET, 0), 0.1)
    for second in range(40):
        one.receive(current(7), float(second))
        tick_until(one, second, second + 0.9)
    assert isinstance(one.outcome, Refused)
    assert "item 0" in one.outcome.reason


def test_the_take_off_behind_a_change_of_speed_proves_it_too() -> None:
    """ArduPilot counts only what it navigates to."""
    one = MissionSetCurrent(1, ROUTE, RoundTrip(), shown_as=range(1, 3))
    one.start(0.0)
    one.receive(acknowledgement(SET, 0), 0.1)
    one.receive(current(3), 0.2)
    assert one.outcome is None
    one.receive(current(2), 0.3)
    assert one.outcome == Accepted()


def denied(seq: int) -> Message:
    return received(MissionCurrent(seq, 5, mavlink.MISSION_STATE_NO_MISSION))


def test_a_vehicle_that_denies_its_mission_for_good_finds_it_infeasible() -> None:
    one = select()
    one.receive(acknowledgement(SET, 0), 0.1)
    for tenth in range(1, 60):
        one.receive(denied(0), tenth / 10)
    assert isinstance(one.outcome, Refused)
    assert "not feasible" in one.outcome.reason


def test_a_vehicle_may_take_a_moment_to_find_its_mission_feasible() -> None:
    one = select()
    one.receive(acknowledgement(SET, 0), 0.1)
    one.receive(denied(0), 0.2)
    one.receive(denied(0), 2.2)
    assert one.outcome is None
    one.receive(received(MissionCurrent(0, 5, mavlink.MISSION_STATE_NOT_STARTED)), 3.2)
    assert one.outcome == Accepted()


def test_a_current_item_that_is_sent_once_a_second_and_lost_is_waited_for() -> None:
    one = select()
    one.receive(acknowledgement(SET, 0), 0.1)
    tick_until(one, 0.1, 6.0)
    assert one.outcome is None
    one.receive(current(0), 6.1)
    assert one.outcome == Accepted()
