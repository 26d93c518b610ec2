"""What every vehicle refuses is refused at post, with the path of its command."""

from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from afarcloud.flyable import VehicleLimits, faults, reach_faults
from afarcloud.geodesy import shifted
from afarcloud.plan import Mission

PLACE = {"latitude": 40.4434, "longitude": -3.7382}
KINDS: dict[str, tuple[int, dict[str, Any]]] = {
    "takeoff": (1, PLACE | {"altitude": 5.0}),
    "land": (2, PLACE),
    "go": (3, PLACE | {"altitude": 5.0}),
    "picture": (4, {"pitch_angle": -90}),
    "turn": (7, PLACE | {"orbit_altitude": 5.0, "radius": 10.0, "angular_velocity": 5.0}),
    "home": (11, {"landing": True}),
    "hover": (11, {"landing": False}),
    "look": (9, {"corners": [[0.1, 0.1], [0.9, 0.9]], "track_mode": 3}),
    "follow": (9, {"corners": [[0.1, 0.1], [0.9, 0.9]], "track_mode": 0}),
}


def mission(*kinds: str, **change: Any) -> Mission:
    commands = [
        {
            "command_id": number,
            "command_type_id": KINDS[kind][0],
            "parameters": KINDS[kind][1] | (change if number == 1 else {}),
        }
        for number, kind in enumerate(kinds, start=1)
    ]
    return Mission.model_validate({"mission_id": 1, "vehicle_id": 1, "command_array": commands})


def refused(*kinds: str) -> list[int]:
    """Places of the commands that are refused."""
    found = [fault.path for fault in faults(mission(*kinds), "missions.0")]
    assert all(path.endswith(".command_type_id") for path in found)
    return [int(path.split(".")[3]) for path in found]


@pytest.mark.parametrize(
    ("kinds", "places"),
    [
        ("takeoff go home", []),
        ("takeoff takeoff home", [1]),
        ("takeoff go takeoff home", [2]),
        ("takeoff hover takeoff", [2]),
        ("takeoff follow takeoff land", [2]),
        ("go takeoff", [1]),
        ("look takeoff go home", []),
        ("takeoff land takeoff home", []),
        ("takeoff home picture takeoff land", []),
        ("takeoff land go", [2]),
        ("takeoff home turn land", [2, 3]),
        ("takeoff land land", [2]),
        ("takeoff land picture look", []),
        ("land", []),
        ("home takeoff home", []),
        ("picture", []),
    ],
)
def test_a_vehicle_takes_off_from_the_ground_alone_and_flies_in_the_air_alone(
    kinds: str, places: list[int]
) -> None:
    assert refused(*kinds.split()) == places


@pytest.mark.thorough
@given(kinds=st.lists(st.sampled_from(["takeoff", "go", "home", "picture"]), max_size=8))
def test_what_is_taken_is_what_a_vehicle_can_do_step_by_step(kinds: list[str]) -> None:
    """The oracle flies the list: on the ground only a take-off moves it, in the air all else."""
    assume(kinds)
    in_air: bool | None = None  # Nobody knows where it begins
    works = True
    for kind in kinds:
        if kind == "picture":
            continue
        if in_air is not None and (kind == "takeoff") == in_air:
            works = False
            break
        in_air = kind != "home"
    assert (refused(*kinds) == []) == works


@pytest.mark.parametrize(("altitude", "is_taken"), [(0.5, False), (0.99, False), (1.0, True)])
def test_a_takeoff_leaves_the_ground(altitude: float, is_taken: bool) -> None:
    found = list(faults(mission("takeoff", altitude=altitude), "missions.0"))
    expected = [] if is_taken else ["missions.0.command_array.0.parameters.altitude"]
    assert [fault.path for fault in found] == expected


@pytest.mark.parametrize(("rate_deg_s", "is_taken"), [(0.004, False), (0.0042, True)])
def test_a_turn_ends_within_a_day(rate_deg_s: float, is_taken: bool) -> None:
    found = list(faults(mission("turn", angular_velocity=rate_deg_s), "missions.0"))
    expected = [] if is_taken else ["missions.0.command_array.0.parameters.angular_velocity"]
    assert [fault.path for fault in found] == expected


@pytest.mark.parametrize(
    ("speed_m_s", "is_taken"), [(5e-324, False), (0.099, False), (0.1, True), (12.0, True)]
)
def test_a_mission_is_fast_enough_to_arrive(speed_m_s: float, is_taken: bool) -> None:
    slow = mission("takeoff", "go", "home").model_copy(update={"maximum_speed": speed_m_s})
    expected = [] if is_taken else ["missions.0.maximum_speed"]
    assert [fault.path for fault in faults(slow, "missions.0")] == expected


def going(*north_m: float | None) -> Mission:
    """A mission to places so far north of its first one; None: a follow, which ends anywhere."""
    whole = mission("takeoff", *("follow" if one is None else "go" for one in north_m))
    north = iter([0.0, *north_m])
    commands = []
    for command in whole.command_array:
        away_m = next(north)
        if away_m is None:
            commands.append(command)
            continue
        latitude = shifted(PLACE["latitude"], PLACE["longitude"], 0.0, away_m)[0]
        place = command.parameters.model_copy(update={"latitude": latitude})
        commands.append(command.model_copy(update={"parameters": place}))
    return whole.model_copy(update={"command_array": tuple(commands)})


@pytest.mark.parametrize(
    ("north_m", "limits", "places"),
    [
        ((1e7, 0.0), {}, []),
        ((899.0, 1790.0), {"longest_leg_m": 900.0}, []),
        ((901.0,), {"longest_leg_m": 900.0}, [1]),
        ((899.0, -899.0), {"longest_leg_m": 900.0}, [2]),
        # Nobody knows where following ends
        ((500.0, None, 2500.0), {"longest_leg_m": 900.0}, []),
        ((5000.0, 9990.0), {"farthest_m": 10_000.0}, []),
        ((5000.0, 10_010.0), {"farthest_m": 10_000.0}, [2]),
        ((1e7, 0.0), {"farthest_m": 10_000.0}, [1]),
        ((2000.0,), {"longest_leg_m": 2500.0, "farthest_m": 1500.0}, [1]),
    ],
)
def test_a_place_beyond_the_reach_of_the_fleet_is_named(
    north_m: tuple[float | None, ...], limits: dict[str, float], places: list[int]
) -> None:
    found = list(reach_faults(going(*north_m), "missions.0", VehicleLimits(**limits)))
    assert [fault.path for fault in found] == [
        f"missions.0.command_array.{place}.parameters" for place in places
    ]
