"""When a part that has died is started again, and when it is given up."""

from edge_server.supervisor import DEATHS, FIRST_WAIT_S, LONGEST_WAIT_S, WITHIN_S, Deaths


def test_the_wait_doubles_from_death_to_death_up_to_a_bound() -> None:
    deaths, now, waits = Deaths(), 0.0, []
    for _ in range(40):
        waits.append(deaths.note(now, now + 0.1))
        now += 0.1 + waits[-1]
    assert waits[:4] == [FIRST_WAIT_S * 2**number for number in range(4)]
    assert waits == sorted(waits)
    assert set(waits[10:]) == {LONGEST_WAIT_S}
    assert deaths.total == 40


def test_a_part_that_has_run_for_a_minute_is_started_again_at_once() -> None:
    deaths = Deaths()
    for _ in range(10):
        deaths.note(0.0, 1.0)
    assert deaths.note(100.0, 100.0 + WITHIN_S) == FIRST_WAIT_S


def test_five_deaths_within_a_minute_are_hopeless_and_over_more_time_they_are_not() -> None:
    quick, slow = Deaths(), Deaths()
    for number in range(DEATHS):
        assert not quick.are_hopeless
        quick.note(number, number + 1.0)
        slow.note(number * WITHIN_S, (number + 1) * WITHIN_S)
    assert quick.are_hopeless
    assert not slow.are_hopeless
