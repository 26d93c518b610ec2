"""The geofence: what it allows, which plans and orders it refuses, what it sees coming."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.toy_vehicle import HOME, NAN, ToyVehicle, at, item, takeoff, waypoint
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne
from uav_firmware.lib.fence_rules import check_fence
from uav_firmware.modules.navigator.geofence.geofence import Area, Disc, Geofence, Polygon
from uav_firmware.msg.geofence import Fence, FenceAction, FenceBreach, RallyPoints
from uav_firmware.msg.mission import MissionItem, NavigatorTarget, PlanType
from uav_firmware.msg.status import Command, NavigationState

ACCEPTED, DENIED = 0, 2
SQUARE = ((-30.0, -30.0), (-30.0, 30.0), (30.0, 30.0), (30.0, -30.0))

coordinate = st.floats(-50.0, 50.0)
points = st.tuples(coordinate, coordinate)
discs = st.builds(Disc, st.booleans(), points, st.floats(1.0, 60.0))
polygons = st.builds(Polygon, st.booleans(), st.lists(points, min_size=3, max_size=7).map(tuple))
fences = st.lists(st.one_of(discs, polygons), max_size=4).map(
    lambda areas: Geofence(tuple(areas), None, 40.0)
)


@given(fences, points, points)
def test_no_point_of_an_allowed_line_is_forbidden(
    fence: Geofence, start: tuple[float, float], end: tuple[float, float]
) -> None:
    allowed = fence.line_allowed(start, end)
    for k in range(101):
        share = k / 100.0
        point = (
            start[0] + share * (end[0] - start[0]),
            start[1] + share * (end[1] - start[1]),
        )
        if abs(fence.margin(point)) > 1e-3 and allowed:
            assert fence.allows(point)
        if not allowed and fence.margin(point) < -1e-3:
            return


@given(fences, points, st.floats(1.0, 40.0))
def test_no_point_of_an_allowed_circle_is_forbidden(
    fence: Geofence, centre: tuple[float, float], radius: float
) -> None:
    if not fence.circle_allowed(centre, radius):
        return
    for k in range(180):
        bearing = math.radians(2.0 * k)
        point = (centre[0] + radius * math.cos(bearing), centre[1] + radius * math.sin(bearing))
        assert fence.allows(point) or abs(fence.margin(point)) < 1e-3


@given(fences, points)
def test_the_margin_is_positive_where_it_is_allowed(
    fence: Geofence, point: tuple[float, float]
) -> None:
    margin = fence.margin(point)
    if margin > 1e-6:
        assert fence.allows(point)
    elif margin < -1e-6:
        assert not fence.allows(point)


@given(fences, points, st.floats(-math.pi, math.pi), st.floats(0.0, 0.99))
def test_no_boundary_is_nearer_than_the_margin(
    fence: Geofence, point: tuple[float, float], direction: float, share: float
) -> None:
    margin = fence.margin(point)
    if not 0.01 < margin < math.inf:
        return
    distance = share * margin
    there = (point[0] + distance * math.cos(direction), point[1] + distance * math.sin(direction))
    assert fence.allows(there)


@pytest.mark.parametrize(
    ("areas", "start", "end"),
    [
        ((Polygon(False, ((5.0, -5.0), (5.0, 5.0), (15.0, 5.0), (15.0, -5.0))),), (0, 0), (20, 0)),
        ((Disc(False, (10.0, 0.0), 3.0),), (0, 0), (20, 0)),
        ((Disc(True, (0.0, 0.0), 12.0), Disc(True, (30.0, 0.0), 12.0)), (0, 0), (30, 0)),
    ],
)
def test_a_line_through_an_exclusion_is_not_allowed_though_both_ends_are(
    areas: tuple[Area, ...], start: tuple[float, float], end: tuple[float, float]
) -> None:
    fence = Geofence(areas)
    assert fence.allows(start)
    assert fence.allows(end)
    assert not fence.line_allowed(start, end)


def test_two_inclusion_areas_that_overlap_are_one() -> None:
    fence = Geofence((Disc(True, (0.0, 0.0), 12.0), Disc(True, (20.0, 0.0), 12.0)))
    assert fence.line_allowed((-10.0, 0.0), (30.0, 0.0))


def polygon(command: int, *corners: tuple[float, float], count: float = 4.0) -> list[MissionItem]:
    return [
        item(seq, command, frame=3, param1=count, **at(*corner))
        for seq, corner in enumerate(corners)
    ]


def fence_vehicle(vehicle: ToyVehicle, *items: MissionItem) -> None:
    numbered = tuple(one._replace(seq=seq) for seq, one in enumerate(items))
    assert check_fence(numbered) is None
    vehicle.fence.publish(Fence(vehicle.now_us, 1, numbered))
    vehicle.run(0.2)


EXCLUSION = [item(0, 5004, frame=3, param1=5.0, **at(15.0, 0.0))]


@pytest.mark.parametrize(
    ("items", "seq", "text"),
    [
        ([waypoint(1, 40.0, 0.0)], 1, "outside"),
        ([waypoint(1, 29.0, 0.0)], 1, "the path there"),
        ([waypoint(1, 0.0, 20.0), waypoint(2, 15.0, 0.0)], 2, "outside"),
        ([waypoint(1, 0.0, 20.0, height=60.0)], 1, "GF_MAX_VER_DIST"),
        (
            [
                waypoint(1, 0.0, 5.0),
                waypoint(2, 25.0, 20.0),
                waypoint(3, 25.0, 0.0),
                item(4, 177, param1=1.0, param2=1.0),
            ],
            4,
            "jump",
        ),
        (
            [
                waypoint(1, 0.0, 20.0),
                waypoint(2, 25.0, 20.0),
                waypoint(3, 25.0, 0.0),
                item(4, 20),
            ],
            4,
            "the return leaves",
        ),
    ],
)
def test_a_mission_that_leaves_the_fence_is_refused(
    items: list[MissionItem], seq: int, text: str
) -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("GF_MAX_VER_DIST", 50.0)
    vehicle.run(0.5)
    fence_vehicle(vehicle, *polygon(5001, *SQUARE), *EXCLUSION)
    rejection = vehicle.check_mission([takeoff(), *items])
    assert rejection is not None
    assert rejection.seq == seq
    assert text in rejection.reason


def test_a_mission_within_the_fence_is_accepted_until_the_fence_moves() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    fence_vehicle(vehicle, *polygon(5001, *SQUARE), *EXCLUSION)
    mission = (takeoff(), waypoint(1, 0.0, 20.0), waypoint(2, 25.0, 20.0))
    assert vehicle.check_mission(mission) is None
    vehicle.upload(*mission)
    vehicle.run(0.2)
    fence_vehicle(vehicle, item(0, 5003, frame=3, param1=10.0, **at(0, 0)))
    status = vehicle.navigator_status.value
    assert status is not None
    assert status.mission_rejection is not None


@pytest.mark.parametrize(
    ("north", "east", "height", "text"),
    [
        (40.0, 0.0, 5.0, "target lies outside"),
        (25.0, 0.0, 5.0, "the path there"),
        (0.0, 20.0, 60.0, "GF_MAX_VER_DIST"),
    ],
)
def test_an_order_beyond_the_fence_is_denied(
    north: float, east: float, height: float, text: str
) -> None:
    vehicle = airborne()
    vehicle.registry.set("GF_MAX_VER_DIST", 50.0)
    fence_vehicle(vehicle, *polygon(5001, *SQUARE), *EXCLUSION)
    place = at(north, east)
    values = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] + height)
    assert vehicle.send(Command.DO_REPOSITION, *values) == DENIED
    assert text in vehicle.texts[-1]


def test_a_circle_across_the_fence_is_denied_and_one_within_is_flown() -> None:
    vehicle = airborne()
    fence_vehicle(vehicle, *polygon(5001, *SQUARE), *EXCLUSION)
    for centre, radius, result in (((0.0, 25.0), 8.0, DENIED), ((-10.0, 10.0), 8.0, ACCEPTED)):
        place = at(*centre)
        values = (radius, 2.0, 0.0, 0.0, place["x"], place["y"], NAN)
        assert vehicle.send(Command.DO_ORBIT, *values) == result
    assert vehicle.mode is NavigationState.ORBIT


def test_a_breach_is_predicted_and_counted_once() -> None:
    vehicle = airborne()
    place = at(60.0, 0.0)
    values = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], NAN)
    assert vehicle.send(Command.DO_REPOSITION, *values) == ACCEPTED
    vehicle.run(2.0)
    fence_vehicle(vehicle, *polygon(5001, *SQUARE))
    status = vehicle.geofence_status

    def foreseen(_: ToyVehicle) -> bool:
        return status.value is not None and status.value.predicted is FenceBreach.BOUNDARY

    vehicle.run_until(foreseen, 30.0)
    assert status.value is not None
    assert status.value.breach is FenceBreach.NONE
    assert status.value.action is FenceAction.HOLD
    assert vehicle.set_mode(3) == ACCEPTED
    vehicle.run(5.0)
    assert vehicle.position[0] < 30.5
    assert status.value.breach_count <= 1


def test_on_the_ground_nothing_is_breached() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    fence_vehicle(vehicle, item(0, 5004, frame=3, param1=20.0, **at(0, 0)))
    status = vehicle.geofence_status.value
    assert status is not None
    assert status.breach is FenceBreach.NONE
    assert status.breach_count == 0


def rally(vehicle: ToyVehicle, north: float, east: float, height: float = 0.0) -> None:
    items = (item(0, 5100, frame=3, z=height, **at(north, east)),)
    assert vehicle.check_plan(PlanType.RALLY_POINTS, items) is None
    vehicle.rally_points.publish(RallyPoints(vehicle.now_us, 1, items))
    vehicle.run(0.1)


def fly_out(vehicle: ToyVehicle, north: float, east: float) -> None:
    place = at(north, east)
    values = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], NAN)
    assert vehicle.send(Command.DO_REPOSITION, *values) == ACCEPTED
    vehicle.run_until(lambda v: math.dist(v.position[:2], (north, east)) < 0.1, 60.0)


@pytest.mark.first_case
@pytest.mark.parametrize(("north", "destination"), [(50.0, (40.0, 10.0)), (10.0, (0.0, 0.0))])
def test_a_return_leads_to_the_nearest_of_home_and_rally_points(
    north: float, destination: tuple[float, float]
) -> None:
    vehicle = airborne()
    rally(vehicle, 40.0, 10.0)
    fly_out(vehicle, north, 0.0)
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert math.dist(vehicle.position[:2], destination) < 0.3


def test_a_return_keeps_to_the_rally_point_that_the_fence_lets_it_reach() -> None:
    vehicle = airborne()
    fly_out(vehicle, 30.0, 0.0)
    rally(vehicle, 32.0, 30.0)
    fence_vehicle(vehicle, item(0, 5004, frame=3, param1=6.0, **at(15.0, 0.0)))
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert math.dist(vehicle.position[:2], (32.0, 30.0)) < 0.3


def test_a_return_from_a_breach_leads_to_the_return_point_below_the_ceiling() -> None:
    vehicle = airborne()
    vehicle.registry.set("GF_MAX_VER_DIST", 12.0)
    fly_out(vehicle, 40.0, 0.0)
    fence_vehicle(vehicle, *polygon(5001, *SQUARE), item(4, 5000, frame=3, **at(10.0, 10.0)))
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) == ACCEPTED
    begin = len(vehicle.track)
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert math.dist(vehicle.position[:2], (10.0, 10.0)) < 0.3
    assert max(-down for _, _, down in vehicle.track[begin:]) < 12.5


@pytest.mark.first_case
@pytest.mark.parametrize("begin_height_m", [8.0, 14.0, 18.0])
def test_a_return_keeps_away_from_the_ceiling_also_when_it_begins_above(
    begin_height_m: float,
) -> None:
    vehicle = airborne()
    place = at(40.0, 0.0)
    values = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], begin_height_m)
    assert vehicle.send(Command.DO_REPOSITION, *values, frame=6) == ACCEPTED
    vehicle.run_until(lambda v: math.dist(v.position, (40.0, 0.0, -begin_height_m)) < 0.1, 60.0)
    vehicle.registry.set("GF_ACTION", 1.0)
    vehicle.registry.set("GF_MAX_VER_DIST", 15.0)
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) == ACCEPTED
    begin = len(vehicle.track)
    vehicle.run_until(lambda v: not v.armed, 120.0)
    in_transit = [-down for north, _, down in vehicle.track[begin:] if 2.0 < north < 38.0]
    assert in_transit
    assert all(13.5 < height < 14.5 for height in in_transit)


def test_a_target_sent_with_a_new_geofence_is_checked_by_it() -> None:
    vehicle = airborne()
    place = at(40.0, 0.0)
    goal = NavigatorTarget(
        vehicle.now_us, NavigationState.AUTO_LOITER, place["x"], place["y"], NAN, NAN, NAN
    )
    circle = item(0, 5003, frame=3, param1=20.0, **at(0.0, 0.0))
    vehicle.fence.publish(Fence(vehicle.now_us, 1, (circle,)))
    assert vehicle.check_target(goal)
    vehicle.fence.publish(Fence(vehicle.now_us, 0, ()))
    assert not vehicle.check_target(goal)
