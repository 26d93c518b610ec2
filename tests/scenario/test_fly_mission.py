"""The whole autopilot flies missions; the simulator's truth judges."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

ACCEPTANCE_M = 1.0
CORNERS = ((20.0, 0.0, 8.0), (20.0, 20.0, 10.0), (0.0, 20.0, 8.0), (-10.0, 10.0, 8.0))


class Track:
    """True positions north, east, up [m] and sink speeds [m/s], step by step."""

    def __init__(self, tester: AutopilotTester) -> None:
        self.positions: list[tuple[float, float, float]] = []
        self.sink_speeds: list[float] = []
        self._tester = tester
        tester.watch(self._note)

    def _note(self) -> None:
        self.positions.append(self._tester.true_position())
        self.sink_speeds.append(self._tester.truth.velocity_ned[2])

    def closest_to(self, place: tuple[float, float, float]) -> float:
        """Least distance [m] to a place."""
        return min(math.dist(position, place) for position in self.positions)

    def touch_down_speed(self) -> float:
        """Sink speed [m/s] when it was last three centimetres up."""
        last = max(index for index, position in enumerate(self.positions) if position[2] > 0.03)
        return self.sink_speeds[last]


def vehicle(folder: Path, **config: Any) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(gps="rtk", **config), folder)
    tester.wait_until_ready()
    return tester


def mission(tester: AutopilotTester) -> list[Any]:
    """Take-off, four waypoints, home."""
    station = tester.ground_station
    items = [
        station.mission_item(0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, 8.0), 0.0),
        *(
            station.mission_item(
                seq, common.MAV_CMD_NAV_WAYPOINT, tester.place(*corner), 0.0, ACCEPTANCE_M, 0.0
            )
            for seq, corner in enumerate(CORNERS, start=1)
        ),
    ]
    return [*items, station.return_item(len(items))]


def fly_mission(tester: AutopilotTester) -> Track:
    tester.upload(mission(tester))
    track = Track(tester)
    tester.start_mission()
    tester.wait_until_landed()
    return track


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_mission_passes_every_waypoint_and_ends_at_home(tmp_path: Path, seed: int) -> None:
    tester = vehicle(tmp_path, seed=seed)
    track = fly_mission(tester)
    for corner in CORNERS:
        assert track.closest_to(corner) < ACCEPTANCE_M
    north, east, up = tester.true_position()
    assert math.hypot(north, east) < 1.0
    assert abs(up) < 0.05
    assert track.touch_down_speed() < 0.7
    assert not tester.status.armed
    reached = tester.ground_station.items_reached  # each is announced several times
    assert list(dict.fromkeys(reached)) == [0, 1, 2, 3, 4, 5]
    assert not tester.simulation.wrecked


def test_the_same_seed_is_the_same_flight(tmp_path: Path) -> None:
    logs = []
    for run in ("first", "second"):
        path = tmp_path / run / "truth.csv"
        tester = vehicle(tmp_path / run, seed=4, wind_speed_m_s=4.0, truth_log_path=path)
        tester.take_off(5.0)
        tester.run_for(10.0)
        tester.simulation.close()
        logs.append(path.read_bytes())
    assert len(logs[0]) > 10_000
    assert logs[0] == logs[1]


def test_another_seed_is_another_flight(tmp_path: Path) -> None:
    ends = set()
    for seed in (5, 6):
        tester = vehicle(tmp_path / str(seed), seed=seed)
        tester.take_off(5.0)
        tester.run_for(5.0)
        ends.add(tester.true_position())
    assert len(ends) == 2


@pytest.mark.parametrize(
    ("noise", "horizontal", "vertical"), [(0.05, 0.05, 0.03), (1.0, 0.25, 0.15)]
)
def test_hover_stays_in_place(
    tmp_path: Path, noise: float, horizontal: float, vertical: float
) -> None:
    tester = vehicle(tmp_path, sensor_noise_factor=noise)
    tester.take_off(5.0)
    tester.run_for(12.0)
    estimates: list[tuple[float, float, float]] = []
    tester.watch(lambda: estimates.append(tester.estimate.position_ned))
    track = Track(tester)
    tester.run_for(30.0)
    assert _scatter(track.positions) < horizontal
    assert _rms(up - 5.0 for _, _, up in track.positions) < vertical
    assert _scatter(estimates) < 0.1


def test_wind_is_held_off_and_the_return_lands_at_home(tmp_path: Path) -> None:
    tester = vehicle(tmp_path, seed=7, wind_speed_m_s=6.0)
    tester.take_off(6.0)
    tester.run_for(12.0)
    track = Track(tester)
    tester.run_for(15.0)
    assert _scatter(track.positions) < 0.4
    tester.return_home()
    tester.wait_until_landed()
    north, east, _ = tester.true_position()
    assert math.hypot(north, east) < 1.0


@pytest.mark.promise
def test_landing_is_soft_and_ends_disarmed(tmp_path: Path) -> None:
    tester = vehicle(tmp_path, seed=8)
    tester.take_off(4.0)
    tester.run_for(8.0)
    track = Track(tester)
    tester.land()
    tester.wait_until_landed()
    assert track.touch_down_speed() < 0.7
    north, east, _ = tester.true_position()
    assert math.hypot(north, east) < 0.5
    assert max(tester.truth.rotor_rpm) < 1000.0


def _scatter(positions: Iterable[tuple[float, float, float]]) -> float:
    """Root mean square of the horizontal distance [m] from the mean place."""
    places = list(positions)
    north = sum(place[0] for place in places) / len(places)
    east = sum(place[1] for place in places) / len(places)
    return _rms(math.hypot(place[0] - north, place[1] - east) for place in places)


def _rms(values: Iterable[float]) -> float:
    squares = [value * value for value in values]
    return math.sqrt(sum(squares) / len(squares))


@pytest.mark.parametrize(("noise", "cross_track"), [(0.05, 0.12), (1.0, 0.30)])
def test_a_square_with_stops_is_flown_straight_and_without_overshoot(
    tmp_path: Path, noise: float, cross_track: float
) -> None:
    tester = vehicle(tmp_path, seed=9, sensor_noise_factor=noise)
    corners = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)]
    station = tester.ground_station
    takeoff = station.mission_item(0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, 5.0), 0.0)
    stops = [
        station.mission_item(
            seq,
            common.MAV_CMD_NAV_WAYPOINT,
            tester.place(north, east, 5.0),
            2.0,  # hold
            ACCEPTANCE_M,
            0.0,
        )
        for seq, (north, east) in enumerate(corners, start=1)
    ]
    tester.upload([takeoff, *stops])
    tester.start_mission()
    tester.wait_until(lambda: 1 in station.items_reached, 30.0, "above the start")
    track = Track(tester)
    tester.wait_until(lambda: 5 in station.items_reached, 60.0, "round the square")
    north, east, _ = zip(*track.positions, strict=True)
    assert _rms(_off_the_square(n, e) for n, e in zip(north, east, strict=True)) < cross_track
    assert max(*north, *east) < 20.0 + 0.5
    assert min(*north, *east) > -0.5


def _off_the_square(north: float, east: float) -> float:
    """Distance [m] from the nearest side of the 20 m square."""
    sides = (abs(north), abs(east), abs(north - 20.0), abs(east - 20.0))
    return min(sides)
