"""What each fault does to a vehicle, by direction first."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from sim.faults.effects import weakened
from sim.faults.notation import read_order
from sim.physics.truth import Motors
from sim.sensors.readings import Readings
from sim.simulation import Simulation

HOVER = (0.418, 0.418, 0.418, 0.418)
STOPPED = (0.0, 0.0, 0.0, 0.0)


def simulation(*lines: str, **config: float) -> Simulation:
    made = Simulation(SimulationConfig(sensor_noise_factor=0.0, **config))  # type: ignore[arg-type]
    order(made, *lines)
    return made


def order(made: Simulation, *lines: str) -> None:
    for line in lines:
        fault = read_order(line, made.time_us)
        assert isinstance(fault, Fault)
        made.add_fault(fault)


def run(made: Simulation, seconds: float, motors: Motors = STOPPED) -> list[Readings]:
    return [made.step(motors) for _ in range(round(seconds * 250))]


@given(command=st.floats(0.0, 1.0), efficiency=st.floats(0.0, 1.0))
def test_a_weak_motor_is_never_commanded_more(command: float, efficiency: float) -> None:
    assert 0.0 <= weakened(command, efficiency) <= command + 1e-12


@given(command=st.floats(0.05, 1.0), efficiency=st.floats(0.05, 1.0))
def test_a_weak_motor_gives_its_share_of_the_thrust(command: float, efficiency: float) -> None:
    def thrust(u: float) -> float:
        return 0.76 * u * u + 0.24 * u

    assert thrust(weakened(command, efficiency)) == pytest.approx(efficiency * thrust(command))


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_a_lost_motor_stops_and_the_others_turn(motor: int) -> None:
    made = simulation()
    run(made, 2.0, (0.6, 0.6, 0.6, 0.6))
    order(made, f"motor_loss motor={motor}")
    run(made, 0.4, HOVER)
    speeds = made.truth.rotor_rpm
    assert speeds[motor - 1] < 200.0
    assert sorted(speeds)[1] > 4500.0


def test_speed_controllers_tell_speed_and_current() -> None:
    made = simulation()
    readings = run(made, 1.0, HOVER)
    reports = [reading.esc for reading in readings if reading.esc is not None]
    assert len(reports) == pytest.approx(125, abs=1)
    assert reports[-1].rotor_rpm == pytest.approx(made.truth.rotor_rpm, rel=0.01)
    assert sum(reports[-1].current_a) == pytest.approx(177.0 / 14.63, rel=0.1)


@pytest.mark.thorough
def test_a_lost_fix_says_so_and_comes_back() -> None:
    made = simulation("gps_loss start_s=5 end_s=7")
    fixes = [reading.gps for reading in run(made, 9.0) if reading.gps is not None]
    lost = {round(gps.time_us * 1e-6, 1) for gps in fixes if gps.fix_type < 3}
    assert {5.0, 6.0, 6.8} <= lost
    assert max(lost) < 7.2
    assert fixes[-1].fix_type == 3


def test_a_frozen_receiver_repeats_its_place_with_new_times() -> None:
    made = simulation("gps_frozen start_s=5", wind_speed_m_s=0.0)
    run(made, 5.0)
    fixes = [g for r in run(made, 2.0, (0.7, 0.7, 0.7, 0.7)) if (g := r.gps) is not None]
    assert len({(g.latitude_deg, g.altitude_amsl_m, g.velocity_ned) for g in fixes}) == 1
    assert len({g.time_us for g in fixes}) == len(fixes)
    assert made.truth.height_above_home_m > 2.0


def test_a_jump_moves_the_fix_north_east_and_up() -> None:
    made = simulation()
    (before,) = [r.gps for r in run(made, 4.0) if r.gps is not None][-1:]
    order(made, "gps_jump north_m=30 east_m=20 up_m=10")
    (after,) = [r.gps for r in run(made, 1.0) if r.gps is not None][-1:]
    assert before is not None
    assert after is not None
    assert (after.latitude_deg - before.latitude_deg) * 111_195.0 == pytest.approx(30.0, rel=0.01)
    assert after.longitude_deg > before.longitude_deg
    assert after.altitude_amsl_m - before.altitude_amsl_m == pytest.approx(10.0, abs=0.1)


def test_a_dead_barometer_is_silent_and_a_frozen_one_repeats() -> None:
    assert all(reading.baro is None for reading in run(simulation("baro_loss"), 0.5))
    frozen = simulation("baro_frozen")
    readings = [r.baro for r in run(frozen, 2.0, (0.7, 0.7, 0.7, 0.7)) if r.baro is not None]
    assert len({baro.pressure_pa for baro in readings}) == 1
    assert len({baro.time_us for baro in readings}) == len(readings)


def test_a_magnet_nearby_adds_to_the_field_and_a_dead_compass_is_silent() -> None:
    (still,) = [r.mag for r in run(simulation(), 0.1) if r.mag is not None][-1:]
    made = simulation("mag_disturbance x_gauss=0.2")
    (moved,) = [r.mag for r in run(made, 0.1) if r.mag is not None][-1:]
    assert still is not None
    assert moved is not None
    assert moved.field_frd_gauss[0] - still.field_frd_gauss[0] == pytest.approx(0.2)
    assert all(reading.mag is None for reading in run(simulation("mag_loss"), 0.5))


def test_a_dead_range_finder_is_silent() -> None:
    assert any(reading.range is not None for reading in run(simulation(), 0.5))
    assert all(reading.range is None for reading in run(simulation("rangefinder_loss"), 0.5))


def distances_m(made: Simulation, seconds: float) -> list[float]:
    """What the range finder says in a climb."""
    readings = run(made, seconds, (0.6, 0.6, 0.6, 0.6))
    return [reading.range.distance_m for reading in readings if reading.range is not None]


def test_a_frozen_range_finder_repeats_its_last_sample_in_time() -> None:
    made = simulation("rangefinder_frozen start_s=1 end_s=2")
    before, frozen, after = (distances_m(made, 1.0) for _ in range(3))
    assert len(set(before)) > 10
    assert len(set(frozen[1:-1])) == 1
    assert len(frozen) == pytest.approx(20, abs=1)
    assert after[-1] > frozen[5] + 1.0


def test_a_blocked_range_finder_sees_what_is_before_it() -> None:
    assert set(distances_m(simulation("rangefinder_blocked"), 0.5)) == {0.3}
    assert set(distances_m(simulation("rangefinder_blocked distance_m=7"), 0.5)) == {7.0}


def test_a_hygrometer_falls_silent_or_speaks_without_a_humidity() -> None:
    silent = [s for r in run(simulation("humidity_failure"), 3.0) if (s := r.environment)]
    assert silent
    assert not any(sample.hygrometer_speaks for sample in silent)
    vague = [s for r in run(simulation("humidity_invalid"), 3.0) if (s := r.environment)]
    assert all(sample.hygrometer_speaks for sample in vague)
    assert all(math.isnan(sample.relative_humidity_percent) for sample in vague)


def test_inertial_sensors_fail_as_no_number_or_by_a_bias() -> None:
    dead = run(simulation("gyro_loss", "accel_loss"), 0.1)[-1].imu
    assert all(math.isnan(value) for value in (*dead.rate_frd, *dead.specific_force_frd))
    biased = run(simulation("gyro_bias z_deg_s=10", "accel_bias x_m_s2=2"), 0.1)[-1].imu
    assert biased.rate_frd[2] == pytest.approx(math.radians(10.0), abs=0.01)
    assert biased.specific_force_frd[0] == pytest.approx(2.0, abs=0.1)


def test_a_shorted_cell_takes_a_quarter_of_the_voltage_and_charge() -> None:
    made = simulation()
    (whole,) = [r.battery for r in run(made, 1.0) if r.battery is not None][-1:]
    order(made, "battery_cell_failure")
    (hurt,) = [r.battery for r in run(made, 1.0) if r.battery is not None][-1:]
    assert whole is not None
    assert hurt is not None
    assert 0.65 < hurt.voltage_v / whole.voltage_v < 0.78
    assert made.battery_charge == pytest.approx(0.75, abs=0.01)


def test_a_low_battery_is_low_once_and_then_drains() -> None:
    made = simulation("battery_low charge=0.1 start_s=1")
    run(made, 0.5, HOVER)
    assert made.battery_charge > 0.99
    run(made, 3.5, HOVER)
    assert 0.09 < made.battery_charge < 0.1


def test_a_gust_comes_from_where_it_is_said_to_and_ends() -> None:
    made = simulation()
    run(made, 3.0, (0.5, 0.5, 0.5, 0.5))
    order(made, "wind_gust speed_m_s=10 from_deg=270 duration_s=0.4")
    run(made, 0.3, HOVER)
    assert made.truth.velocity_ned[1] > 0.5
    assert made.truth.airspeed_m_s > 8.0
    run(made, 0.2, HOVER)
    assert made.truth.airspeed_m_s == pytest.approx(math.hypot(*made.truth.velocity_ned), rel=0.02)


def test_a_cut_link_is_told() -> None:
    made = simulation("link_loss duration_s=1")
    assert made.link_lost
    run(made, 1.1)
    assert not made.link_lost


def test_a_camera_fails_and_is_mended() -> None:
    made = simulation("camera_failure start_s=1 duration_s=1")
    seen = [made.camera_failed]
    for seconds in (1.5, 1.0):
        run(made, seconds)
        seen.append(made.camera_failed)
    assert seen == [False, True, False]


def test_a_cleared_fault_is_gone() -> None:
    made = simulation("baro_loss", "motor_loss motor=1")
    made.clear_faults(Kind.MOTOR_LOSS, 1)
    run(made, 1.0, HOVER)
    assert made.truth.rotor_rpm[0] > 4500.0
    assert [fault.kind for fault in made.faults] == [Kind.BARO_LOSS]


FAULTS = "gps_jump north_m=5 start_s=1", "motor_loss motor=2 start_s=2", "wind_gust speed_m_s=5"


def truth_of(path: Path, seed: int) -> bytes:
    faults = tuple(fault for line in FAULTS if isinstance(fault := read_order(line, 0), Fault))
    made = Simulation(
        SimulationConfig(seed=seed, wind_speed_m_s=4.0, faults=faults, truth_log_path=path)
    )
    run(made, 4.0, (0.5, 0.5, 0.5, 0.5))
    made.close()
    return path.read_bytes()


@pytest.mark.thorough
def test_the_same_seed_and_faults_give_the_same_truth_byte_for_byte(tmp_path: Path) -> None:
    first = truth_of(tmp_path / "first.csv", 3)
    assert truth_of(tmp_path / "second.csv", 3) == first
    assert truth_of(tmp_path / "third.csv", 4) != first


def test_ground_effect_lifts_near_the_ground_and_is_off_unless_asked_for() -> None:
    def height_m(*, on: bool) -> float:
        made = Simulation(SimulationConfig(sensor_noise_factor=0.0, ground_effect=on))
        run(made, 2.0, (0.416, 0.416, 0.416, 0.416))
        return made.truth.height_above_home_m

    assert not SimulationConfig().ground_effect
    assert height_m(on=False) == pytest.approx(0.15, abs=0.01)
    assert height_m(on=True) > 0.155
