"""Which of a vehicle's logs is of a flight, by the times that the vehicle lists."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.microservices.log_download import LogEntry
from mavlink_broker.vehicle.logged_flight import MAX_LOGS, FlownSpan, logs_of, own_logs_of

BOOT = 1_772_355_600


def span(armed_s: float, disarmed_s: float) -> FlownSpan:
    return FlownSpan(BOOT + armed_s, BOOT + disarmed_s, BOOT)


def listed(*times: int) -> list[LogEntry]:
    return [LogEntry(number, BOOT + at, 1000) for number, at in enumerate(times)]


def chosen(flight: FlownSpan, *times: int, has_end_times: bool = False) -> list[int]:
    found = logs_of(flight, listed(*times), has_end_times=has_end_times)
    return [entry.number for entry in found]


@pytest.mark.parametrize(
    ("armed_s", "disarmed_s", "expected"),
    [
        (100.5, 160.0, [0]),  # Its log begins shortly before arming is noticed
        (302.0, 360.0, [2, 1]),  # The log became too large: another one was begun
        (500.1, 530.0, [3]),
        (160.8, 199.0, [0]),  # Another flight that the first log goes on for
    ],
)
def test_a_log_lasts_from_its_beginning_to_the_next_one(
    armed_s: float, disarmed_s: float, expected: list[int]
) -> None:
    assert chosen(span(armed_s, disarmed_s), 98, 299, 330, 499) == expected


def test_a_flight_that_ends_as_the_next_log_begins_has_the_log_before() -> None:
    assert chosen(span(100.0, 160.0), 98, 160) == [0]
    assert chosen(span(160.5, 220.0), 98, 160) == [1]


def test_a_log_is_not_older_than_the_start_of_its_vehicle() -> None:
    assert chosen(span(100.0, 160.0), -86_400) == []
    assert chosen(span(100.0, 160.0), 0) == [0]  # It is written from the start on


def test_a_log_that_is_listed_with_its_end_lasts_from_the_one_before() -> None:
    assert chosen(span(100.0, 160.0), 60, 162, 300, has_end_times=True) == [1]
    assert chosen(span(170.0, 300.0), 60, 162, 300, has_end_times=True) == [2]
    assert chosen(span(310.0, 400.0), 60, 162, 300, has_end_times=True) == []


@pytest.mark.parametrize(("has_end_times", "expected"), [(False, ([0], [1])), (True, ([1], [0]))])
def test_a_log_is_of_the_nearest_of_flights_that_overlap_by_a_clock_that_went_back(
    *, has_end_times: bool, expected: tuple[list[int], list[int]]
) -> None:
    before, after = FlownSpan(100.0, 180.0, 0.0), FlownSpan(130.0, 170.0, 90.0)
    times = (170, 181) if has_end_times else (98, 129)
    entries = [LogEntry(number, at, 1000) for number, at in enumerate(times)]
    for flight, other, numbers in zip((before, after), (after, before), expected, strict=True):
        found = own_logs_of(flight, [other], entries, has_end_times=has_end_times)
        assert [entry.number for entry in found] == numbers


@given(
    flight=st.tuples(*[st.floats(-1e9, 1e10)] * 3).map(
        lambda times: FlownSpan(min(times[:2]), max(times[:2]), times[2])
    ),
    entries=st.lists(
        st.builds(LogEntry, st.integers(0, 65_535), st.integers(0, 2**32 - 1), st.just(1)),
        max_size=20,
    ),
    has_end_times=st.booleans(),
)
def test_whatever_is_listed_few_of_it_are_chosen_newest_first(
    flight: FlownSpan, entries: list[LogEntry], *, has_end_times: bool
) -> None:
    found = logs_of(flight, entries, has_end_times=has_end_times)
    assert len(found) <= MAX_LOGS
    assert set(found) <= set(entries)
    times = [entry.time_s for entry in found]
    assert times == sorted(times, reverse=True)
    if has_end_times and found:
        assert times[-1] >= flight.armed_s
