"""The battery module on its topics, and on the simulated power monitor."""

import math

import pytest

from sim.config import SimulationConfig
from sim.simulation import Simulation
from uav_firmware.bus import Topic
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.modules.battery.module import BatteryModule
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.sensors import SensorBattery
from uav_firmware.parameters import Registry


class Bench:
    def __init__(self) -> None:
        self.registry = Registry()
        self.sensor: Topic[SensorBattery] = Topic()
        self.status: Topic[BatteryStatus] = Topic()
        self.module = BatteryModule(
            self.registry, sensor_battery=self.sensor, battery_status=self.status
        )

    def measure(self, time_s: float, voltage_v: float, current_a: float) -> BatteryStatus:
        self.sensor.publish(SensorBattery(round(time_s * 1e6), voltage_v, current_a))
        self.module.update()
        status = self.status.value
        assert status is not None
        return status


def test_each_sample_is_answered_once() -> None:
    bench = Bench()
    bench.module.update()
    assert bench.status.value is None
    assert bench.measure(0.1, 15.3, 2.0).voltage_v == 15.3
    bench.module.update()
    assert bench.status.count == 1


def test_a_sample_without_a_voltage_is_no_state_of_the_battery() -> None:
    bench = Bench()
    before = bench.measure(0.1, 15.3, 2.0)
    assert bench.measure(0.2, math.nan, 2.0) is before
    assert bench.measure(0.3, 15.2, math.nan).time_us == 300_000


def test_a_parameter_counts_from_the_next_sample_on() -> None:
    bench = Bench()
    bench.registry.set("BAT1_N_CELLS", 3)
    bench.registry.set("BAT1_CAPACITY", 2200.0)
    status = bench.measure(0.1, 3 * 3.825, 0.0)
    assert status.remaining == pytest.approx(0.5, abs=0.01)
    assert status.capacity_ah == pytest.approx(2.2)


@pytest.mark.first_case
@pytest.mark.parametrize("charge", [0.95, 0.5, 0.2])
def test_a_simulated_pack_in_hover_is_known_to_a_tenth(charge: float) -> None:
    vehicle = JsbsimVehicle(Simulation(SimulationConfig(battery_initial_charge=charge)))
    bench = Bench()
    vehicle.write_motors((0.4, 0.4, 0.4, 0.4))
    for _ in range(20 * 250):
        vehicle.advance()
        sample = vehicle.read_battery()
        if sample is not None:
            bench.sensor.publish(sample)
            bench.module.update()
    status = bench.status.value
    assert status is not None
    assert status.remaining == pytest.approx(charge, abs=0.1)
