"""A whole vehicle: deterministic, blown by the wind, fed by its battery."""

from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.physics.quadrotor import MotorCommandError
from sim.physics.truth import Motors
from sim.simulation import Simulation
from tests.support.messages import said

STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)
CLIMB: Motors = (0.5, 0.5, 0.5, 0.5)


def log_a_flight(path: Path, *, seed: int, wind_speed_m_s: float = 6.0) -> bytes:
    simulation = Simulation(
        SimulationConfig(seed=seed, wind_speed_m_s=wind_speed_m_s, truth_log_path=path)
    )
    for _ in range(750):
        simulation.step(CLIMB)
    simulation.close()
    return path.read_bytes()


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    first = log_a_flight(tmp_path / "a.csv", seed=1)
    assert first.count(b"\n") > 150
    assert log_a_flight(tmp_path / "b.csv", seed=1) == first


def test_another_seed_gives_another_flight(tmp_path: Path) -> None:
    first = log_a_flight(tmp_path / "a.csv", seed=1)
    assert log_a_flight(tmp_path / "b.csv", seed=2) != first


def test_the_same_seed_gives_the_same_readings() -> None:
    one, two = (Simulation(SimulationConfig(seed=9)) for _ in range(2))
    assert said(one.readings) == said(two.readings)
    for _ in range(300):
        assert said(one.step(CLIMB)) == said(two.step(CLIMB))


def test_two_vehicles_in_one_process_do_not_disturb_each_other() -> None:
    alone = Simulation(SimulationConfig(seed=3))
    expected = [alone.step(CLIMB) for _ in range(200)]
    beside, other = Simulation(SimulationConfig(seed=3)), Simulation(SimulationConfig(seed=4))
    for readings in expected:
        other.step(STOPPED)
        assert said(beside.step(CLIMB)) == said(readings)


def test_noise_does_not_move_the_vehicle() -> None:
    noisy = Simulation(SimulationConfig(sensor_noise_factor=10.0))
    ideal = Simulation(SimulationConfig(sensor_noise_factor=0.0))
    for _ in range(250):
        noisy.step(CLIMB)
        ideal.step(CLIMB)
    assert said(noisy.truth) == said(ideal.truth)


def test_a_step_takes_as_long_as_the_control_rate_says() -> None:
    simulation = Simulation(SimulationConfig(physics_rate_hz=1000, control_rate_hz=500))
    assert simulation.time_us == 0
    simulation.step(STOPPED)
    assert simulation.time_us == 2000
    assert simulation.readings.imu.time_us == 2000


@pytest.mark.parametrize("physics_rate_hz", [500, 1000])
def test_the_step_of_the_physics_matters_little(physics_rate_hz: int) -> None:
    simulation = Simulation(SimulationConfig(physics_rate_hz=physics_rate_hz))
    for _ in range(500):
        simulation.step(CLIMB)
    assert simulation.truth.height_above_home_m == pytest.approx(5.4, abs=0.05)


@pytest.mark.parametrize(
    ("from_deg", "axis", "sign"), [(0.0, 0, -1), (90.0, 1, -1), (180.0, 0, 1), (270.0, 1, 1)]
)
def test_the_wind_pushes_a_flying_vehicle_along(from_deg: float, axis: int, sign: int) -> None:
    blown, calm = (
        Simulation(SimulationConfig(wind_speed_m_s=speed_m_s, wind_from_deg=from_deg, gusts=False))
        for speed_m_s in (10.0, 0.0)
    )
    for _ in range(150):  # With motors held, the drag above its centre soon tips it over
        blown.step(CLIMB)
        calm.step(CLIMB)
    pushed = blown.truth.velocity_ned[axis] - calm.truth.velocity_ned[axis]
    assert sign * pushed > 0.3
    across = blown.truth.velocity_ned[1 - axis] - calm.truth.velocity_ned[1 - axis]
    assert abs(across) < 0.5 * abs(pushed)


def test_a_command_that_is_no_number_lets_no_time_pass() -> None:
    simulation = Simulation(SimulationConfig(battery_initial_charge=0.01))
    for _ in range(10):
        simulation.step(STOPPED)
    before = simulation.truth
    with pytest.raises(MotorCommandError):
        simulation.step((0.5, 0.5, 0.5, float("nan")))
    assert simulation.truth is before


def test_an_empty_battery_stops_the_motors() -> None:
    simulation = Simulation(SimulationConfig(battery_capacity_ah=0.02, battery_initial_charge=0.5))
    for _ in range(250 * 20):
        readings = simulation.step((0.3, 0.3, 0.3, 0.3))
        if readings.battery is not None:
            last = readings.battery
    assert simulation.battery_charge == 0.0
    assert last.voltage_v < 1.0
    assert max(simulation.truth.rotor_rpm) < 100.0


def test_a_weak_battery_lowers_full_thrust_and_leaves_low_thrust() -> None:
    weak, full = (
        Simulation(SimulationConfig(battery_initial_charge=charge)) for charge in (0.05, 1.0)
    )
    for _ in range(250):
        weak.step((0.3, 0.3, 0.3, 0.3))
        full.step((0.3, 0.3, 0.3, 0.3))
    assert weak.truth.rotor_rpm == full.truth.rotor_rpm
    for _ in range(100):
        weak.step((1.0, 1.0, 1.0, 1.0))
        full.step((1.0, 1.0, 1.0, 1.0))
    assert weak.truth.rotor_rpm[0] < 0.97 * full.truth.rotor_rpm[0]


def test_a_fall_is_a_crash() -> None:
    simulation = Simulation(SimulationConfig())
    for motors, steps in (((0.9, 0.9, 0.9, 0.9), 250), (STOPPED, 1000)):
        assert not simulation.wrecked
        for _ in range(steps):
            simulation.step(motors)
    assert simulation.wrecked


def test_closing_twice_is_harmless(tmp_path: Path) -> None:
    simulation = Simulation(SimulationConfig(truth_log_path=tmp_path / "truth.csv"))
    simulation.close()
    simulation.close()


def test_vehicles_of_one_farm_see_the_same_farm() -> None:
    place = (40.4440, -3.7380)
    one, two = (
        Simulation(SimulationConfig(seed=seed, farm_seed=7, start_east_m=3.0 * seed)).farm
        for seed in (1, 2)
    )
    assert one.soil_moisture(*place, 1e9) == two.soil_moisture(*place, 1e9)


def test_a_flight_at_night_is_lit_as_by_day() -> None:
    midnight = Simulation(SimulationConfig(start_time_utc_us=1_780_272_000_000_000))
    assert midnight.farm.sun(midnight.farm_time_s).elevation_deg > 10.0
