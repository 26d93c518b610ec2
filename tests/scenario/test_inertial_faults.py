"""Inertial sensors that fail in flight; the simulator breaks them and its truth judges."""

import math
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.fault_notation import read_order
from sim.faults import Fault
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

HEIGHT_M = 10.0


class Hover:
    """A vehicle that hovers while something breaks, and how far it gets meanwhile."""

    def __init__(self, folder: Path, **config: float) -> None:
        self.tester = AutopilotTester(SimulationConfig(gps="rtk", **config), folder)  # type: ignore[arg-type]  # each a number of its own type
        self.tester.wait_until_ready()
        self.tester.take_off(HEIGHT_M)
        self.tester.run_for(22.0)
        self._start = self.tester.true_position()
        self.farthest_m = self.largest_height_error_m = self.largest_tilt_deg = 0.0
        self.tester.watch(self._note)

    def break_now(self, line: str) -> None:
        """Let something fail."""
        fault = read_order(line, self.tester.truth.time_us)
        assert isinstance(fault, Fault)
        self.tester.simulation.add_fault(fault)

    def said(self, text: str) -> bool:
        """Whether the vehicle has sent a text."""
        return any(text in line for line in self.tester.lines)

    def _note(self) -> None:
        north, east, up = (
            now - start for now, start in zip(self.tester.true_position(), self._start, strict=True)
        )
        self.farthest_m = max(self.farthest_m, math.hypot(north, east))
        self.largest_height_error_m = max(self.largest_height_error_m, abs(up))
        _, x, y, _ = self.tester.truth.q_ned_frd
        tilt = math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
        self.largest_tilt_deg = max(self.largest_tilt_deg, tilt)


@pytest.mark.parametrize(
    "line",
    [
        *(f"accel_bias z_m_s2={bias}" for bias in (-3, -2, -1, 1, 2, 3)),
        "accel_bias x_m_s2=2",
        "accel_bias x_m_s2=-1 y_m_s2=3",
    ],
)
def test_the_only_accelerometer_jumps_and_the_vehicle_lands_where_it_is(
    tmp_path: Path, line: str
) -> None:
    """One alarm, the accelerometer's; held within a metre, no harm, and not armed again."""
    hover = Hover(tmp_path, imus=1)
    tester = hover.tester
    hover.break_now(line)
    tester.run_for(3.0)  # Before the failsafe's landing
    assert hover.farthest_m < 1.0
    assert hover.largest_height_error_m < 0.6
    assert hover.largest_tilt_deg < 35.0
    assert hover.said("Accelerometer bias beyond its limit: LAND")
    assert not hover.said("Gyroscope")
    tester.wait_until_landed()
    assert not tester.simulation.wrecked
    assert hover.farthest_m < 1.5
    assert not hover.said("Gyroscope")
    tester.run_for(5.0)
    assert not tester.status.preflight_checks_pass
