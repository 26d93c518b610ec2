"""Ways round what the geofence forbids: allowed all along, short, and given up in time."""

import itertools
import math

import pytest
from hypothesis import given, settings

from tests.support.toy_vehicle import ToyVehicle, at, item
from tests.unit.uav_firmware.modules.navigator.geofence.test_geofence import (
    ACCEPTED,
    fence_vehicle,
    fences,
    fly_out,
    points,
    polygon,
)
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne
from uav_firmware.modules.navigator.geofence.detour import find_detour, length
from uav_firmware.modules.navigator.geofence.geofence import Disc, Geofence, Point, Polygon
from uav_firmware.msg.status import Command

WALL = Polygon(False, ((-20.0, 10.0), (-20.0, 14.0), (20.0, 14.0), (20.0, 10.0)))
HORSESHOE = Polygon(
    True,
    ((0.0, 0.0), (0.0, 60.0), (40.0, 60.0), (40.0, 40.0), (15.0, 40.0), (15.0, 20.0),
     (40.0, 20.0), (40.0, 0.0)),
)  # fmt: skip


@given(fences, points, points)
@settings(max_examples=60, deadline=None)
def test_every_leg_of_a_detour_is_allowed(fence: Geofence, start: Point, goal: Point) -> None:
    turns = find_detour(fence, start, goal)
    if turns is None:
        return
    for before, after in itertools.pairwise((start, *turns, goal)):
        assert fence.line_allowed(before, after)
        for turn in turns:
            assert fence.margin(turn) > 0.4


@given(fences, points, points)
@settings(max_examples=60, deadline=None)
def test_a_path_is_straight_if_that_is_allowed(fence: Geofence, start: Point, goal: Point) -> None:
    assert (find_detour(fence, start, goal) == ()) == fence.line_allowed(start, goal)


def test_a_wall_is_passed_at_its_nearer_end() -> None:
    turns = find_detour(Geofence((WALL,)), (5.0, 0.0), (5.0, 30.0))
    assert turns is not None
    assert all(20.0 < north < 30.0 for north, _ in turns)
    assert length((5.0, 0.0), turns, (5.0, 30.0)) < 55.0


@pytest.mark.parametrize("radius", [5.0, 50.0, 500.0])
def test_a_circle_is_flown_round_at_little_more_than_its_own_length(radius: float) -> None:
    start, goal = (0.0, -1.1 * radius - 4.0), (0.0, 1.1 * radius + 4.0)
    turns = find_detour(Geofence((Disc(False, (0.0, 0.0), radius),)), start, goal)
    assert turns is not None
    assert length(start, turns, goal) < 1.1 * (math.pi * (radius + 4.0)) + 0.2 * radius


def test_within_a_bent_area_the_path_follows_the_bend() -> None:
    turns = find_detour(Geofence((HORSESHOE,)), (35.0, 10.0), (35.0, 50.0))
    assert turns is not None
    assert len(turns) == 2
    assert all(north < 15.0 for north, _ in turns)


def test_from_an_island_there_is_no_path() -> None:
    islands = (Disc(True, (0.0, 0.0), 10.0), Disc(True, (100.0, 0.0), 10.0))
    assert find_detour(Geofence(islands), (0.0, 0.0), (100.0, 0.0)) is None


def test_a_fence_too_large_to_search_is_given_up() -> None:
    """Thousands of sides between start and goal, none of which is looked at forever."""
    comb = tuple(
        (float(tooth), -50.0 if tooth % 2 else 50.0 - 0.01 * tooth) for tooth in range(1, 1200)
    )
    fence = Geofence((Polygon(False, comb),))
    assert find_detour(fence, (-10.0, 0.0), (1300.0, 0.0)) is None


def breaches(vehicle: ToyVehicle, fence: Geofence, begin: int) -> int:
    return sum(not fence.allows((north, east)) for north, east, _ in vehicle.track[begin:])


@pytest.mark.first_case
@pytest.mark.parametrize("action", [2, 3])
def test_a_return_goes_round_an_exclusion_and_lands_at_home(action: int) -> None:
    vehicle = airborne()
    vehicle.registry.set("GF_ACTION", action)
    fly_out(vehicle, 60.0, 0.0)
    wall = ((25.0, -30.0), (25.0, 12.0), (35.0, 12.0), (35.0, -30.0))
    circle = item(4, 5004, frame=3, param1=8.0, **at(12.0, 22.0))
    fence_vehicle(vehicle, *polygon(5002, *wall), circle)
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) == ACCEPTED
    begin = len(vehicle.track)
    vehicle.run_until(lambda v: not v.armed, 200.0)
    fence = Geofence((Polygon(False, wall), Disc(False, (12.0, 22.0), 8.0)))
    assert breaches(vehicle, fence, begin) == 0
    assert math.dist(vehicle.position[:2], (0.0, 0.0)) < 0.3
    assert not any("Geofence breached" in text for text in vehicle.texts)


def test_without_a_path_home_the_operator_is_informed() -> None:
    vehicle = airborne()
    fly_out(vehicle, 60.0, 0.0)
    fence_vehicle(vehicle, item(0, 5003, frame=3, param1=15.0, **at(60.0, 0.0)))
    vehicle.send(Command.NAV_RETURN_TO_LAUNCH)
    vehicle.run(1.0)
    assert any("No path home within the geofence" in text for text in vehicle.texts)
