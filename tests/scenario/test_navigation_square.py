"""A 20 m square on the simulated airframe: how long it takes and how closely it is flown."""

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
