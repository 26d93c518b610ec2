"""When a person whose lines have ended may leave."""

from sim.tester.terminal.operator import LINGER_S, NEXT_MISSION_WITHIN_S, ExitCondition
from sim.tester.vehicle.actions import Land
from sim.tester.vehicle.events import Armed, Command, MissionReceived
from sim.tester.vehicle.mission_steps import Item
from sim.tester.vehicle.stand_in import ORDER_WITHIN_S, StandIn
from sim.tester.vehicle.telemetry import Home


def vehicle(*, with_mission: bool = True) -> StandIn:
    found = StandIn(Home(40.4434, -3.7382, 650.0), 0.0)
    if with_mission:
        found.receive(MissionReceived([Item(command=22), Item(command=20)]), 0.0)
        found.receive(Armed(armed=True), 0.0)
        found.receive(Command(number=300, parameters=(0.0,) * 7), 0.0)
    return found


def test_who_has_seen_no_mission_leaves_at_once() -> None:
    bare = vehicle(with_mission=False)
    assert ExitCondition().is_due(bare, 5.0, is_asked=False, lines_left=False)


def test_lines_wait_for_the_first_mission_as_long_as_it_takes() -> None:
    bare, exit_condition = vehicle(with_mission=False), ExitCondition()
    for now in (0.0, 1e6):
        assert not exit_condition.is_due(bare, now, is_asked=False, lines_left=True)


def test_the_broker_hears_the_end_first() -> None:
    flying, exit_condition = vehicle(), ExitCondition()
    assert not exit_condition.is_due(flying, 5.0, is_asked=True, lines_left=False)
    assert not exit_condition.is_due(flying, 4.9 + LINGER_S, is_asked=True, lines_left=False)
    assert exit_condition.is_due(flying, 5.0 + LINGER_S, is_asked=True, lines_left=False)


def test_a_landing_is_waited_for() -> None:
    flying, exit_condition = vehicle(), ExitCondition()
    flying.act(Land(), 5.0)
    assert not exit_condition.is_due(flying, 5.0, is_asked=False, lines_left=False)
    assert not exit_condition.is_due(flying, 100.0, is_asked=False, lines_left=False)
    flying.tick(5.0 + ORDER_WITHIN_S)
    assert not exit_condition.is_due(flying, 100.0, is_asked=False, lines_left=False)
    assert exit_condition.is_due(flying, 100.0 + LINGER_S, is_asked=False, lines_left=False)


def test_lines_that_are_left_wait_for_another_mission_a_while() -> None:
    flown, exit_condition = vehicle(), ExitCondition()
    assert not exit_condition.is_due(flown, 5.0, is_asked=False, lines_left=True)
    assert not exit_condition.is_due(flown, 20.0, is_asked=True, lines_left=True)  # There it is
    assert not exit_condition.is_due(flown, 30.0, is_asked=False, lines_left=True)
    last = 30.0 + NEXT_MISSION_WITHIN_S
    assert not exit_condition.is_due(flown, last - 0.1, is_asked=False, lines_left=True)
    assert exit_condition.is_due(flown, last, is_asked=False, lines_left=True)
