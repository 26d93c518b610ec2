"""Every flight goes round the no-fly areas from home and back, within its battery and commands."""

import itertools
import math
import random
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from edge_server.survey import sorties
from edge_server.survey.home_paths import HomePaths
from edge_server.survey.plane import Area, Point, distance_to_side
from edge_server.survey.planner import (
    HOME_CLEARANCES_M,
    NoSurveyError,
    Survey,
    _laid_out,
    survey,
)
from edge_server.survey.request import Home, Place, SurveyRequest
from tests.unit.edge_server.survey.fields import CAMERA, asked, fly, place, planned_from, star

TRIANGLE = [place(-90, -30), place(-70, -30), place(-80, 30)]
"""Between a home to the west and the field."""
WEST = (-110.0, 0.0)
EVERYWHERE = [(-1e5, -1e5), (1e5, -1e5), (1e5, 1e5), (-1e5, 1e5)]
ROUNDING_M = 0.01
Leg = tuple[Point, Point]


def home_at(place_m: Point) -> Place:
    latitude, longitude = place(*place_m)
    return Place(latitude=latitude, longitude=longitude)


def legs_of(request: SurveyRequest, planned: Survey, home: Place) -> list[list[Leg]]:
    """The legs of each flight on the plane, from home and back."""
    frame, _ = _laid_out(request, planned.figures["angle_deg"])
    at = frame.to_plane((home.latitude, home.longitude))
    flights = fly(request, planned).flights
    return [list(itertools.pairwise([at, *points, at])) for points in flights]


def rings_of(request: SurveyRequest, planned: Survey) -> list[Area]:
    return [Area(hole) for hole in fly(request, planned).area.holes]


def is_free(leg: Leg, rings: list[Area]) -> bool:
    around = Area(EVERYWHERE, [ring.outer for ring in rings])
    return leg[0] == leg[1] or around.is_free(*leg)


def room_m(point: Point, rings: list[Area]) -> float:
    return min(distance_to_side(point, *side) for ring in rings for side in ring.edges)


def along(leg: Leg) -> Iterator[Point]:
    for part in range(101):
        share = part / 100.0
        yield (
            leg[0][0] + share * (leg[1][0] - leg[0][0]),
            leg[0][1] + share * (leg[1][1] - leg[0][1]),
        )


@st.composite
def surveys(draw: st.DrawFn) -> tuple[SurveyRequest, Place]:
    """A field with a few no-fly areas, also outside of it, and a home outside of all of them."""
    random_ = random.Random(draw(st.integers(0, 2**32)))
    boundary = star((0, 0), random_.uniform(50, 100), random_.randint(3, 9), 0.4, random_)
    rings = []
    for _ in range(draw(st.integers(1, 4))):
        centre = random_.uniform(-110, 110), random_.uniform(-110, 110)
        shape = random_.randint(3, 14), random_.uniform(0, 0.7)
        rings.append(star(centre, random_.uniform(3, 30), *shape, random_))
    split = random_.randint(0, len(rings))
    body: dict[str, Any] = {
        "boundary": boundary,
        "holes": rings[:split],
        "exclusions": rings[split:],
        "altitude": random_.uniform(8, 20),
        "vehicles": [1, 2][: random_.randint(1, 2)],
        "endurance": random_.uniform(300, 900),
        "most_commands": random_.randint(20, 100),
        "angle": random_.uniform(0, 180),
    }
    body |= {"camera": CAMERA} if draw(st.booleans()) else {"swath_width": random_.uniform(6, 20)}
    at = random_.uniform(-130, 130), random_.uniform(-130, 130)
    return SurveyRequest.model_validate(body), home_at(at)


def try_survey(request: SurveyRequest, home: Place) -> Survey:
    try:
        return planned_from(home, request)
    except NoSurveyError:
        assume(False)
        raise


@settings(max_examples=100)
@given(surveys())
def test_no_leg_of_a_flight_crosses_a_no_fly_area(case: tuple[SurveyRequest, Place]) -> None:
    request, home = case
    planned = try_survey(request, home)
    rings = rings_of(request, planned)
    flights = legs_of(request, planned, home)
    is_inside = any(ring.holds(flights[0][0][0]) for ring in rings)
    if planned.warnings:
        assert is_inside or len(rings) > 1  # Several that overlap may enclose home
        return
    assert not is_inside
    for leg in itertools.chain.from_iterable(flights):
        assert is_free(leg, rings)


@settings(max_examples=60)
@given(surveys())
def test_a_flight_stays_within_its_battery_and_commands(case: tuple[SurveyRequest, Place]) -> None:
    request, home = case
    planned = try_survey(request, home)
    duration_s = 0.0
    missions = [mission for plan in planned.plans for mission in plan["missions"]]
    for mission, legs in zip(missions, legs_of(request, planned, home), strict=True):
        commands = mission["command_array"]
        assert len(commands) <= request.most_commands
        pictures = sum(command["command_type_id"] == 4 for command in commands)
        seconds = sum(math.dist(*leg) / request.maximum_speed + sorties.STOP_S for leg in legs)
        heights_m = [one["parameters"].get("altitude", 0.0) for one in commands]
        seconds += pictures * sorties.PICTURE_S + 2.0 * max(heights_m) / sorties.CLIMB_M_S
        assert seconds * sorties.RESERVE <= request.endurance + 0.1
        duration_s += seconds
    assert planned.figures["duration_s"] == pytest.approx(duration_s, abs=0.5)


@settings(max_examples=30)
@given(surveys())
def test_no_fly_areas_that_are_not_in_the_way_change_nothing(
    case: tuple[SurveyRequest, Place],
) -> None:
    request, home = case
    bare = request.model_copy(update={"holes": (), "exclusions": ()})
    far = [place(900, 900), place(950, 900), place(950, 950)]
    beside = request.model_copy(update={"holes": (), "exclusions": (tuple(far),)})
    assert try_survey(bare, home).plans == try_survey(beside, home).plans


@settings(max_examples=200)
@given(st.integers(0, 2**32), st.floats(3, 14), st.floats(0, 0.9))
def test_paths_keep_two_metres_where_there_is_room(
    seed: int, corners: float, roughness: float
) -> None:
    random_ = random.Random(seed)
    rings = [ring_m((0, 0), 20.0, int(corners), roughness, random_)]
    rings.append(ring_m((60, 10), 15.0, 5, roughness, random_))
    home, stop = (-30.0, random_.uniform(-20, 20)), (90.0, random_.uniform(-20, 30))
    paths = HomePaths(home, rings, HOME_CLEARANCES_M, 10.0)
    areas = [Area(ring) for ring in rings]
    for leg in itertools.pairwise([home, *paths.bends(stop), stop]):
        assert min(room_m(point, areas) for point in along(leg)) >= 2.0 - ROUNDING_M


def ring_m(
    centre: Point, radius_m: float, corners: int, roughness: float, random_: random.Random
) -> list[Point]:
    turn = 2.0 * math.pi / corners
    ring = []
    for index in range(corners):
        distance_m = radius_m * random_.uniform(1.0 - roughness, 1.0)
        angle = (index + random_.uniform(-0.3, 0.3)) * turn
        x, y = distance_m * math.cos(angle), distance_m * math.sin(angle)
        ring.append((centre[0] + x, centre[1] + y))
    return ring


def test_a_triangle_between_home_and_field_is_passed_at_two_metres() -> None:
    request = asked(exclusions=[TRIANGLE])
    home = home_at(WEST)
    planned = planned_from(home, request)
    rings = rings_of(request, planned)
    (legs,) = legs_of(request, planned, home)
    for leg in legs:
        assert min(room_m(point, rings) for point in along(leg)) >= 2.0 - ROUNDING_M


@pytest.mark.parametrize(
    ("altitude", "limit", "heights"),
    [
        (10.0, None, [10.0, 13.0, 16.0]),
        (118.0, None, [118.0, 115.0, 112.0]),
        (10.0, 14.0, [10.0, 13.0, 4.0]),
        (4.0, 5.0, [4.0, 4.0, 4.0]),
    ],
)
def test_vehicles_that_go_round_the_same_corner_have_lanes_and_levels(
    altitude: float, limit: float | None, heights: list[float]
) -> None:
    fence = {"max_altitude": limit, "inclusion": []} if limit else None
    request = asked(exclusions=[TRIANGLE], vehicles=[1, 2, 3], altitude=altitude, geofence=fence)
    planned = planned_from(home_at((-80.0, -31.0)), request)
    missions = planned.plans[0]["missions"]
    bends = [mission["command_array"][1]["parameters"] for mission in missions]
    assert [bend["altitude"] for bend in bends] == heights
    frame, _ = _laid_out(request, 0.0)
    places = [frame.to_plane((bend["latitude"], bend["longitude"])) for bend in bends]
    for one, other in itertools.combinations(places, 2):
        assert math.dist(one, other) >= 4.0
    for mission in missions:  # At the work all fly as high as was asked for
        (_, *flown, _) = mission["command_array"]
        assert flown[len(flown) // 2]["parameters"]["altitude"] == altitude
        assert flown[-1]["parameters"]["altitude"] in {altitude, *heights}


def test_a_path_through_a_gap_keeps_what_the_gap_leaves() -> None:
    walls = [
        [(10.0, 1.0), (12.0, 1.0), (12.0, 500.0), (10.0, 500.0)],
        [(10.0, -500.0), (12.0, -500.0), (12.0, -1.0), (10.0, -1.0)],
        [(10.0, 499.0), (12.0, 499.0), (12.0, 502.0), (-500.0, 502.0), (-500.0, 499.0)],
        [(-500.0, -502.0), (12.0, -502.0), (12.0, -499.0), (-500.0, -499.0)],
        [(-502.0, -502.0), (-499.0, -502.0), (-499.0, 502.0), (-502.0, 502.0)],
    ]
    paths = HomePaths((-40.0, 30.0), walls, HOME_CLEARANCES_M, 10.0)
    legs = itertools.pairwise([(-40.0, 30.0), *paths.bends((60.0, 30.0)), (60.0, 30.0)])
    areas = [Area(wall) for wall in walls]
    assert paths.leads_to((60.0, 30.0))
    assert min(room_m(point, areas) for leg in legs for point in along(leg)) >= 0.3 - ROUNDING_M
    assert not HomePaths((-40.0, 30.0), walls, (2.0,), 10.0).leads_to((60.0, 30.0))


def test_a_round_pond_takes_few_bends() -> None:
    pond = [(20.0 * math.cos(angle / 10.0), 20.0 * math.sin(angle / 10.0)) for angle in range(63)]
    paths = HomePaths((-22.5, 0.0), [pond], HOME_CLEARANCES_M, 10.0)
    assert 1 <= len(paths.bends((22.5, 0.0))) <= 4


def test_a_home_inside_an_exclusion_still_gives_a_plan_with_a_warning() -> None:
    around = [place(-120, -10), place(-100, -10), place(-100, 10), place(-120, 10)]
    planned = planned_from(home_at(WEST), asked(exclusions=[around]))
    assert planned.plans == planned_from(home_at(WEST), asked()).plans
    assert [fault.path for fault in planned.warnings] == ["home"]


def test_rings_beyond_what_is_covered_are_avoided_from_home() -> None:
    beyond = planned_from(home_at(WEST), asked(beyond=[TRIANGLE]))
    assert beyond.plans == planned_from(home_at(WEST), asked(exclusions=[TRIANGLE])).plans
    assert beyond.plans != planned_from(home_at(WEST), asked()).plans


def test_a_mission_without_room_for_the_bends_is_refused_by_its_size() -> None:
    with pytest.raises(NoSurveyError) as caught:
        planned_from(home_at((-80.0, -31.0)), asked(exclusions=[TRIANGLE], most_commands=4))
    assert caught.value.field == "most_commands"


def command_places(planned: Survey) -> list[list[tuple[float, float]]]:
    """Latitude and longitude of each command with a place, by flight."""
    return [
        [
            (one["parameters"]["latitude"], one["parameters"]["longitude"])
            for one in mission["command_array"]
            if "latitude" in one["parameters"]
        ]
        for plan in planned.plans
        for mission in plan["missions"]
    ]


def test_each_vehicle_takes_off_at_its_own_home_and_works_as_from_there() -> None:
    """A shared home would lead vehicles to one point at the same time: there none takes off."""
    west, east = home_at(WEST), home_at((110.0, 0.0))
    request = asked(exclusions=[TRIANGLE], vehicles=[1, 2], altitude=20.0)
    own = survey(request, [Home(west, is_takeoff=True), Home(east, is_takeoff=True)], 1)
    (first, second), (alone, _) = command_places(own), command_places(planned_from(west, request))
    assert first[0] == pytest.approx((west.latitude, west.longitude))
    assert second[0] == pytest.approx((east.latitude, east.longitude))
    assert alone[0] == alone[1] == first[1]
    assert first[1:] == alone[1:]
    eastern = planned_from(east, request)
    assert second[1:] == command_places(eastern)[1][1:]
    takeoff = own.plans[0]["missions"][0]["command_array"][0]["parameters"]
    assert takeoff["altitude"] == 20.0


def test_a_no_fly_area_beside_one_home_is_on_the_paths_of_that_vehicle_alone() -> None:
    west = home_at(WEST)
    request = asked(vehicles=[1, 2], endurance=86_400)
    free = survey(request, [Home(west), Home(west)], 1)
    first, second = command_places(
        survey(request, [Home(west, beyond=(tuple(TRIANGLE),)), Home(west)], 1)
    )
    assert first != command_places(free)[0]
    assert second == command_places(free)[1]


@pytest.mark.parametrize(
    ("fence", "takes_off_at_home"),
    [
        ({"inclusion": [[place(-120, -50), place(70, -50), place(70, 50), place(-120, 50)]]}, True),
        ({"inclusion": [[place(-70, -50), place(70, -50), place(70, 50), place(-70, 50)]]}, False),
        ({"exclusion": [[place(-120, -40), place(-105, -40), place(-105, -20)]]}, True),
        ({"exclusion": [[place(-120, -10), place(-105, -10), place(-105, 10)]]}, False),
        (
            {"exclusion": [[place(-90, -60), place(-85, -60), place(-85, 60), place(-90, 60)]]},
            False,
        ),
    ],
    ids=["inside", "home outside", "exclusion elsewhere", "home in exclusion", "leg crosses"],
)
def test_a_takeoff_that_the_fence_forbids_leads_to_the_first_place(
    fence: dict[str, Any], *, takes_off_at_home: bool
) -> None:
    """Then home is where no plan may begin, and the plan is still one that the rules accept."""
    home = home_at(WEST)
    (places,) = command_places(survey(asked(geofence=fence), [Home(home, is_takeoff=True)], 1))
    at_home = places[0] == pytest.approx((home.latitude, home.longitude))
    assert at_home is takes_off_at_home
    assert at_home or places[0] == places[1]


def test_the_length_is_flown_from_home_and_back() -> None:
    """As the recorded flights are long, and as the time is counted."""
    for at in (WEST, (-60.0, -40.0)):
        home, request = home_at(at), asked(exclusions=[TRIANGLE], endurance=300.0)
        planned = planned_from(home, request)
        flights = legs_of(request, planned, home)
        flown_m = sum(math.dist(*leg) for legs in flights for leg in legs)
        assert len(flights) > 1
        assert planned.figures["length_m"] == pytest.approx(flown_m, abs=1.0)
