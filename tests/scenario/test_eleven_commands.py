"""Every command once, from the example's plan to the results, on this project's own vehicle."""

import math
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.planning import target_commands
from tests.soak.broker_death import PATIENCE_S, eleven_commands, judge_reports
from tests.support.flying_world import FlyingWorld

pytestmark = pytest.mark.scenario

HOLD_AND_RADIUS_M = 2.0
FOLLOWED_S = 15.0
"""How long a target is followed and tracked here: the time of a real mission shows no more."""


def judge_measurements(world: FlyingWorld, measured: dict[str, Any]) -> None:
    """Hold a list of observations against the farm's maps at its place."""
    farm, time_s = world.simulation.farm, world.simulation.farm_time_s
    place = (measured["latitude"], measured["longitude"], time_s)
    values = {o["observed_property"]: o["result_value"] for o in measured["observation_array"]}
    assert values["soil_moisture"] == pytest.approx(100.0 * farm.soil_moisture(*place), abs=5.0)
    assert values["soil_temperature"] == pytest.approx(farm.soil_temperature(*place), abs=2.6)
    air = (*place, measured["altitude"])
    assert values["air_temperature"] == pytest.approx(farm.air_temperature(*air), abs=0.8)
    assert values["relative_humidity"] == pytest.approx(farm.relative_humidity(*air), abs=6.0)


@pytest.mark.promise
def test_all_eleven_commands_are_flown_and_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(target_commands, "FOLLOWED_FOR_S", FOLLOWED_S)
    monkeypatch.setattr(target_commands, "TRACKED_FOR_S", FOLLOWED_S)
    flown = eleven_commands()
    assert sorted(c["command_type_id"] for c in flown["command_array"]) == list(range(1, 12))
    world = FlyingWorld(tmp_path)
    work = world.edge.plan(flown)
    bearings: list[float] = []
    fastest_m_s = 0.0
    hotpoint = flown["command_array"][4]["parameters"]
    centre = world.ground.north_east_m(hotpoint["latitude"], hotpoint["longitude"])
    while not world.is_over(flown["mission_id"]):
        assert world.clock.now_s < PATIENCE_S, world.outline()
        world.run(0.1)
        fastest_m_s = max(fastest_m_s, math.hypot(*world.simulation.truth.velocity_ned))
        if world.mode == "ORBIT":
            north, east = (a - b for a, b in zip(world.place, centre, strict=False))
            if abs(math.hypot(north, east) - hotpoint["radius"]) < HOLD_AND_RADIUS_M:
                bearings.append(math.degrees(math.atan2(east, north)) % 360.0)

    judge_reports(world.edge, flown)
    assert world.edge.statuses(flown["mission_id"]) == [Status.FINISHED] * 11
    assert [a["status"] for a in world.edge.acknowledgements(work)] == ["accepted"]

    # The results follow the commands: where each ended
    poses = world.edge.bodies("/pose/")
    assert len(poses) == len(world.edge.bodies("/battery/")) == 11
    for index in (1, 2):
        wanted = flown["command_array"][index]["parameters"]
        assert poses[index]["altitude"] == pytest.approx(wanted["altitude"], abs=1.5)
        away = math.dist(
            world.ground.north_east_m(wanted["latitude"], wanted["longitude"]),
            world.ground.north_east_m(poses[index]["latitude"], poses[index]["longitude"]),
        )
        assert away < HOLD_AND_RADIUS_M

    # What was measured is true to the farm, within the instruments' noise
    observations = world.edge.bodies("/observation/")
    assert len(observations) >= 11
    for measured in observations:
        judge_measurements(world, measured)

    # The truth: it was no faster than it may be, went all the way round, took its pictures, and
    # stands at home
    assert fastest_m_s <= 1.05 * flown["maximum_speed"]
    assert {int(bearing // 45) for bearing in bearings} == set(range(8))
    assert world.pictures == 3 + 8
    assert math.hypot(*world.place[:2]) < 1.0
    assert not world.is_armed
    for command in (
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_PANORAMA_CREATE,
        mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE,
    ):
        assert world.order_counts[command] == 1
