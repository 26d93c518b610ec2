"""A plan's geofence on the project's own vehicle, from the work to the landing, by the truth."""

from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import EventType, Status
from afarcloud.geodesy import shifted
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.flying_world import FlyingWorld
from tests.support.vehicle_script import HOME

pytestmark = pytest.mark.scenario

FLIGHT = 1201
ARM = 400


def place(north_m: float, east_m: float) -> list[float]:
    latitude, _ = shifted(*HOME[:2], 0.0, north_m)
    _, longitude = shifted(*HOME[:2], 90.0, east_m)
    return [latitude, longitude]


def field(south: float, west: float, north: float, east: float) -> list[list[float]]:
    """A rectangle, metres from home."""
    return [place(south, west), place(south, east), place(north, east), place(north, west)]


def point(command_id: int, north_m: float, east_m: float) -> dict[str, Any]:
    latitude, longitude = place(north_m, east_m)
    return waypoint(command_id, latitude=latitude, longitude=longitude)


def fence_of(world: FlyingWorld) -> int:
    """How many items the vehicle's fence has."""
    held = world.autopilot.topics.fence.value
    return 0 if held is None else len(held.items)


@pytest.mark.promise
def test_a_mission_inside_flies_within_the_fence_and_leaves_none_behind(tmp_path: Path) -> None:
    world = FlyingWorld(tmp_path)
    fence = {
        "inclusion": [field(-10, -10, 20, 20)],
        "exclusion": [field(5, 5, 9, 9)],
        "max_altitude": 30.0,
    }
    round_it = mission(takeoff(), point(2, 14, 0), point(3, 14, 14), point(4, 0, 14), go_home(5))
    world.edge.plan(round_it, geofence=fence)
    world.run_until(lambda: world.edge.status(FLIGHT) == Status.RUNNING)
    assert fence_of(world) == 8
    while not world.is_over(FLIGHT):
        world.run(0.5)
        north, east, _ = world.place
        assert min(north, east) > -10
        assert max(north, east) < 20
        assert not (5 < north < 9 and 5 < east < 9)
    assert world.edge.statuses(FLIGHT) == [Status.FINISHED] * 5
    world.run_until(lambda: fence_of(world) == 0, within_s=30.0)
    world.run(5.0)
    set_m = [f.message.param_value for f in world.air.sent if f.kind == "PARAM_SET"]
    assert list(dict.fromkeys(set_m)) == [30.0, 0.0]  # GF_MAX_VER_DIST


def test_a_mission_that_crosses_is_refused_before_anything_moves(tmp_path: Path) -> None:
    world = FlyingWorld(tmp_path)
    across = mission(takeoff(), point(2, 14, 14), go_home())
    work = world.edge.plan(across, geofence={"exclusion": [field(5, 5, 9, 9)]})
    world.run_until_over(FLIGHT)
    assert world.edge.statuses(FLIGHT) == [Status.ABORTED, Status.FAILED, Status.ABORTED]
    (answer,) = world.edge.acknowledgements(work)
    assert answer["status"] == "refused"
    assert answer["message"].startswith("command 2: latitude, longitude: the leg there enters")
    world.run(5.0)
    assert fence_of(world) == 0
    assert world.orders(ARM) == []


def test_an_abort_to_a_place_outside_lands_where_the_vehicle_is(tmp_path: Path) -> None:
    world = FlyingWorld(tmp_path)
    there_and_back = mission(takeoff(), point(2, 15, 0), go_home())
    world.edge.plan(there_and_back, geofence={"inclusion": [field(-10, -10, 20, 20)]})
    world.run_until(lambda: world.running(FLIGHT) == 1)
    world.run(2.0)
    latitude, longitude = place(60, 0)
    outside = {"latitude": latitude, "longitude": longitude, "altitude": 5.0}
    event = world.edge.event(EventType.ABORT_MISSION, abort=outside)
    world.run_until(lambda: not world.is_armed)
    north, east, _ = world.place
    assert min(north, east) > -10
    assert max(north, east) < 20
    messages = [answer.get("message") or "" for answer in world.edge.acknowledgements(event)]
    assert any("outside geofence.inclusion" in message for message in messages)
