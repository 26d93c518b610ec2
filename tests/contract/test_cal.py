"""Every driver of a vehicle keeps the promises of `uav_firmware.cal.vehicle`."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from sim.config import SimulationConfig
from sim.sensors.rangefinder import MAXIMUM_M, MINIMUM_M
from sim.simulation import Simulation
from tests.support.messages import fields_of, said
from uav_firmware.cal.vehicle import Vehicle
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorBattery,
    SensorGps,
    SensorImu,
    SensorMag,
    SensorTruth,
)

Read = Callable[[Vehicle], SensorBaro | SensorMag | SensorGps | SensorBattery | None]


def jsbsim(folder: Path) -> Vehicle:
    config = SimulationConfig(truth_log_path=folder / "truth.csv")
    return JsbsimVehicle(Simulation(config))


@pytest.fixture(params=[jsbsim])
def vehicle(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Vehicle]:
    make: Callable[[Path], Vehicle] = request.param
    made = make(tmp_path)
    yield made
    made.close()


def run(vehicle: Vehicle, seconds: float) -> Iterator[None]:
    """Step through `seconds`, pausing after each step."""
    for _ in range(round(seconds * 1e6 / vehicle.step_us)):
        vehicle.advance()
        yield


def test_boot_is_time_zero(vehicle: Vehicle) -> None:
    assert vehicle.time_us == 0


def test_control_runs_at_250_hz_or_more(vehicle: Vehicle) -> None:
    assert 0 < vehicle.step_us <= 4000


def test_time_passes_by_one_step_and_only_in_advance(vehicle: Vehicle) -> None:
    vehicle.write_motors((0.1, 0.1, 0.1, 0.1))
    vehicle.read_imu()
    assert vehicle.time_us == 0
    vehicle.advance()
    assert vehicle.time_us == vehicle.step_us


def test_there_is_a_fresh_inertial_sample_in_every_step(vehicle: Vehicle) -> None:
    assert isinstance(vehicle.read_imu(), SensorImu)
    for _ in run(vehicle, 0.1):
        assert vehicle.read_imu().time_us == vehicle.time_us


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("read", "kind", "minimum_hz", "maximum_hz"),
    [
        (lambda vehicle: vehicle.read_baro(), SensorBaro, 25, 100),
        (lambda vehicle: vehicle.read_mag(), SensorMag, 25, 100),
        (lambda vehicle: vehicle.read_gps(), SensorGps, 5, 10),
        (lambda vehicle: vehicle.read_battery(), SensorBattery, 5, 50),
    ],
)
def test_samples_come_at_their_rate_with_rising_times(
    vehicle: Vehicle, read: Read, kind: type, minimum_hz: int, maximum_hz: int
) -> None:
    times = []
    for _ in run(vehicle, 6.0):
        sample = read(vehicle)
        if sample is not None:
            assert type(sample) is kind
            assert 0 <= vehicle.time_us - sample.time_us <= 500_000
            times.append(sample.time_us)
    assert times == sorted(set(times))
    assert 6 * minimum_hz - 3 <= len(times) <= 6 * maximum_hz + 1


def test_no_reading_is_due_in_a_step_of_fast_sensors_alone(vehicle: Vehicle) -> None:
    steps = 0
    for _ in run(vehicle, 6.0):
        if not vehicle.only_fast:
            continue
        steps += 1
        fitted = vehicle.fitted
        readings = (
            *[vehicle.read_baro(instance) for instance in range(fitted.barometers)],
            *[vehicle.read_mag(instance) for instance in range(fitted.compasses)],
            *(vehicle.read_gps(), vehicle.read_battery(), vehicle.read_range()),
            *(vehicle.read_hygrometer(), vehicle.read_ground()),
        )
        assert set(readings) == {None}
    assert steps > 500


def test_a_reading_is_the_same_however_often_it_is_read(vehicle: Vehicle) -> None:
    for _ in run(vehicle, 0.2):
        assert said(vehicle.read_imu()) == said(vehicle.read_imu())
        assert vehicle.read_baro() == vehicle.read_baro()


def test_a_fix_comes_within_seconds_and_is_late(vehicle: Vehicle) -> None:
    fixes = []
    for _ in run(vehicle, 6.0):
        fix = vehicle.read_gps()
        if fix is not None and fix.fix_type >= 3:
            fixes.append((vehicle.time_us - fix.time_us, fix))
    assert len(fixes) > 10
    for delay_us, fix in fixes:
        assert 50_000 <= delay_us <= 300_000
        assert fix.latitude_deg == pytest.approx(40.4434, abs=1e-4)
        assert fix.longitude_deg == pytest.approx(-3.7382, abs=1e-4)
        assert fix.altitude_amsl_m == pytest.approx(650.0, abs=5.0)
        assert fix.time_utc_us > 0


def test_it_stands_still_until_motors_are_commanded(vehicle: Vehicle) -> None:
    for _ in run(vehicle, 1.0):
        x, y, z = vehicle.read_imu().specific_force_frd
        assert abs(x) + abs(y) < 1.0
        assert z == pytest.approx(-9.8, abs=0.5)


def test_motors_lift_it_and_drain_the_battery(vehicle: Vehicle) -> None:
    vehicle.write_motors((0.6, 0.6, 0.6, 0.6))
    batteries, ups = [], []
    for _ in run(vehicle, 2.0):
        battery = vehicle.read_battery()
        if battery is not None:
            batteries.append(battery)
        ups.append(-vehicle.read_imu().specific_force_frd[2])
    assert max(ups) > 13.0
    assert batteries[-1].voltage_v < batteries[0].voltage_v
    assert batteries[-1].current_a > 10.0


def test_a_motor_command_that_is_no_number_is_refused_and_no_time_passes(
    vehicle: Vehicle,
) -> None:
    vehicle.write_motors((0.1, float("nan"), 0.1, 0.1))
    with pytest.raises(ValueError, match="motor"):
        vehicle.advance()
    assert vehicle.time_us == 0
    vehicle.write_motors((0.0, 0.0, 0.0, 0.0))
    vehicle.advance()
    assert vehicle.time_us == vehicle.step_us


def test_truth_is_of_this_instant_where_there_is_one(vehicle: Vehicle) -> None:
    for _ in run(vehicle, 0.1):
        truth = vehicle.read_truth()
        assert truth is None or isinstance(truth, SensorTruth)
        assert truth is None or truth.time_us == vehicle.time_us


def test_closing_twice_is_harmless(vehicle: Vehicle) -> None:
    vehicle.close()
    vehicle.close()


def _fields(sample: Any) -> dict[str, Any]:
    assert sample is not None
    return dict(sample._asdict())


def test_the_simulated_vehicle_hands_every_reading_over_under_its_own_name() -> None:
    simulation = Simulation(SimulationConfig(seed=5))
    vehicle = JsbsimVehicle(simulation)
    vehicle.write_motors((0.5, 0.4, 0.5, 0.4))
    seen = set()
    for _ in run(vehicle, 4.0):
        handed_over = {
            "imu": vehicle.read_imu(),
            "baro": vehicle.read_baro(),
            "mag": vehicle.read_mag(),
            "gps": vehicle.read_gps(),
            "battery": vehicle.read_battery(),
            "esc": vehicle.read_esc(),
            "range": vehicle.read_range(),
        }
        measured = simulation.readings.environment
        assert (vehicle.read_ground() is None) == (measured is None)
        if measured is not None:
            read = {**_fields(vehicle.read_ground()), **_fields(vehicle.read_hygrometer())}
            assert read.items() <= measured._asdict().items()
            seen.add("environment")
        for name, sample in handed_over.items():
            reading = getattr(simulation.readings, name)
            assert (sample is None) == (reading is None)
            if sample is not None:
                expected = fields_of(reading)
                if name == "mag":
                    expected["field_frd"] = expected.pop("field_frd_gauss")
                elif name == "gps":
                    geoid_height_m = expected.pop("geoid_height_m")
                    ellipsoid_m = expected["altitude_amsl_m"] + geoid_height_m
                    # Without a fix there is none
                    expected["altitude_ellipsoid_m"] = pytest.approx(ellipsoid_m, nan_ok=True)
                elif name == "range":
                    expected |= {"minimum_m": MINIMUM_M, "maximum_m": MAXIMUM_M}
                assert fields_of(sample) == expected
                seen.add(name)
    assert seen == {"imu", "baro", "mag", "gps", "battery", "esc", "range", "environment"}


def test_the_simulated_truth_is_handed_over_under_its_own_name() -> None:
    simulation = Simulation(SimulationConfig())
    vehicle = JsbsimVehicle(simulation)
    vehicle.write_motors((0.6, 0.5, 0.6, 0.5))
    for _ in run(vehicle, 1.0):
        pass
    shown = vehicle.read_truth()._asdict()
    true = fields_of(simulation.truth)
    assert shown.pop("acceleration_frd") == true["specific_force_frd"]
    assert shown == {name: true[name] for name in shown}
