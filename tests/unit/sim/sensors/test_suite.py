"""Instruments are read at their rates."""

from collections import Counter

import pytest

from sim.config import SimulationConfig
from sim.physics.truth import Motors
from sim.sensors.suite import Schedule, SensorSuite
from tests.support.messages import fields_of
from tests.unit.sim.truths import truth

SECONDS = 10


def no_currents() -> Motors:
    return (0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def counts() -> Counter[str]:
    suite = SensorSuite(SimulationConfig())
    counted: Counter[str] = Counter()
    for step in range(SECONDS * 250):
        readings = suite.read(truth(step * 4000), no_currents)
        counted.update(name for name, value in fields_of(readings).items() if value is not None)
        for several in ("imus", "baros", "mags"):
            counted[several] -= None in getattr(readings, several)
    return counted


@pytest.mark.parametrize(
    ("instrument", "rate_hz"),
    [("imus", 250), ("baros", 50), ("mags", 50), ("gps", 10), ("battery", 10), ("esc", 125)],
)
def test_each_instrument_has_its_rate(counts: Counter[str], instrument: str, rate_hz: int) -> None:
    assert counts[instrument] == pytest.approx(SECONDS * rate_hz, abs=2)


def test_a_schedule_keeps_its_rate_between_steps_that_do_not_fit() -> None:
    schedule = Schedule(60)
    due = [time_us for time_us in range(0, 1_000_000, 4000) if schedule.due(time_us)]
    assert len(due) == 60
    assert len(due) == len(set(due))


def test_a_reading_bears_the_time_of_its_step() -> None:
    suite = SensorSuite(SimulationConfig())
    for step in range(10):
        readings = suite.read(truth(step * 4000), no_currents)
        assert readings.imu.time_us == step * 4000
        if readings.baro is not None:
            assert readings.baro.time_us == step * 4000
