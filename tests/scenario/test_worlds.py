"""The same flight at every home: north and south, on the date line, on the equator, high up."""

import math
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.physics.worlds import WORLDS
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

SQUARE = ((20.0, 0.0, 5.0), (20.0, 20.0, 5.0), (0.0, 20.0, 5.0), (0.0, 0.0, 5.0))
METRES_PER_DEGREE = 111_195.0


def east_of_start_m(tester: AutopilotTester) -> float:
    """True metres east of the start, over the date line too."""
    turn = (tester.truth.longitude_deg - tester.start.longitude_deg + 180.0) % 360.0 - 180.0
    return turn * METRES_PER_DEGREE * math.cos(math.radians(tester.start.latitude_deg))


@pytest.mark.parametrize("name", sorted(WORLDS))
def test_a_square_is_flown_and_the_vehicle_lands_at_home(tmp_path: Path, name: str) -> None:
    world = WORLDS[name]
    config = SimulationConfig(
        gps="rtk",
        seed=7,
        home_latitude_deg=world.latitude_deg,
        home_longitude_deg=world.longitude_deg,
        home_altitude_amsl_m=world.altitude_amsl_m,
    )
    tester = AutopilotTester(config, tmp_path)
    tester.wait_until_ready()
    tester.wait_until(lambda: tester.estimate.heading_valid, 1.0, "heading aligned")
    heading_deg = math.degrees(tester.estimate.heading)
    assert abs((heading_deg + 180.0) % 360.0 - 180.0) < 5.0, "the compass is read for this place"
    reached = [math.inf] * len(SQUARE)

    def note() -> None:
        north, _, up = tester.true_position()
        position = (north, east_of_start_m(tester), up)
        for index, corner in enumerate(SQUARE):
            reached[index] = min(reached[index], math.dist(position, corner))

    tester.watch(note)
    station = tester.ground_station
    items = [station.mission_item(0, 22, tester.place(0.0, 0.0, 5.0), 0.0)]
    for seq, corner in enumerate(SQUARE, start=1):
        latitude, longitude, height = tester.place(*corner)
        longitude = (longitude + 180.0) % 360.0 - 180.0
        items.append(station.mission_item(seq, 16, (latitude, longitude, height), 0.0, 1.0, 0.0))
    items.append(station.return_item(len(items)))
    tester.upload(items)
    tester.start_mission()
    tester.wait_until_landed(180.0)
    assert max(reached) < 1.2
    north, _, up = tester.true_position()
    assert math.hypot(north, east_of_start_m(tester)) < 1.0
    assert abs(up) < 0.1
