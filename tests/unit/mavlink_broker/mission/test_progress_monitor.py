"""Progress from a vehicle's numbers: never back, never too far."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.mission_item import change_speed, delay, return_to_launch, waypoint
from mavlink_broker.mission.progress_monitor import Progress
from mavlink_broker.planning.mission import FASTEST_M_S, FlightPlan

WAYPOINT = waypoint(latitude_deg=1.0, longitude_deg=2.0, relative_altitude_m=5.0)

# Speed, take-off and its waypoint; a waypoint; home.
LANDING = FlightPlan(
    items=(change_speed(5.0), WAYPOINT, WAYPOINT, WAYPOINT, return_to_launch()),
    command_of_item=(0, 0, 0, 1, 2),
    done_item=(2, 3, 4),
    notes=((), (), ()),
    first_item=0,
    ends_on_ground=True,
)
HOVERING = FlightPlan(
    items=(WAYPOINT, WAYPOINT, WAYPOINT),
    command_of_item=(0, 1, 1),
    done_item=(0, 1),
    notes=((), ()),
    first_item=0,
    ends_on_ground=False,
)

reports = st.lists(
    st.tuples(st.sampled_from(["current", "reached", "landing"]), st.integers(0, 10))
)


def updated(progress: Progress, update: tuple[str, int]) -> Progress:
    kind, seq = update
    match kind:
        case "current":
            return progress.with_current(seq)
        case "reached":
            return progress.with_reached(seq)
        case _:
            return progress.with_landing()


@given(reports)
def test_never_goes_back(sequence: list[tuple[str, int]]) -> None:
    progress, before = Progress(LANDING), 0
    for update in sequence:
        progress = updated(progress, update)
        assert progress.finished_commands >= before
        before = progress.finished_commands


@given(reports)
def test_a_landing_mission_is_not_finished_in_the_air(sequence: list[tuple[str, int]]) -> None:
    progress = Progress(LANDING)
    for update in sequence:
        progress = updated(progress, update)
    assert not progress.is_finished or progress.on_ground


def test_being_beyond_an_item_proves_that_it_was_reached() -> None:
    assert Progress(LANDING).with_current(2).finished_commands == 0
    assert Progress(LANDING).with_current(3).finished_commands == 1
    assert Progress(LANDING).with_current(4).finished_commands == 2


def test_a_reached_item_counts_before_the_next_one_is_current() -> None:
    progress = Progress(LANDING).with_current(2)
    assert progress.with_reached(2).finished_commands == 1


def test_an_item_that_was_never_current_cannot_have_been_reached() -> None:
    assert Progress(LANDING).with_current(1).with_reached(4).finished_commands == 0


def test_the_last_command_is_finished_on_the_ground() -> None:
    flown = Progress(LANDING).with_current(4).with_reached(4)
    assert not flown.is_finished
    assert flown.with_landing().is_finished


def test_standing_on_the_ground_at_the_start_finishes_nothing() -> None:
    progress = Progress(LANDING).with_landing().with_current(4)
    assert progress.finished_commands == 2


def test_a_hovering_mission_is_finished_on_arrival() -> None:
    assert not Progress(HOVERING).with_current(1).is_finished
    assert Progress(HOVERING).with_current(1).with_reached(1).is_finished
    assert Progress(HOVERING).with_current(2).is_finished


def test_a_complete_mission_is_finished_wherever_it_was_seen_last() -> None:
    assert Progress(HOVERING).with_complete().is_finished
    assert Progress(LANDING).with_complete().with_landing().is_finished


def test_numbers_beyond_the_mission_are_ignored() -> None:
    assert Progress(LANDING).with_current(65535) == Progress(LANDING)


def test_a_flight_is_taken_up_after_what_was_finished() -> None:
    for finished in range(3):
        assert Progress.after(LANDING, finished).finished_commands == finished


def test_a_flight_takes_at_least_its_way_and_its_holds() -> None:
    """0.01 degrees of latitude are some 1,110 m; what is no place adds no way."""
    there = waypoint(latitude_deg=1.01, longitude_deg=2.0, relative_altitude_m=5.0, hold_s=7.0)
    items = (change_speed(5.0), WAYPOINT, there, delay(20.0), return_to_launch())
    plan = dataclasses.replace(LANDING, items=items)
    assert plan.least_time_s == pytest.approx(1110.0 / FASTEST_M_S + 27.0, abs=0.5)
    assert HOVERING.least_time_s == 0.0
