"""The window of reads: loss does not matter, longer round trips do."""

from mavlink_broker.microservices.ftp_download import (
    MAX_NEW_REQUESTS,
    MAX_WINDOW,
    MIN_WINDOW,
    SPACING_S,
    ReadWindow,
)


def window(round_trips_s: list[float]) -> ReadWindow:
    one, now = ReadWindow(), 0.0
    for round_trip_s in round_trips_s:
        now += 0.1
        one.answered(round_trip_s, now)
    return one


def test_it_grows_while_round_trips_are_short() -> None:
    assert ReadWindow().size == MIN_WINDOW
    assert window([0.6] * 10).size == MIN_WINDOW + 10
    assert window([0.6, 0.65, 0.7] * 50).size == MAX_WINDOW


def test_it_halves_when_round_trips_double_down_to_the_minimum() -> None:
    fast = [0.6] * 100
    assert window([*fast, 1.4]).size == MAX_WINDOW // 2
    assert window([*fast, *[1.4] * 100]).size == MIN_WINDOW


def test_it_halves_once_per_round_trip() -> None:
    assert window([*[0.6] * 100, 5.0, 5.0, 5.0]).size == MAX_WINDOW // 2


def test_new_reads_are_spaced() -> None:
    one = window([0.6] * 100)
    assert one.allowance(100.0, 0) == MAX_NEW_REQUESTS
    assert one.allowance(100.0, MAX_NEW_REQUESTS) == 0
    assert one.allowance(100.0 + 2.5 * SPACING_S, MAX_NEW_REQUESTS) == 2
    assert one.allowance(200.0, MAX_WINDOW - 1) == 1
    assert one.allowance(300.0, MAX_WINDOW + 5) == 0
