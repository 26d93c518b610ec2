"""Legs on the simulated airframe: how long they take, how closely and how fast they are flown."""

import math
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

SIDE_M = 20.0
CORNERS = ((SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0))


def beside_the_square(north: float, east: float) -> float:
    """Distance [m] from the nearest side."""
    inside = 0.0 <= north <= SIDE_M and 0.0 <= east <= SIDE_M
    if inside:
        return min(north, east, SIDE_M - north, SIDE_M - east)
    return math.hypot(
        max(-north, 0.0, north - SIDE_M),
        max(-east, 0.0, east - SIDE_M),
    )


@pytest.mark.parametrize(
    ("speed", "wind", "cross_track"),
    [(2.5, 0.0, 0.15), (5.0, 0.0, 0.15), (2.5, 6.0, 0.25)],
)
def test_two_laps_flown_through(
    tmp_path: Path, speed: float, wind: float, cross_track: float
) -> None:
    config = SimulationConfig(seed=2, gps="rtk", wind_speed_m_s=wind)
    tester = AutopilotTester(config, tmp_path)
    tester.autopilot.registry.set("MPC_XY_CRUISE", speed)
    tester.wait_until_ready()
    station = tester.ground_station
    corners = CORNERS * 2
    takeoff = station.mission_item(0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, 5.0), 0.0)
    laps = [
        station.mission_item(
            seq, common.MAV_CMD_NAV_WAYPOINT, tester.place(north, east, 5.0), 0.0, 1.0, 0.0
        )
        for seq, (north, east) in enumerate(corners, start=1)
    ]
    tester.upload([takeoff, *laps])
    tester.start_mission()
    tester.wait_until(lambda: 0 in station.items_reached, 30.0, "above the start")
    squares: list[float] = []

    def note() -> None:
        north, east, _ = tester.true_position()
        squares.append(beside_the_square(north, east) ** 2)

    tester.watch(note)
    begin_us = tester.autopilot.vehicle.time_us
    tester.wait_until(lambda: len(corners) in station.items_reached, 90.0, "two laps")
    if speed == 5.0:
        assert tester.autopilot.vehicle.time_us - begin_us <= 40_100_000
    assert math.sqrt(sum(squares) / len(squares)) <= cross_track
    assert math.sqrt(max(squares)) < 1.0


@pytest.mark.parametrize("speed", [1.5, 5.0])
def test_no_leg_is_faster_than_the_speed_that_was_ordered(tmp_path: Path, speed: float) -> None:
    """Up, up a slope, down a slope, level, and straight up: by the whole true velocity."""
    tester = AutopilotTester(SimulationConfig(seed=2, gps="rtk"), tmp_path)
    tester.wait_until_ready()
    station = tester.ground_station
    slower = station.mission_item(0, common.MAV_CMD_DO_CHANGE_SPEED, (0.0, 0.0, 0.0), 1, speed, -1)
    takeoff = station.mission_item(1, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, 5.0), 0.0)
    long_m = 5.0 * speed
    places = [
        (0.6 * long_m, 0.0, 5.0 + 0.3 * long_m),
        (0.6 * long_m, 0.6 * long_m, 5.0),
        (0.6 * long_m, 1.6 * long_m, 5.0),
        (0.6 * long_m, 1.6 * long_m, 5.0 + 0.6 * long_m),
    ]
    legs = [
        station.mission_item(seq, common.MAV_CMD_NAV_WAYPOINT, tester.place(*place), hold, 1.0, 0.0)
        for seq, (place, hold) in enumerate(zip(places, (0.0, 0.0, 1.0, 0.0), strict=True), 2)
    ]
    tester.upload([slower, takeoff, *legs])
    tester.start_mission()
    fastest: dict[int, float] = {}

    def note() -> None:
        leg = max(station.items_reached, default=-1)
        fastest[leg] = max(fastest.get(leg, 0.0), math.hypot(*tester.simulation.truth.velocity_ned))

    tester.watch(note)
    tester.wait_until(lambda: len(legs) + 1 in station.items_reached, 90.0, "all legs")
    assert max(fastest.values()) <= 1.05 * speed, fastest
    assert max(fastest.values()) >= 0.95 * speed, fastest
