"""The firmware's frames and geodesy against JSBSim's truth, which knows nothing of them.

One flight by open-loop commands, recorded step by step, is held against the firmware's own
formulas: an axis, a sign or an order of rotation that differs between the two shows here.
"""

import math
from itertools import pairwise

import pytest

from sim.config import SimulationConfig
from sim.physics.truth import Motors, Truth
from sim.simulation import Simulation
from tests.support.rotation_vectors import from_rotation_vector, to_rotation_vector
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.lib import rotation
from uav_firmware.lib.atmosphere import altitude_from_pressure
from uav_firmware.lib.geo import LocalFrame, gravity_m_s2
from uav_firmware.msg.vectors import Vector3

STEP_S = 0.004
LIFT: Motors = (0.6, 0.6, 0.6, 0.6)
SECONDS_OF_LIFT = 1.5


def fly(*, heading_deg: float, motors: Motors, seconds: float = 1.0) -> list[Truth]:
    """Truth of every step after lift-off, under constant commands."""
    simulation = Simulation(SimulationConfig(heading_deg=heading_deg, sensor_noise_factor=0.0))
    for _ in range(round(SECONDS_OF_LIFT / STEP_S)):
        simulation.step(LIFT)
    track = []
    for _ in range(round(seconds / STEP_S)):
        simulation.step(motors)
        track.append(simulation.truth)
    return track


@pytest.fixture(scope="module")
def corkscrew() -> list[Truth]:
    """Rolls, pitches and yaws at once, under thrust."""
    return fly(heading_deg=50.0, motors=(0.64, 0.60, 0.62, 0.56), seconds=1.2)


def test_the_corkscrew_turns_about_all_axes(corkscrew: list[Truth]) -> None:
    end = corkscrew[-1]
    assert min(abs(end.roll_deg), abs(end.pitch_deg)) > 10.0
    assert abs(end.yaw_deg - 50.0) > 5.0


def test_the_firmware_reads_the_same_euler_angles_from_the_attitude(
    corkscrew: list[Truth],
) -> None:
    for truth in corkscrew[::10]:
        roll, pitch, yaw = rotation.to_euler(truth.q_ned_frd)
        assert math.degrees(roll) == pytest.approx(truth.roll_deg, abs=1e-6)
        assert math.degrees(pitch) == pytest.approx(truth.pitch_deg, abs=1e-6)
        assert math.degrees(yaw) % 360.0 == pytest.approx(truth.yaw_deg, abs=1e-6)


def test_turning_at_the_measured_rate_gives_the_next_attitude(corkscrew: list[Truth]) -> None:
    q = corkscrew[0].q_ned_frd
    for before, after in pairwise(corkscrew):
        rate: Vector3 = (
            0.5 * (before.rate_frd[0] + after.rate_frd[0]),
            0.5 * (before.rate_frd[1] + after.rate_frd[1]),
            0.5 * (before.rate_frd[2] + after.rate_frd[2]),
        )
        turn = from_rotation_vector((rate[0] * STEP_S, rate[1] * STEP_S, rate[2] * STEP_S))
        q = rotation.multiply(q, turn)
    error = rotation.multiply(rotation.conjugate(q), corkscrew[-1].q_ned_frd)
    assert math.hypot(*to_rotation_vector(error)) < math.radians(0.01)


def test_specific_force_turned_to_the_world_plus_gravity_is_acceleration(
    corkscrew: list[Truth],
) -> None:
    velocity = list(corkscrew[0].velocity_ned)
    for before, after in pairwise(corkscrew):
        for truth in (before, after):
            force_ned = rotation.rotate(truth.q_ned_frd, truth.specific_force_frd)
            gravity = gravity_m_s2(truth.latitude_deg, truth.altitude_amsl_m)
            for axis, acceleration in enumerate((*force_ned[:2], force_ned[2] + gravity)):
                velocity[axis] += 0.5 * STEP_S * acceleration
    assert velocity == pytest.approx(corkscrew[-1].velocity_ned, abs=0.02)
    assert math.dist(velocity, corkscrew[0].velocity_ned) > 2.0


def test_velocity_adds_up_to_the_change_of_position(corkscrew: list[Truth]) -> None:
    start, end = corkscrew[0], corkscrew[-1]
    frame = LocalFrame(start.latitude_deg, start.longitude_deg, start.altitude_amsl_m)
    moved = frame.to_ned(end.latitude_deg, end.longitude_deg, end.altitude_amsl_m)
    for axis in range(3):
        travelled = sum(
            0.5 * STEP_S * (before.velocity_ned[axis] + after.velocity_ned[axis])
            for before, after in pairwise(corkscrew)
        )
        assert moved[axis] == pytest.approx(travelled, abs=0.01)
    assert min(abs(component) for component in moved) > 0.1


@pytest.mark.parametrize(
    ("heading_deg", "axis", "sign"), [(0.0, 0, 1), (90.0, 1, 1), (180.0, 0, -1), (270.0, 1, -1)]
)
def test_nose_down_flies_to_where_the_nose_points(heading_deg: float, axis: int, sign: int) -> None:
    track = fly(heading_deg=heading_deg, motors=(0.59, 0.61, 0.59, 0.61))
    gained = track[-1].velocity_ned[axis] - track[0].velocity_ned[axis]
    assert track[-1].pitch_deg < track[0].pitch_deg - 5.0
    assert sign * gained > 1.0
    frame = LocalFrame(40.4434, -3.7382, 650.0)
    before, after = (
        frame.to_ned(truth.latitude_deg, truth.longitude_deg, truth.altitude_amsl_m)[axis]
        for truth in (track[len(track) // 2], track[-1])
    )
    assert sign * (after - before) > 0.0


def test_left_rotors_roll_it_to_the_right_and_to_the_east_when_it_looks_north() -> None:
    track = fly(heading_deg=0.0, motors=(0.59, 0.61, 0.61, 0.59))
    assert rotation.to_euler(track[-1].q_ned_frd)[0] > math.radians(5.0)
    assert track[-1].velocity_ned[1] > 0.5
    assert track[-1].longitude_deg > track[0].longitude_deg


def test_counter_clockwise_rotors_turn_the_nose_to_the_right() -> None:
    track = fly(heading_deg=90.0, motors=(0.62, 0.62, 0.58, 0.58))
    assert rotation.yaw_of(track[-1].q_ned_frd) > math.radians(95.0)
    assert track[-1].rate_frd[2] > 0.0


def test_climbing_is_down_negative_and_height_positive() -> None:
    track = fly(heading_deg=0.0, motors=LIFT)
    assert track[-1].velocity_ned[2] < -1.0
    assert track[-1].height_above_home_m > track[0].height_above_home_m + 1.0
    assert track[-1].altitude_amsl_m > 650.0


def test_standing_still_the_accelerometer_shows_the_firmwares_gravity_upwards() -> None:
    vehicle = JsbsimVehicle(Simulation(SimulationConfig(sensor_noise_factor=0.0)))
    force = rotation.rotate(vehicle.read_truth().q_ned_frd, vehicle.read_imu().specific_force_frd)
    assert force[2] == pytest.approx(-gravity_m_s2(40.4434, 650.0), abs=0.003)
    assert math.hypot(force[0], force[1]) < 0.02


def test_the_firmwares_atmosphere_finds_the_height_that_was_climbed() -> None:
    simulation = Simulation(SimulationConfig(sensor_noise_factor=0.0))
    ground = simulation.truth
    for _ in range(1000):
        simulation.step(LIFT)
    climbed = simulation.truth.height_above_home_m - ground.height_above_home_m
    barometric = altitude_from_pressure(simulation.truth.pressure_pa) - altitude_from_pressure(
        ground.pressure_pa
    )
    assert climbed > 20.0
    assert barometric == pytest.approx(climbed, rel=0.01)


@pytest.mark.parametrize("heading_deg", [0.0, 60.0, 120.0, 200.0, 310.0])
def test_the_field_turned_to_the_world_points_north_and_down(heading_deg: float) -> None:
    vehicle = JsbsimVehicle(
        Simulation(SimulationConfig(heading_deg=heading_deg, sensor_noise_factor=0.0))
    )
    reading = None
    while reading is None:
        vehicle.advance()
        reading = vehicle.read_mag()
    north, east, down = rotation.rotate(vehicle.read_truth().q_ned_frd, reading.field_frd)
    assert north > 0.2
    assert down > 0.3
    assert math.degrees(math.atan2(east, north)) == pytest.approx(0.61, abs=0.05)
