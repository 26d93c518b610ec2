"""How many reads are on their way: loss does not matter, a link that becomes slower does."""

from mavlink_broker.ftp.window import AT_ONCE, LEAST, MOST, SPACING_S, ReadWindow


def window(round_trips_s: list[float]) -> ReadWindow:
    one, now = ReadWindow(), 0.0
    for round_trip_s in round_trips_s:
        now += 0.1
        one.answered(round_trip_s, now)
    return one


def test_it_opens_while_answers_come_as_fast_as_ever() -> None:
    assert ReadWindow().size == LEAST
    assert window([0.6] * 10).size == LEAST + 10
    assert window([0.6, 0.65, 0.7] * 50).size == MOST


def test_it_closes_when_they_come_twice_as_late_and_never_below_the_least() -> None:
    fast = [0.6] * 100
    assert window([*fast, 1.4]).size == MOST // 2
    assert window([*fast, *[1.4] * 100]).size == LEAST


def test_answers_that_were_on_their_way_together_halve_it_once() -> None:
    assert window([*[0.6] * 100, 5.0, 5.0, 5.0]).size == MOST // 2


def test_new_reads_are_spaced() -> None:
    one = window([0.6] * 100)
    assert one.allowance(100.0, 0) == AT_ONCE
    assert one.allowance(100.0, AT_ONCE) == 0
    assert one.allowance(100.0 + 2.5 * SPACING_S, AT_ONCE) == 2
    assert one.allowance(200.0, MOST - 1) == 1
    assert one.allowance(300.0, MOST + 5) == 0
