"""A receiver that jumps while the other sensors are sound, by the simulator's truth."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from sim.config import SimulationConfig
from sim.fault_schedule import ALL_INSTANCES, Fault, Kind
from tests.scenario.test_failsafe_flight import on_mission, strike
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.lib.rotation import tilt_of
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

HEIGHT_M = 10.0


class Watch:
    """What the vehicle truly does from now on."""

    def __init__(self, tester: AutopilotTester) -> None:
        self._tester = tester
        self._start = tester.true_position()
        self.away_m = self.tilt_deg = self.speed_m_s = 0.0
        self.heights_m: list[float] = []
        tester.watch(self._look)

    def _look(self) -> None:
        north, east, up = self._tester.true_position()
        attitude = self._tester.autopilot.topics.vehicle_attitude.value
        assert attitude is not None
        self.tilt_deg = max(self.tilt_deg, math.degrees(tilt_of(attitude.q_ned_frd)))
        self.away_m = max(self.away_m, math.hypot(north - self._start[0], east - self._start[1]))
        velocity = self._tester.truth.velocity_ned
        self.speed_m_s = max(self.speed_m_s, math.hypot(*velocity[:2]))
        self.heights_m.append(up)


def hovering(folder: Path) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(), folder)
    tester.wait_until_ready()
    tester.take_off(HEIGHT_M)
    tester.wait_until(lambda: tester.true_position()[2] > HEIGHT_M - 0.4, 30.0, "at its height")
    tester.run_for(5.0)
    return tester


class Jump(NamedTuple):
    """A step of the receiver's position."""

    north_m: float
    up_m: float
    sentence: str


@pytest.mark.parametrize(
    "jump",
    [
        Jump(0.0, 30.0, "GPS height disagrees"),
        Jump(0.0, -30.0, "GPS height disagrees"),
        Jump(20.0, 0.0, "GPS position disagrees"),
        Jump(100.0, 0.0, "GPS position disagrees"),
    ],
)
def test_a_hover_stays_where_it_is_and_the_operator_is_warned(tmp_path: Path, jump: Jump) -> None:
    tester = hovering(tmp_path)
    watch = Watch(tester)
    strike(tester, Kind.GPS_JUMP, 15.0, north_m=jump.north_m, up_m=jump.up_m)
    tester.run_for(14.0)
    assert tester.has_status_text(jump.sentence)
    tester.run_for(10.0)
    assert tester.has_status_text(f"{jump.sentence}, not used: over")
    assert watch.away_m < 2.0
    assert min(watch.heights_m) > HEIGHT_M - 1.5
    assert max(watch.heights_m) < HEIGHT_M + 1.5
    assert watch.tilt_deg < 8.0
    assert tester.mode is NavigationState.AUTO_LOITER


def test_with_the_barometer_frozen_too_the_height_is_kept(tmp_path: Path) -> None:
    tester = hovering(tmp_path)
    watch = Watch(tester)
    strike(tester, Kind.BARO_FROZEN, instance=ALL_INSTANCES)
    tester.run_for(3.0)
    strike(tester, Kind.GPS_JUMP, up_m=30.0)
    tester.run_for(30.0)
    assert tester.has_status_text("Barometer")
    assert tester.has_status_text("GPS height disagrees")
    assert min(watch.heights_m) > HEIGHT_M - 2.0
    assert max(watch.heights_m) < HEIGHT_M + 2.0
    tester.land()
    tester.wait_until(lambda: not tester.status.armed, 60.0, "disarmed")
    assert not tester.simulation.wrecked


PHASES: dict[str, Callable[[AutopilotTester], None]] = {
    "mission": lambda tester: tester.run_for(0.0),
    "return": AutopilotTester.return_home,
    "land": AutopilotTester.land,
}


@pytest.mark.parametrize("phase", PHASES)
def test_a_flight_ends_on_the_ground_near_where_it_should(tmp_path: Path, phase: str) -> None:
    tester = on_mission(tmp_path)
    PHASES[phase](tester)
    tester.run_for(1.5)
    struck_at = tester.true_position()
    strike(tester, Kind.GPS_JUMP, north_m=20.0, east_m=-10.0, up_m=20.0)
    tester.wait_until(lambda: not tester.status.armed, 240.0, "disarmed")
    assert not tester.simulation.wrecked
    goal = struck_at[:2] if phase == "land" else (0.0, 0.0)
    assert math.dist(tester.true_position()[:2], goal) < 6.0
    assert tester.has_status_text("GPS position disagrees")


def test_a_jump_during_the_climb_does_not_end_the_climb(tmp_path: Path) -> None:
    tester = AutopilotTester(SimulationConfig(), tmp_path)
    tester.wait_until_ready()
    tester.take_off(HEIGHT_M)
    tester.wait_until(lambda: tester.true_position()[2] > 2.0, 30.0, "2 m up")
    watch = Watch(tester)
    now_us = tester.simulation.time_us
    values = {"north_m": 20.0, "up_m": -30.0}
    tester.simulation.add_fault(Fault(kind=Kind.GPS_JUMP, start_us=now_us, values=values))
    tester.run_for(20.0)
    assert tester.true_position()[2] == pytest.approx(HEIGHT_M, abs=1.5)
    assert max(watch.heights_m) < HEIGHT_M + 1.5
    assert watch.away_m < 2.5
