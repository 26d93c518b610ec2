"""Missions against a geofence: what is flown decides, not what is written."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afarcloud.geodesy import distance_m, shifted
from afarcloud.plan import Geofence, Mission
from afarcloud.route import Circle, Spot, highest_m, route_of
from mavlink_broker.autopilots import families
from mavlink_broker.autopilots.families import Family
from mavlink_broker.planning.geofence import AreaCheck, as_flown, check_flyable
from mavlink_broker.planning.situation import Home, RefusedError
from tests.support.cases import failures

LATITUDE, LONGITUDE = 40.4434, -3.7382
HOME = Home(LATITUDE, LONGITUDE, 650.0)
START = Spot(LATITUDE, LONGITUDE, 0.0)
FAMILIES = [families.OWN, families.PX4, families.ARDUPILOT, families.GENERIC]
each_family = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)


def place(north_m: float, east_m: float) -> tuple[float, float]:
    latitude, _ = shifted(LATITUDE, LONGITUDE, 0.0, north_m)
    return latitude, shifted(LATITUDE, LONGITUDE, 90.0, east_m)[1]


def field(south: float, west: float, north: float, east: float) -> tuple[tuple[float, float], ...]:
    return place(south, west), place(south, east), place(north, east), place(north, west)


def at(north_m: float, east_m: float) -> dict[str, float]:
    latitude, longitude = place(north_m, east_m)
    return {"latitude": latitude, "longitude": longitude}


def takeoff(north_m: float = 0.0, east_m: float = 0.0, height_m: float = 10.0) -> dict[str, Any]:
    return {"command_type_id": 1, "parameters": at(north_m, east_m) | {"altitude": height_m}}


def waypoint(north_m: float, east_m: float, height_m: float = 10.0) -> dict[str, Any]:
    return {"command_type_id": 3, "parameters": at(north_m, east_m) | {"altitude": height_m}}


def orbit(north_m: float, east_m: float, radius_m: float, **more: Any) -> dict[str, Any]:
    shape = {"orbit_altitude": 10, "radius": radius_m, "angular_velocity": 5, **more}
    return {"command_type_id": 7, "parameters": at(north_m, east_m) | shape}


def follow(north_m: float, east_m: float, height_m: float = 10.0) -> dict[str, Any]:
    return {"command_type_id": 8, "parameters": at(north_m, east_m) | {"altitude": height_m}}


def land(north_m: float, east_m: float) -> dict[str, Any]:
    return {"command_type_id": 2, "parameters": at(north_m, east_m)}


def picture() -> dict[str, Any]:
    return {"command_type_id": 4, "parameters": {"pitch_angle": -90}}


def panorama() -> dict[str, Any]:
    return {"command_type_id": 10, "parameters": {"panorama_mode": 0}}


def track() -> dict[str, Any]:
    return {
        "command_type_id": 9,
        "parameters": {"corners": [[0.2, 0.2], [0.8, 0.8]], "track_mode": 0},
    }


def go_home(*, landing: bool = True) -> dict[str, Any]:
    return {"command_type_id": 11, "parameters": {"landing": landing}}


def mission(*commands: dict[str, Any]) -> Mission:
    numbered = [{"command_id": i, **command} for i, command in enumerate(commands, 1)]
    return Mission.model_validate({"mission_id": 1, "vehicle_id": 1, "command_array": numbered})


FENCE = Geofence(
    inclusion=(field(-50, -50, 50, 50),), exclusion=(field(10, 10, 20, 20),), max_altitude=40.0
)


def fault(
    *commands: dict[str, Any],
    family: Family = families.OWN,
    fence: Geofence = FENCE,
    start: Spot | None = START,
    home: Home | None = HOME,
    **more: Any,
) -> tuple[int, str] | None:
    """The command that is refused, counted from 1, and why."""
    plan = mission(*commands)
    try:
        AreaCheck(fence).check(plan, family, start=start, home=home, **more)
    except RefusedError as error:
        return error.command_id, error.reason
    return None


@each_family
def test_a_mission_inside_is_flown(family: Family) -> None:
    commands = [takeoff(), waypoint(30, 0), picture(), waypoint(30, -30), orbit(-20, -20, 15)]
    assert fault(*commands, waypoint(-40, 0), go_home(), family=family) is None


OUTSIDE: list[tuple[list[dict[str, Any]], int, str]] = [
    ([takeoff(60, 0)], 1, "latitude, longitude: the place lies 10.0 m outside"),
    ([takeoff(), waypoint(60, 0)], 2, "latitude, longitude: the place lies 10.0 m outside"),
    ([takeoff(), waypoint(15, 15)], 2, "latitude, longitude: the place lies in"),
    ([takeoff(), waypoint(30, 30)], 2, "latitude, longitude: the leg there enters"),
    ([takeoff(), land(30, 30)], 2, "latitude, longitude: the leg there enters"),
    ([takeoff(), land(60, 0)], 2, "latitude, longitude: the place lies 10.0 m outside"),
    ([takeoff(), orbit(0, -40, 15)], 2, "latitude, longitude, radius: the circle leaves"),
    ([takeoff(), orbit(-5, 15, 20)], 2, "latitude, longitude, radius: the circle enters"),
    (
        [takeoff(), orbit(30, 30, 10, start_point=1)],
        2,
        "latitude, longitude: the leg there enters",
    ),
    ([takeoff(), follow(60, 0)], 2, "latitude, longitude: the place lies 10.0 m outside"),
    ([takeoff(), waypoint(30, 0), go_home()], 0, ""),
    (
        [takeoff(), waypoint(30, 0), waypoint(30, 30), go_home()],
        4,
        "landing: the leg there enters",
    ),
    (
        [takeoff(), waypoint(30, 0), waypoint(30, 30), go_home(landing=False)],
        4,
        "landing: the leg there enters",
    ),
    ([takeoff(height_m=41.0)], 1, "altitude: 41 m is above geofence.max_altitude, 40 m"),
    ([takeoff(), waypoint(9, 0, 41.0)], 2, "altitude: 41 m is above geofence.max_altitude"),
    ([takeoff(), follow(9, 0, 41.0)], 2, "altitude: 41 m is above geofence.max_altitude"),
]


def check_outside(commands: list[dict[str, Any]], number: int, why: str, family: Family) -> None:
    found = fault(*commands, family=family)
    if not number:
        assert found is None
        return
    assert found is not None
    assert found[0] == number
    assert found[1].startswith(why)


@each_family
def test_a_command_that_leaves_the_fence_is_named_with_its_parameter(family: Family) -> None:
    assert failures(check_outside, [(*case, family) for case in OUTSIDE]) == []


def test_a_circle_round_a_forbidden_place_is_flown() -> None:
    tower = Geofence(exclusion=(field(28, -2, 32, 2),))
    assert fault(takeoff(), orbit(30, 0, 10), go_home(), fence=tower) is None


def test_from_the_middle_of_a_circle_every_path_to_it_counts() -> None:
    """Where it begins then is not known."""
    beside = Geofence(exclusion=(field(4, -1, 6, 1),))
    found = fault(takeoff(), orbit(0, 0, 10), fence=beside)
    assert found == (2, "latitude, longitude: the leg there enters geofence.exclusion.0")


def test_the_path_after_a_circle_begins_where_it_was_entered() -> None:
    """Entered from the south at its southern end, left for the south again: past the tower."""
    beyond = Geofence(exclusion=(field(28, -2, 32, 2),))
    assert fault(takeoff(), orbit(30, 0, 10), waypoint(0, 5), fence=beyond) is None
    found = fault(takeoff(), orbit(30, 0, 10), waypoint(60, 0), fence=beyond)
    assert found == (3, "latitude, longitude: the leg there enters geofence.exclusion.0")


@pytest.mark.parametrize("family", [families.PX4, families.ARDUPILOT, families.OWN])
def test_what_is_gone_round_may_lie_in_an_exclusion(family: families.Family) -> None:
    """No vehicle holds at the centre of a last circle."""
    tower = Geofence(exclusion=(field(28, -2, 32, 2),))
    assert fault(takeoff(), orbit(30, 0, 10), fence=tower, family=family) is None


@pytest.mark.parametrize(
    ("north_m", "why"),
    [(60.0, "the vehicle lies 10.0 m outside"), (15.0, "the vehicle lies in geofence.exclusion.0")],
)
def test_a_vehicle_that_stands_where_it_must_not_be_stays_there(north_m: float, why: str) -> None:
    start = Spot(*place(north_m, north_m if north_m < 20 else 0.0), 0.0)
    found = fault(takeoff(), start=start)
    assert found is not None
    assert found[0] == 1
    assert found[1].startswith(f"latitude, longitude: {why}")


def test_a_home_outside_is_refused() -> None:
    away = Home(*place(70, 0), 650.0)
    found = fault(takeoff(), home=away)
    assert found is not None
    assert "home lies 20.0 m outside" in found[1]


def test_a_vehicle_that_hovers_too_high_is_refused() -> None:
    found = fault(takeoff(), start=START._replace(relative_altitude_m=50.0))
    why = "altitude: the vehicle is too high: 50 m is above geofence.max_altitude, 40 m"
    assert found == (1, why)


def test_before_the_vehicle_is_received_only_what_is_certain_is_checked() -> None:
    first_leg = takeoff(30, 30)  # From home it would lead through the exclusion
    assert fault(first_leg, start=None, home=None) is None
    assert fault(first_leg) is not None
    found = fault(takeoff(30, 30), waypoint(5, 5), start=None, home=None)
    assert found is not None
    assert found[0] == 2


def test_behind_a_tracked_subject_the_path_is_checked_at_its_end() -> None:
    moving = Geofence(inclusion=FENCE.inclusion)
    assert fault(takeoff(), track(), waypoint(30, 0), fence=moving) is None
    found = fault(takeoff(), track(), waypoint(60, 0), fence=moving)
    assert found is not None
    assert found[0] == 3


@each_family
def test_a_panorama_and_pictures_lead_nowhere(family: Family) -> None:
    assert fault(takeoff(), panorama(), picture(), go_home(), family=family) is None


def test_the_vehicles_own_limit_holds_beside_the_plans() -> None:
    found = fault(takeoff(height_m=30.0), own_limit_m=20.0)
    assert found == (1, "altitude: 30 m is above the vehicle's own limit, 20 m")
    assert fault(takeoff(height_m=20.0), own_limit_m=20.0) is None


@each_family
@settings(max_examples=20)
@given(
    stops=st.lists(st.tuples(st.floats(-80, 80), st.floats(-80, 80)), min_size=1, max_size=6),
    circle=st.tuples(st.floats(-80, 80), st.floats(-80, 80), st.floats(5, 40)),
)
def test_a_route_is_one_line_without_gaps(
    stops: list[tuple[float, float]], circle: tuple[float, float, float], family: Family
) -> None:
    """Each path begins where the one before it ended; a circle is entered on its line."""
    commands = [takeoff(), *(waypoint(*stop) for stop in stops), orbit(*circle), waypoint(0, 0)]
    plan = mission(*commands, go_home())
    commands_flown = as_flown(plan.command_array, family)
    seen, last = [START], START
    for part in route_of(commands_flown, START, START):
        if isinstance(part, Circle):
            assert abs(distance_m(*last[:2], *part.centre[:2]) - part.radius_m) < 0.01
            continue
        assert part.start in seen
        last = part.end
        seen.append(last)
    assert distance_m(*last[:2], *HOME[:2]) < 0.01
    assert highest_m(commands_flown) == 10.0


class TestPlacesOfEvents:
    def test_inside_is_allowed_outside_is_not(self) -> None:
        check = AreaCheck(FENCE)
        assert check.fault_of_order(START[:2], Spot(*place(30, 0), 10.0)) is None
        fault = check.fault_of_order(START[:2], Spot(*place(60, 0), 10.0))
        assert fault == "the place lies 10.0 m outside geofence.inclusion"

    def test_the_path_to_it_counts_unless_the_vehicle_has_strayed(self) -> None:
        check, there = AreaCheck(FENCE), Spot(*place(30, 30), 10.0)
        assert check.fault_of_order(START[:2], there) == "the leg there enters geofence.exclusion.0"
        assert check.fault_of_order(place(60, 0), there) is None

    def test_its_height_counts(self) -> None:
        fault = AreaCheck(FENCE).fault_of_order(START[:2], Spot(*place(0, 0), 90.0))
        assert fault == "90 m is above geofence.max_altitude, 40 m"


def test_a_polygon_that_crosses_itself_is_refused_by_its_name() -> None:
    corners = field(-50.0, -50.0, 50.0, 50.0)
    bow_tie = (corners[0], corners[2], corners[1], corners[3])
    geofence = Geofence(inclusion=(field(-90.0, -90.0, 90.0, 90.0), bow_tie))
    with pytest.raises(RefusedError, match=r"geofence\.inclusion\.1: crosses itself"):
        AreaCheck(geofence).check(mission(takeoff()), families.OWN, start=None, home=None)


def test_what_no_vehicle_flies_is_refused_by_its_field() -> None:
    slow = mission(takeoff()).model_copy(update={"maximum_speed": 5e-324})
    with pytest.raises(RefusedError, match=r"maximum_speed: must be at least 0\.1 m/s"):
        check_flyable(slow)
    with pytest.raises(RefusedError, match="command 2: command_type_id: the vehicle flies already"):
        check_flyable(mission(takeoff(), takeoff()))
