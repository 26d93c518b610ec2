"""Commands to items and back; items that other programs write; what is refused."""

import itertools
import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.commands import NavWaypoint
from afarcloud.faults import Fault, InvalidError
from afarcloud.plan import Mission
from afarcloud.wire import read_as, write
from edge_server.exchange import from_commands, qgc_plan, to_commands
from edge_server.exchange.mission_item import Place
from edge_server.exchange.to_commands import HANDLERS, HARMLESS, Translated
from tests.support.cases import failures
from tests.unit.edge_server.exchange.missions import (
    HOME,
    TAKEOFF,
    at,
    missions,
    plan_file,
    simple,
)


def translated(*items: dict[str, Any], **mission: Any) -> Translated:
    file = qgc_plan.read(plan_file(*items, **mission))
    return to_commands.translate(
        file.items, file.home, speed_m_s=file.speed_m_s, zero_yaw_is_unset=file.zero_yaw_is_unset
    )


def commands(*items: dict[str, Any], **mission: Any) -> list[tuple[int, dict[str, Any]]]:
    """What the items behind a take-off become."""
    found = translated(TAKEOFF, *items, **mission).commands[1:]
    return [(one["command_type_id"], one["parameters"]) for one in found]


def refusal(*items: dict[str, Any], **mission: Any) -> dict[str, str]:
    with pytest.raises(InvalidError) as refused:
        translated(TAKEOFF, *items, **mission)
    return {fault.path: fault.message for fault in refused.value.faults}


def mission_of(found: Translated) -> Mission:
    document = {
        "mission_id": 5,
        "vehicle_id": 1,
        "maximum_speed": found.maximum_speed_m_s,
        "command_array": found.commands,
    }
    return read_as(Mission, document)


@pytest.mark.thorough
@given(missions())
def test_out_and_in_again_gives_the_same_commands(mission: Mission) -> None:
    home = from_commands.home_of(mission)
    written = qgc_plan.write(
        from_commands.items_of(mission, home), home, mission.maximum_speed, None
    )
    file = qgc_plan.read(json.loads(json.dumps(written, allow_nan=False)))
    found = to_commands.translate(file.items, file.home, speed_m_s=file.speed_m_s)
    again = mission_of(found)
    assert found.warnings == []
    assert again.maximum_speed == mission.maximum_speed
    assert len(again.command_array) == len(mission.command_array)
    for ours, theirs in zip(mission.command_array, again.command_array, strict=True):
        assert_same(write(ours), write(theirs))


def assert_same(first: Any, second: Any) -> None:
    """Equal, numbers within a billionth."""
    if isinstance(first, dict):
        assert first.keys() == second.keys()
        for key in first:
            assert_same(first[key], second[key])
    elif isinstance(first, float):
        assert second == pytest.approx(first, rel=1e-9, abs=1e-9)
    else:
        assert first == second


def test_a_takeoff_without_a_place_is_at_home() -> None:
    (command,) = translated(simple(22, 15, 0, 0, 90, 0, 0, 12)).commands
    assert command["parameters"] == {
        "minimum_pitch": 15,
        "yaw_angle": 90,
        "latitude": HOME[0],
        "longitude": HOME[1],
        "altitude": 12,
    }


def test_a_waypoint_keeps_what_it_says_and_an_open_yaw_stays_open() -> None:
    ((kind, parameters),) = commands(at(16, 3, 2, 1, None))
    assert kind == 3
    assert parameters["hold_time"] == 3
    assert parameters["acceptance_radius"] == 2
    assert parameters["trajectory_control"] == 1
    assert parameters["desired_yaw_angle"] is None
    assert (parameters["latitude"], parameters["altitude"]) == (40.4435, 10)


def test_zero_is_north_to_px4_and_open_to_ardupilot() -> None:
    assert commands(at(16))[0][1]["desired_yaw_angle"] == 0
    assert commands(at(16), firmwareType=3)[0][1]["desired_yaw_angle"] is None


def test_an_altitude_above_the_sea_counts_from_home() -> None:
    assert commands(at(16, altitude=680.5, frame=0))[0][1]["altitude"] == 30.5
    found = refusal(at(16, altitude=680.5, frame=0), plannedHomePosition=[*HOME, None])
    assert "sea level" in found["mission.items.1"]


def test_delays_and_holds_are_holds() -> None:
    found = commands(at(16, 1), simple(93, 5, -1, -1, -1, frame=2), at(19, 7))
    assert [parameters["hold_time"] for _, parameters in found] == [6, 7]
    ((kind, parameters),) = commands(simple(93, 5, frame=2))
    assert (kind, parameters["hold_time"], parameters["latitude"]) == (3, 5, HOME[0])


def test_a_turn_is_the_heading_at_the_place_that_follows() -> None:
    found = commands(simple(115, 270, frame=2), at(16), at(16, 0, 0, 0, None))
    assert [parameters["desired_yaw_angle"] for _, parameters in found] == [270, None]


def test_the_first_speed_is_the_missions() -> None:
    speed = simple(178, 1, 3.5, -1, frame=2)
    assert translated(speed, TAKEOFF, at(16), speed).maximum_speed_m_s == 3.5
    assert translated(TAKEOFF, hoverSpeed=2).maximum_speed_m_s == 2
    assert translated(TAKEOFF, hoverSpeed=None).maximum_speed_m_s == 5


def test_a_hover_ends_a_mission() -> None:
    here = simple(17, 0, 0, 0, None, *HOME, 10)
    assert commands(at(16), here) == [commands(at(16))[0], (11, {"landing": False})]
    assert commands(at(16), at(17)) == commands(at(16))
    assert [kind for kind, _ in commands(at(17))] == [3]


def test_a_picture_looks_where_the_gimbal_was_turned() -> None:
    found = commands(
        simple(1000, -45, 90, None, None, 80, frame=2),
        simple(2000, 0, 0, 1, 7, frame=2),
        simple(205, -60, 0, 0, 0, 0, 0, 2, frame=2),
        simple(2000, 0, 2, 3, frame=2),
    )
    assert [(p["pitch_angle"], p["yaw_angle"]) for _, p in found] == [(-45, 90), (-60, None)]
    assert [(p["photo_count"], p["time_interval"]) for _, p in found] == [(1, 0), (3, 2)]


def test_a_picture_without_a_gimbal_looks_down_and_that_is_said() -> None:
    found = translated(TAKEOFF, simple(2000, 0, 0, 1, frame=2))
    assert found.commands[1]["parameters"]["pitch_angle"] == -90
    assert [warning.path for warning in found.warnings] == ["mission.items.1"]


def test_what_changes_nothing_is_left_out_with_a_word() -> None:
    for command in HARMLESS:
        found = translated(TAKEOFF, simple(int(command), frame=2), at(16))
        assert len(found.commands) == 2
        assert [warning.path for warning in found.warnings] == ["mission.items.1"]


def test_ardupilots_circles_are_hotpoints_one_a_turn() -> None:
    found = commands(at(18, 2, 0, -20))
    assert [kind for kind, _ in found] == [7, 7]
    assert found[0][1]["radius"] == 20
    assert found[0][1]["is_clockwise"] is False
    assert math.radians(found[0][1]["angular_velocity"]) * 20 == pytest.approx(5, rel=1e-3)


def test_a_bare_waypoint_on_the_circle_is_its_beginning() -> None:
    centre = Place(40.4435, -3.7382, 10.0)
    west = centre.moved(0.0, -15.0)
    begin = simple(16, 0, 0, 0, None, *west)
    circle = at(34, 15, 3, 0, math.tau)
    assert [parameters["start_point"] for _, parameters in commands(begin, circle)] == [2]
    with_hold = simple(16, 0, 2, 0, None, *west)
    assert [kind for kind, _ in commands(with_hold, circle)] == [3, 7]


@given(spacing=st.floats(3.0, 40.0), length=st.floats(1.0, 300.0), bend=st.floats(-200.0, 200.0))
def test_pictures_by_distance_are_stops_at_that_distance(
    spacing: float, length: float, bend: float
) -> None:
    start = Place(40.4435, -3.7382, 20.0)
    corner = start.moved(length, 0.0)
    end = corner.moved(50.0, bend)
    items = [
        simple(16, 0, 0, 0, None, *start),
        simple(206, spacing, 0, 1, frame=2),
        simple(16, 0, 0, 0, None, *corner),
        simple(16, 0, 0, 0, None, *end),
        simple(206, 0, 0, 0, frame=2),
        simple(16, 0, 0, 0, None, *start),
    ]
    found = commands(*items)
    flown = length + math.hypot(50.0, bend)
    pictures = [index for index, (kind, _) in enumerate(found) if kind == 4]
    if abs(flown / spacing - round(flown / spacing)) > 1e-3:  # Else either count is right
        assert len(pictures) == math.floor(flown / spacing) + 1
    stops = [place_before(found, index) for index in pictures]
    for before, after in itertools.pairwise(stops):
        assert before.distance_m(after) <= spacing + 0.01
    assert [kind for kind, _ in found][-2:] == [3, 3]  # Nothing on the way home


def place_before(found: list[tuple[int, dict[str, Any]]], index: int) -> Place:
    """Where the vehicle is at a command."""
    parameters = next(p for kind, p in reversed(found[:index]) if kind == 3)
    return Place(parameters["latitude"], parameters["longitude"], parameters["altitude"])


CASES = [
    ("never reached", [at(17), at(16)]),
    ("waits for a pilot", [at(16, autoContinue=False)]),
    ("no position", [simple(16, 0, 0, 0, None, 0, 0, 10)]),
    ("half a position", [simple(16, 0, 0, 0, None, 40.0, None, 10)]),
    ("no altitude", [simple(16, 0, 0, 0, None, 40.0, -3.0, None)]),
    ("frame 10", [at(16, frame=10)]),
    ("frame 2", [at(16, frame=2)]),
    ("one maximum_speed", [at(16), simple(178, 1, 3, -1)]),
    ("one maximum_speed", [simple(178, 1, 3, -1), simple(178, 1, 4, -1)]),
    ("climbing", [simple(178, 2, 3, -1)]),
    ("throttle", [simple(178, 1, 3, 50)]),
    ("throttle", [simple(178, 1, 3, -1, 1)]),
    ("no speed above 0", [simple(178, 1, -1, -1)]),
    ("by an angle", [simple(115, 90, 0, 1, 1), at(16)]),
    ("no place that follows", [simple(115, 90)]),
    ("time of day", [at(16), simple(93, -1, 12, 30, 0)]),
    ("no picture that follows", [simple(1000, -45, None, None, None, 32)]),
    ("no picture is in between", [simple(1000, -45), simple(1000, -50)]),
    ("from the vehicle's nose", [simple(1000, -45, 30, None, None, 32)]),
    ("at a rate", [simple(1000, None, None, 5, None, 0)]),
    ("more than to set the pitch", [simple(205, -45, 0, 30, 0, 0, 0, 2)]),
    ("more than to set the pitch", [simple(205, -45, 0, 0, 0, 0, 0, 4)]),
    ("without end", [simple(2000, 0, 2, 0)]),
    ("names a camera", [simple(2000, 3, 0, 1)]),
    ("fraction", [simple(2000, 0, 1.5, 3)]),
    ("names a camera", [simple(2500, 0, 0, 3)]),
    ("closer than", [simple(206, 0.1, 0, 1)]),
    ("no radius", [at(34, 0, 1, 0, math.tau)]),
    ("whole turns", [at(34, 10, 1, 0, 1.0)]),
    ("whole turns", [at(34, 10, 1, 0, 0)]),
    ("no orbit_type", [at(34, 10, 1, 2, math.tau)]),
    ("whole turns", [at(18, 0.5, 0, 10)]),
    ("no radius", [at(18, 1, 0, 0)]),
    ("full or half circle", [simple(2800, 90)]),
    ("no counterpart", [simple(177, 1, 3)]),
    ("no counterpart", [at(201)]),
    ("no counterpart", [simple(31_000)]),
    ("more than 700 commands", [at(16), simple(206, 0.5, 0, 1), at(16, altitude=11)]),
]


def check_refused(reason: str, items: list[dict[str, Any]]) -> None:
    if reason.startswith("more than 700"):
        items = [*items[:2], simple(16, 0, 0, 0, None, 40.4535, -3.7382, 10)]
    found = refusal(*items)
    assert any(reason in message for message in found.values())
    for path, message in found.items():
        number = int(path.rpartition(".")[2])
        assert message.startswith(f"item {number + 1} (")


def test_an_item_without_a_command_is_refused_with_number_and_reason() -> None:
    assert failures(check_refused, CASES) == []


def test_all_refusals_are_named_at_once() -> None:
    assert set(refusal(simple(177), at(16), at(201))) == {"mission.items.1", "mission.items.3"}


def test_a_mission_of_nothing_is_refused() -> None:
    with pytest.raises(InvalidError):
        translated()


parameter = st.none() | st.sampled_from([0, 1, -1, 2, 3, 90, 360, 1e8, 0.5]) | st.floats(-200, 200)


@pytest.mark.thorough
@given(
    st.lists(
        st.builds(
            lambda command, parameters, frame: simple(command, *parameters, frame=frame),
            st.sampled_from([*HANDLERS, *HARMLESS, 177, 9999]).map(int),
            st.lists(parameter, min_size=7, max_size=7),
            st.sampled_from([0, 2, 3, 6, 10]),
        ),
        max_size=8,
    )
)
def test_every_item_is_translated_warned_of_or_refused(items: list[dict[str, Any]]) -> None:
    found, refused = taken(items)
    assert {fault.path for fault in refused} <= {
        f"mission.items.{number}" for number in range(1, len(items) + 1)
    }
    if found is None:
        return
    named = set(found.paths) | {warning.path for warning in found.warnings}
    silent = {115, 178, 93, 1000, 205, 206, 17, 16}  # They belong to the command next to them
    for index, item in enumerate(items, start=1):
        assert f"mission.items.{index}" in named or item["command"] in silent


def taken(items: list[dict[str, Any]]) -> tuple[Translated | None, tuple[Fault, ...]]:
    """The translation, or the faults in its place."""
    try:
        return translated(TAKEOFF, *items), ()
    except InvalidError as error:
        return None, error.faults


def test_a_waypoint_that_belongs_to_a_follower_is_its_first_target() -> None:
    found = mission_of(translated(TAKEOFF, at(16, 0, 0, 0, None), simple(32, frame=2)))
    assert [one.command_type_id for one in found.command_array] == [1, 8]
    assert not any(isinstance(one, NavWaypoint) for one in found.command_array)


@pytest.mark.parametrize("command", [18, 34])
@pytest.mark.parametrize("radius", [1e-308, -1e-308, 4.9e-324])
def test_a_circle_of_no_size_is_refused(command: int, radius: float) -> None:
    parameters = (1.0, 0.0, radius, 0.0) if command == 18 else (radius, 3.0, 3.0, math.tau)
    with pytest.raises(InvalidError):
        mission_of(translated(TAKEOFF, simple(command, *parameters, 40.4434, -3.7382, 10.0)))
