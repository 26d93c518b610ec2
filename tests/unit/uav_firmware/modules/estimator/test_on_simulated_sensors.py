"""The estimator on the simulated vehicle's own sensors, against the simulator's truth."""

import math

import numpy as np
import pytest

from sim.config import SimulationConfig
from sim.simulation import Simulation
from tests.unit.uav_firmware.modules.estimator.flight import Array, Rig, Truth
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.msg.sensors import SensorTruth
from uav_firmware.msg.status import LandDetected, LandedState

METRES_PER_DEGREE = (111_050.0, 84_870.0)  # Near 40.44 N; half a per mille is enough here
TILT_SIGMA = math.hypot(4e-3, 1e-3)
"""[rad] Per axis: at rest neither the accelerometer's turn-on bias (4 mg) nor the gravity that
its misalignment (0.1 %) lets into a level axis can be distinguished from a tilt."""


def vehicle(seed: int, noise_factor: float, heading_deg: float = 0.0) -> JsbsimVehicle:
    config = SimulationConfig(
        seed=seed, gps="rtk", sensor_noise_factor=noise_factor, heading_deg=heading_deg
    )
    return JsbsimVehicle(Simulation(config))


def step(rig: Rig, simulated: JsbsimVehicle) -> None:
    """One control step without motors, as the scheduler does it."""
    simulated.advance()
    rig.imu.publish(simulated.read_imu())
    for topic, value in (
        (rig.baro, simulated.read_baro()),
        (rig.mag, simulated.read_mag()),
        (rig.gps, simulated.read_gps()),
    ):
        if value is not None:
            topic.publish(value)  # type: ignore[arg-type]  # each pair is of one kind
    rig.module.update()


def rotation(q: tuple[float, float, float, float]) -> Array:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def position_error(rig: Rig, truth: SensorTruth) -> Array:
    here = rig.world.value
    assert here is not None
    return np.array(
        [
            (here.latitude_deg - truth.latitude_deg) * METRES_PER_DEGREE[0],
            (here.longitude_deg - truth.longitude_deg) * METRES_PER_DEGREE[1],
            truth.altitude_amsl_m - here.altitude_amsl_m,
        ]
    )


def attitude_error(rig: Rig, truth: SensorTruth) -> Array:
    exact = Truth(truth.time_us, np.zeros(3), np.zeros(3), rotation(truth.q_ned_frd))
    return rig.attitude_error(exact)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("seed", "noise_factor"), [(1, 1.0), (2, 1.0), (3, 1.0), (4, 0.05), (5, 0.0)]
)
def test_at_rest_for_a_minute(seed: int, noise_factor: float) -> None:
    rig, simulated = Rig(), vehicle(seed, noise_factor)
    rig.landed.publish(LandDetected(0, True, True, LandedState.ON_GROUND, True))
    errors = []
    for count in range(60 * 250):
        step(rig, simulated)
        if count > 8 * 250 and count % 25 == 0:
            truth = simulated.read_truth()
            errors.append(np.concatenate([position_error(rig, truth), attitude_error(rig, truth)]))
    simulated.close()
    assert rig.position.position_valid
    assert rig.position.altitude_valid
    largest = np.abs(np.array(errors)).max(axis=0)
    # Position: three sigma of the receiver's own wander; without noise what the sums leave.
    assert largest[:2].max() < 0.05 + 0.45 * noise_factor
    assert largest[2] < 0.05 + 0.8 * noise_factor
    tilt = np.hypot(*np.array(errors)[:, 3:5].T)
    # Of two level axes 3.5 sigma together: exp(-3.5^2 / 2), one vehicle in 450, has more.
    unseen = 3.5 * TILT_SIGMA * noise_factor
    assert np.sqrt((tilt**2).mean()) < math.radians(0.05) + unseen
    assert tilt.max() < math.radians(0.1 + 0.2 * noise_factor) + unseen
    assert largest[5] < math.radians(0.7 + 2.0 * noise_factor)
    assert np.abs(rig.position.velocity_ned).max() < 0.05


def test_frames_agree_with_the_simulator() -> None:
    """A vehicle at rest that looks south-west is seen there, level and with gravity down."""
    rig = Rig()
    simulated = vehicle(1, 0.0, 225.0)
    for _ in range(8 * 250):
        step(rig, simulated)
    truth = simulated.read_truth()
    simulated.close()
    heading = math.degrees(rig.position.heading) % 360.0
    assert heading == pytest.approx(225.0, abs=1.0)
    assert np.abs(attitude_error(rig, truth)[:2]).max() < math.radians(0.1)
    assert np.abs(position_error(rig, truth)).max() < 0.05
