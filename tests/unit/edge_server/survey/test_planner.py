"""Every field is covered, from inside it, with the overlap that was asked for."""

import itertools
import math
import statistics
from typing import Any

import pytest
from hypothesis import assume, given, settings

from afarcloud import geometry
from afarcloud.enumerations import CommandType
from afarcloud.geodesy import distance_m
from edge_server.survey import lines
from edge_server.survey.plane import Area
from edge_server.survey.planner import MARGIN_M, NoSurveyError, Survey, survey
from edge_server.survey.request import Home, Place, SurveyRequest
from tests.unit.edge_server.survey.fields import (
    CAMERA,
    HOME,
    LONGITUDE_DEG,
    SQUARE,
    asked,
    coverage,
    fly,
    place,
    planned_from,
    requests,
)


def planned(**changes: Any) -> Survey:
    return planned_from(HOME, asked(**changes))


def try_survey(request: SurveyRequest) -> Survey:
    """Plan it, unless a pond cuts the field in two."""
    try:
        return planned_from(HOME, request)
    except NoSurveyError as error:
        assume(error.field != "exclusions")
        raise


@pytest.mark.thorough
@settings(max_examples=60)
@given(requests())
def test_a_field_is_covered_from_inside(request: SurveyRequest) -> None:
    """The bends of the way home may lie outside of the field, never in a hole."""
    flown = fly(request, try_survey(request))
    holes = [Area(hole) for hole in flown.area.holes]
    for flight in flown.flights:
        work = list(itertools.takewhile(flown.area.holds, flight))
        for start, end in itertools.pairwise(work):
            assert start == end or flown.area.is_free(start, end)
        home = flight[len(work) :]
        assert not any(hole.holds(point) for hole in holes for point in home)
        assert not any(
            geometry.crosses(*leg, *side)
            for leg in itertools.pairwise([*work[-1:], *home])
            for hole in holes
            for side in hole.edges
        )
    assume(flown.area.square_metres > 1_000)
    assert coverage(request, flown) >= 0.995


@pytest.mark.thorough
@settings(max_examples=30)
@given(requests())
def test_pictures_overlap_as_asked_for(request: SurveyRequest) -> None:
    assume(request.camera is not None)
    flown = fly(request, try_survey(request))
    footprint = request.footprint
    rows = lines.lines_of(flown.area, footprint, MARGIN_M)
    gaps = [
        abs(after[0] - before[0])
        for row in rows
        for line in row
        for before, after in itertools.pairwise(line.places)
    ]
    for gap in gaps:
        overlap = 1.0 - gap / footprint.along_m
        assert overlap == pytest.approx(request.front_overlap, rel=0.05, abs=0.01)
    heights = [row[0].y for row in rows if row]
    for before, after in itertools.pairwise(heights):
        overlap = 1.0 - (after - before) / footprint.across_m
        assert overlap == pytest.approx(request.side_overlap, rel=0.05, abs=0.01) or overlap < 0


def test_lines_lie_one_spacing_apart() -> None:
    request = {"side_overlap": 0.6, "angle": 90.0}
    outcome = planned(**request)
    flown = fly(
        SurveyRequest.model_validate(
            {"boundary": SQUARE, "swath_width": 10.0, "altitude": 10.0, "vehicles": [1], **request}
        ),
        outcome,
    )
    rows = sorted({round(y, 2) for flight in flown.flights for _, y in flight})
    assert [b - a for a, b in itertools.pairwise(rows)] == pytest.approx(
        [4.0] * (len(rows) - 1), abs=0.02
    )


def test_the_angle_with_the_fewest_turns_is_along_the_long_side() -> None:
    assert planned().figures["angle_deg"] == pytest.approx(90.0, abs=0.1)
    assert planned().figures["lines"] == 8
    assert planned(angle=0.0).figures["lines"] == 12


def test_each_line_is_flown_the_other_way() -> None:
    commands = planned().plans[0]["missions"][0]["command_array"]
    longitudes = [c["parameters"]["longitude"] for c in commands if c["command_type_id"] == 3]
    directions = [b > a for a, b in zip(longitudes[::2], longitudes[1::2], strict=True)]
    assert directions == [index % 2 == int(not directions[0]) for index in range(len(directions))]


def test_a_mission_takes_off_works_and_comes_home() -> None:
    commands = planned(camera=CAMERA, swath_width=None).plans[0]["missions"][0]["command_array"]
    kinds = [CommandType(command["command_type_id"]) for command in commands]
    assert kinds[0] == CommandType.NAV_TAKEOFF
    assert kinds[-1] == CommandType.NAV_HOME
    assert set(kinds[1:-1]) == {CommandType.NAV_WAYPOINT, CommandType.CAMERA_IMAGE}
    assert [command["command_id"] for command in commands] == list(range(1, len(commands) + 1))


def test_vehicles_share_the_field_evenly() -> None:
    outcome = planned(vehicles=[4, 7], swath_width=4.0)
    (plan,) = outcome.plans
    assert [mission["vehicle_id"] for mission in plan["missions"]] == [4, 7]
    sizes = [len(mission["command_array"]) for mission in plan["missions"]]
    assert abs(sizes[0] - sizes[1]) <= 2


@pytest.mark.parametrize("homes_m", [[-100.0, 100.0], [100.0, -100.0]])
def test_each_vehicle_covers_the_part_of_the_field_near_its_home(homes_m: list[float]) -> None:
    homes = [place(east_m, 0.0) for east_m in homes_m]
    starts = [Home(Place(latitude=at[0], longitude=at[1]), is_takeoff=True) for at in homes]
    outcome = survey(asked(vehicles=[4, 7], swath_width=4.0, angle=0.0), starts, 1)
    (plan,) = outcome.plans
    first, second = plan["missions"]
    assert [(one["mission_id"], one["vehicle_id"]) for one in (first, second)] == [(1, 4), (2, 7)]
    for one, home in zip((first, second), homes, strict=True):
        places = [command["parameters"] for command in one["command_array"][:-1]]
        assert places[0]["longitude"] == pytest.approx(home[1], abs=1e-7)
        middle_deg = statistics.fmean(at["longitude"] for at in places)
        assert (middle_deg > LONGITUDE_DEG) == (home[1] > LONGITUDE_DEG)


def test_a_short_route_goes_to_the_vehicle_that_is_near() -> None:
    strip = [place(-60, -3), place(60, -3), place(60, 3), place(-60, 3)]
    far, near = place(-900.0, 0.0), place(-61.0, 0.0)
    starts = [Home(Place(latitude=at[0], longitude=at[1])) for at in (far, near)]
    outcome = survey(
        asked(boundary=strip, vehicles=[4, 7], swath_width=200.0, endurance=3600), starts, 1
    )
    flown = [mission["vehicle_id"] for plan in outcome.plans for mission in plan["missions"]]
    assert flown == [7]


@pytest.mark.parametrize("bound", [{"endurance": 300.0}, {"most_commands": 12}])
def test_a_battery_or_a_full_mission_ends_a_flight_and_the_next_goes_on(
    bound: dict[str, Any],
) -> None:
    whole, cut = (
        planned(swath_width=4.0, endurance=86_400, most_commands=700),
        planned(swath_width=4.0, **bound),
    )
    assert len(cut.plans) > len(whole.plans) == 1
    assert waypoints(cut) == waypoints(whole)
    ids = [mission["mission_id"] for plan in cut.plans for mission in plan["missions"]]
    assert ids == list(range(1, len(cut.plans) + 1))


def waypoints(outcome: Survey) -> list[dict[str, Any]]:
    return [
        command["parameters"]
        for plan in outcome.plans
        for mission in plan["missions"]
        for command in mission["command_array"]
        if command["command_type_id"] == 3
    ]


def test_nothing_is_flown_over_a_hole_or_an_exclusion() -> None:
    pond = [place(-5, -10), place(5, -10), place(5, 10), place(-5, 10)]
    for name in ("holes", "exclusions"):
        body = {
            "boundary": SQUARE,
            "swath_width": 5.0,
            "altitude": 10.0,
            "vehicles": [1],
            name: [pond],
        }
        request = SurveyRequest.model_validate(body)
        flown = fly(request, planned_from(HOME, request))
        for start, end in itertools.pairwise(flown.flights[0]):
            assert math.dist(start, end) == 0.0 or flown.area.is_free(start, end)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        (
            {"exclusions": [[place(-1, -50), place(1, -50), place(1, 50), place(-1, 50)]]},
            "exclusions",
        ),
        ({"boundary": [SQUARE[0]] * 3}, "boundary"),
        ({"boundary": [place(0, 0), place(50, 0), place(100, 0)]}, "boundary"),
        ({"holes": [SQUARE]}, "boundary"),
        ({"home": None, "endurance": 60.0, "altitude": 60.0}, "endurance"),
    ],
)
def test_what_cannot_be_flown_is_refused_by_field(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(NoSurveyError) as caught:
        planned(**changes)
    assert caught.value.field == field


def test_a_way_that_only_just_misses_a_corner_is_not_free() -> None:
    pond = [(40.0, 50.0), (50.0, 60.0), (60.0, 50.0), (50.0, 40.0)]
    area = Area(outer=[(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)], holes=[pond])
    beside = ((30.0, 39.999), (70.0, 39.999))
    assert area.is_free(*beside)
    assert not area.is_free(*beside, clearance_m=0.005)
    assert area.is_free((30.0, 39.99), (70.0, 39.99), clearance_m=0.005)


@pytest.mark.parametrize("corner", [(-60, -40), (60, -40), (60, 40), (-60, 40)])
def test_the_lines_begin_beside_the_entry(corner: tuple[float, float]) -> None:
    (plan,) = planned(entry=place(*corner), most_commands=700, endurance=9000).plans
    first = plan["missions"][0]["command_array"][0]["parameters"]
    begin = (first["latitude"], first["longitude"])
    assert distance_m(*begin, *place(*corner)) < 10.0


def test_each_flight_can_be_a_plan_of_its_own() -> None:
    terms: dict[str, Any] = {"name": "North", "vehicles": [1, 2], "most_commands": 8}
    together, apart = planned(**terms).plans, planned(**terms, plan_per_vehicle=True).plans
    assert len(together) > 1
    assert [plan["name"] for plan in apart[:3]] == [
        "North 1, vehicle 1",
        "North 1, vehicle 2",
        "North 2, vehicle 1",
    ]
    assert [plan["missions"] for plan in apart] == [
        [mission] for plan in together for mission in plan["missions"]
    ]


def test_the_size_of_an_area_counts_what_a_hole_takes_of_it() -> None:
    outer = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    half_outside = [(5.0, 2.0), (15.0, 2.0), (15.0, 8.0), (5.0, 8.0)]
    inside = [(1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0)]
    over_it = [(2.0, 1.0), (4.0, 1.0), (4.0, 3.0), (2.0, 3.0)]
    beside = [(20.0, 0.0), (40.0, 0.0), (40.0, 20.0)]
    assert Area(outer, [half_outside]).square_metres == pytest.approx(70.0)
    assert Area(outer, [inside, over_it, beside]).square_metres == pytest.approx(94.0)
