"""An instrument that is wrong costs itself: the vehicle stays in the air, and lands gently."""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from sim.config import SimulationConfig
from sim.physics.truth import Motors
from sim.sensors.readings import Readings
from tests.support.autopilot_tester import AutopilotTester
from tests.support.messages import changed

pytestmark = pytest.mark.scenario

HEIGHT_M: Final = 8.0
LIES_S: Final = 12.0
GENTLE_M_S: Final = 1.0
NEAR_M: Final = 0.3
"""Of the centre of mass, 0.15 m over the feet: a sink speed so low is that of the touch-down."""

Lie = Callable[[Any, random.Random], Any]
ANY_M_S: Final = 30.0

LIES: Final[dict[str, tuple[str, Lie]]] = {
    "standing rotors": ("esc", lambda esc, _: changed(esc, rotor_rpm=(0.0,) * 4)),
    "infinite rotors": ("esc", lambda esc, _: changed(esc, rotor_rpm=(math.inf,) * 4)),
    "no rotors": ("esc", lambda _esc, _: None),
    "any GPS velocity": (
        "gps",
        lambda gps, chance: gps._replace(
            velocity_ned=tuple(chance.uniform(-ANY_M_S, ANY_M_S) for _ in range(3))
        ),
    ),
    "GPS velocity 1 m/s off": (
        "gps",
        lambda gps, _: gps._replace(
            velocity_ned=(gps.velocity_ned[0] + 1.0, *gps.velocity_ned[1:])
        ),
    ),
    "GPS accuracies of 0": (
        "gps",
        lambda gps, _: gps._replace(
            horizontal_accuracy_m=0.0, vertical_accuracy_m=0.0, speed_accuracy_m_s=0.0
        ),
    ),
    "GPS from elsewhere": ("gps", lambda gps, _: gps._replace(latitude_deg=0.0)),
    "GPS of the future": ("gps", lambda gps, _: gps._replace(time_us=gps.time_us + 5_000_000)),
    "no GPS numbers": ("gps", lambda gps, _: gps._replace(latitude_deg=math.nan)),
    "any distance": (
        "range",
        lambda sample, chance: sample._replace(distance_m=chance.uniform(0.0, 40.0)),
    ),
    "battery without a voltage": (
        "battery",
        lambda battery, _: battery._replace(voltage_v=math.nan),
    ),
}


class Liar:
    """A vehicle in hover, of which one instrument lies from now on."""

    def __init__(self, folder: Path, name: str) -> None:
        self.tester = AutopilotTester(SimulationConfig(seed=3, wind_speed_m_s=3.0), folder)
        self.tester.wait_until_ready()
        self.tester.take_off(HEIGHT_M)
        self.tester.run_for(3.0)
        self._instrument, self._lie = LIES[name]
        self._chance = random.Random(3)
        simulation = self.tester.simulation
        self._step = simulation.step
        simulation.step = self._step_lying  # type: ignore[method-assign]  # Before the drivers
        self.start = self.tester.true_position()
        self.farthest_m = self.touch_down_m_s = 0.0
        self.tester.watch(self._observe)

    def _step_lying(self, motors: Motors) -> Readings:
        readings = self._step(motors)
        value = getattr(readings, self._instrument)
        if value is None:
            return readings
        return changed(readings, **{self._instrument: self._lie(value, self._chance)})

    def _observe(self) -> None:
        north, east, _ = self.tester.true_position()
        away_m = math.hypot(north - self.start[0], east - self.start[1])
        self.farthest_m = max(self.farthest_m, away_m)
        if self.tester.truth.height_above_home_m < NEAR_M:
            self.touch_down_m_s = max(self.touch_down_m_s, self.tester.truth.velocity_ned[2])


@pytest.mark.first_case
@pytest.mark.promise
@pytest.mark.parametrize("name", list(LIES))
def test_an_instrument_that_lies_brings_no_vehicle_down(tmp_path: Path, name: str) -> None:
    liar = Liar(tmp_path, name)
    tester = liar.tester
    tester.run_for(LIES_S)
    if tester.status.armed:
        tester.land()
        tester.wait_until_landed()
    assert not tester.simulation.wrecked
    assert 0.0 < liar.touch_down_m_s < GENTLE_M_S
    assert liar.farthest_m < 10.0


def test_a_vehicle_in_hover_does_not_follow_a_velocity_that_the_position_contradicts(
    tmp_path: Path,
) -> None:
    liar = Liar(tmp_path, "GPS velocity 1 m/s off")
    liar.tester.run_for(45.0)
    assert liar.tester.has_status_text("GPS velocity disagrees, not used")
    assert liar.farthest_m < 4.0
