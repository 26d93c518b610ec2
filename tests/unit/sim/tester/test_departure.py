"""When a person whose lines have ended may leave."""

from sim.tester.actions import Land
from sim.tester.departure import LINGER_S, NEXT_MISSION_WITHIN_S, Departure
from sim.tester.happenings import Armed, Command, MissionReceived
from sim.tester.stand_in import ORDER_WITHIN_S, StandIn
from sim.tester.steps import Item
from sim.tester.telemetry import Home


def vehicle(*, with_mission: bool = True) -> StandIn:
    found = StandIn(Home(40.4434, -3.7382, 650.0), 0.0)
    if with_mission:
        found.hear(MissionReceived([Item(command=22), Item(command=20)]), 0.0)
        found.hear(Armed(armed=True), 0.0)
        found.hear(Command(number=300, parameters=(0.0,) * 7), 0.0)
    return found


def test_who_has_seen_no_mission_leaves_at_once() -> None:
    bare = vehicle(with_mission=False)
    assert Departure().is_due(bare, 5.0, is_asked=False, lines_left=False)


def test_lines_wait_for_the_first_mission_as_long_as_it_takes() -> None:
    bare, departure = vehicle(with_mission=False), Departure()
    for now in (0.0, 1e6):
        assert not departure.is_due(bare, now, is_asked=False, lines_left=True)


def test_the_broker_hears_the_end_first() -> None:
    flying, departure = vehicle(), Departure()
    assert not departure.is_due(flying, 5.0, is_asked=True, lines_left=False)
    assert not departure.is_due(flying, 4.9 + LINGER_S, is_asked=True, lines_left=False)
    assert departure.is_due(flying, 5.0 + LINGER_S, is_asked=True, lines_left=False)


def test_a_landing_is_waited_for() -> None:
    flying, departure = vehicle(), Departure()
    flying.act(Land(), 5.0)
    assert not departure.is_due(flying, 5.0, is_asked=False, lines_left=False)
    assert not departure.is_due(flying, 100.0, is_asked=False, lines_left=False)
    flying.tick(5.0 + ORDER_WITHIN_S)
    assert not departure.is_due(flying, 100.0, is_asked=False, lines_left=False)
    assert departure.is_due(flying, 100.0 + LINGER_S, is_asked=False, lines_left=False)


def test_lines_that_are_left_wait_for_another_mission_a_while() -> None:
    flown, departure = vehicle(), Departure()
    assert not departure.is_due(flown, 5.0, is_asked=False, lines_left=True)
    assert not departure.is_due(flown, 20.0, is_asked=True, lines_left=True)  # There it is
    assert not departure.is_due(flown, 30.0, is_asked=False, lines_left=True)
    last = 30.0 + NEXT_MISSION_WITHIN_S
    assert not departure.is_due(flown, last - 0.1, is_asked=False, lines_left=True)
    assert departure.is_due(flown, last, is_asked=False, lines_left=True)
