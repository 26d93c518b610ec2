"""The time of day of results: it goes on through a flight, and is the machine's otherwise."""

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.fleet import LONGEST_FLIGHT_S, FleetTime

NOON = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


def at(seconds: float) -> datetime:
    return NOON + timedelta(seconds=seconds)


def test_it_is_not_known_before_the_machines_is() -> None:
    with pytest.raises(ValueError, match="not known before the first update"):
        FleetTime().at(1.0)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 600.0), st.floats(-86_400.0, 86_400.0), st.booleans()),
        min_size=1,
        max_size=20,
    )
)
def test_it_never_goes_back_in_a_flight_and_is_the_machines_on_the_ground(
    steps: list[tuple[float, float, bool]],
) -> None:
    time, now, ahead_s = FleetTime(), 0.0, 0.0
    time.update(NOON, now, is_flying=False)
    newest = time.at(now)
    for passes_s, step_s, is_flying in steps:
        now, ahead_s = now + passes_s, ahead_s + step_s
        time.update(at(now + ahead_s), now, is_flying=is_flying)
        if is_flying:
            assert time.at(now) >= newest
        else:
            assert abs(time.at(now) - at(now + ahead_s)) <= timedelta(milliseconds=1)
        newest = time.at(now)


def test_what_was_recorded_in_flight_has_its_time_also_behind_the_landing() -> None:
    """A picture is fetched when the vehicle has landed; the clock was set back meanwhile."""
    time = FleetTime()
    time.update(at(0.0), 0.0, is_flying=True)
    time.update(at(60.0 - 3600.0), 60.0, is_flying=True)
    time.update(at(90.0 - 3600.0), 90.0, is_flying=False)
    assert time.at(30.0) == at(30.0)
    assert time.at(80.0) == at(80.0)
    assert time.at(90.0) == at(90.0 - 3600.0)


def test_the_time_of_two_clocks_that_are_not_read_at_once_is_no_step() -> None:
    time = FleetTime()
    for now in range(0, int(LONGEST_FLIGHT_S) - 600, 60):
        time.update(at(now or 5e-6), float(now), is_flying=True)
    for late in range(int(LONGEST_FLIGHT_S) - 600, int(LONGEST_FLIGHT_S) + 1200, 60):
        time.update(at(late - 3600.0), float(late), is_flying=True)
        assert abs(time.at(late) - at(late)) < timedelta(seconds=0.1)


def test_a_vehicle_that_stays_armed_does_not_hold_it_for_ever() -> None:
    time = FleetTime()
    time.update(at(3600.0), 0.0, is_flying=True)
    for now in range(60, int(LONGEST_FLIGHT_S) + 180, 60):
        time.update(at(float(now)), float(now), is_flying=True)
    assert time.at(LONGEST_FLIGHT_S + 120.0) == at(LONGEST_FLIGHT_S + 120.0)
