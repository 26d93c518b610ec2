"""How a jump of the gyroscope bias is detected, and the covariance that it adds."""

import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.rotation import IDENTITY, from_euler
from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.fault_detection.gyro_bias_jump import (
    HeadingMonitor,
    HorizontalVelocityMonitor,
)
from uav_firmware.modules.estimator.fault_detection.innovation_cusum import Drift, InnovationCusum
from uav_firmware.modules.estimator.kalman_filter.alignment import TiltAlignment
from uav_firmware.modules.estimator.kalman_filter.bias_jump import (
    EVERY_AXIS,
    TURNING,
    jump_covariance,
)
from uav_firmware.modules.estimator.kalman_filter.covariance import Array, Measurement, jacobian
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf, Noise
from uav_firmware.modules.estimator.kalman_filter.state import (
    ATTITUDE,
    GYRO_BIAS,
    SIZE,
    VELOCITY,
    NominalState,
)
from uav_firmware.modules.estimator.params import EstimatorParams

QUIET = Noise(
    accel=0.0, gyro=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0, baro_bias_walk=0.0,
    heading_bias_walk=0.0, gps_height_sigma=0.0, gps_height_time=120.0,
)  # fmt: skip
GRAVITY = 9.8
FIX_US = 100_000
COMPASS_US = 36_000
PARAMS = EstimatorParams()


def detected(monitor: InnovationCusum, innovations: list[list[float]]) -> Drift | None:
    """What is detected in innovations at the rate of a receiver."""
    for number, vector in enumerate(innovations):
        drift = monitor.update(vector, number * FIX_US)
        if drift is not None:
            return drift
    return None


def cusum_of_fixes() -> InnovationCusum:
    return InnovationCusum(slack=1.0, limit=8.0, leap=4.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_ten_minutes_of_honest_noise_are_no_drift(seed: int) -> None:
    noise = 0.8 * np.random.default_rng(seed).standard_normal((6000, 3))
    assert detected(cusum_of_fixes(), noise.tolist()) is None


@given(st.floats(0.5, 10.0), st.sampled_from([-1.0, 1.0]), st.integers(0, 2))
def test_what_grows_is_detected_on_either_side_and_sooner_when_it_grows_faster(
    pace: float, sign: float, axis: int
) -> None:
    def growing(pace: float) -> list[list[float]]:
        return [
            [sign * pace * (0.1 * n) ** 2 if axis == at else 0.0 for at in range(3)]
            for n in range(60)
        ]

    slow, fast = (detected(cusum_of_fixes(), growing(p)) for p in (pace, 2.0 * pace))
    assert slow is not None
    assert fast is not None
    assert fast.age_s <= slow.age_s
    assert slow.growth > 0.0


def test_what_leaps_is_left_out_until_it_is_back() -> None:
    monitor = cusum_of_fixes()
    assert detected(monitor, [[0.0], *([[30.0]] * 100)]) is None
    out = monitor.leapt
    assert out
    assert detected(monitor, [[27.0], [0.0], [0.0]]) is None
    assert monitor.leapt is not out
    assert detected(monitor, [[3.0]] * 10) is not None


@pytest.mark.parametrize("axes", [EVERY_AXIS, TURNING])
@pytest.mark.parametrize(
    ("roll", "pitch", "yaw", "ago_s"), [(0.0, 0.0, 0.0, 1.5), (0.4, -0.3, 2.0, 2.5)]
)
def test_the_covariance_of_a_jump_is_what_the_filter_would_have_made_of_it(
    roll: float, pitch: float, yaw: float, ago_s: float, axes: tuple[float, float, float]
) -> None:
    """A bias of that variance, propagated by the filter from when it jumped, at each moment."""
    steps, sigma = 8, 0.05
    expected = np.zeros((SIZE, SIZE))
    q = from_euler(roll, pitch, yaw)
    for moment in range(steps):
        expected += propagated(q, axes, sigma, ago_s * (moment + 0.5) / steps) / steps
    ekf = ErrorStateEkf(NominalState(q), np.full(SIZE, 1e-3), QUIET, GRAVITY)
    got = jump_covariance(ekf, axes, sigma, ago_s)
    assert got == pytest.approx(expected, rel=0.05, abs=1e-4 * sigma**2)


def propagated(
    q: tuple[float, float, float, float],
    axes: tuple[float, float, float],
    sigma: float,
    seconds: float,
) -> Array:
    ekf = ErrorStateEkf(NominalState(q), np.full(SIZE, 1e-9), QUIET, GRAVITY)
    for axis, share in enumerate(axes):
        ekf.forget(GYRO_BIAS.start + axis, max(share * sigma, 1e-9))
    w, x, y, z = q
    lift = GRAVITY  # Held up against gravity, whatever the attitude: the force in the body frame
    force = (
        -lift * 2.0 * (x * z - w * y),
        -lift * 2.0 * (y * z + w * x),
        -lift * (1.0 - 2.0 * (x * x + y * y)),
    )
    count = 4 * max(1, round(seconds / 0.016))
    for _ in range(count):
        ekf.predict((0.0, 0.0, 0.0), force, seconds / count)
    covariance: Array = ekf.covariance
    return covariance


def velocity(innovation: float) -> list[Measurement]:
    """A fix whose north velocity is off."""
    rows = np.eye(3, SIZE, VELOCITY.start)
    return [
        Measurement(off, tuple(row), 0.01)
        for off, row in zip((innovation, 0, 0), rows, strict=True)
    ]


def hovering() -> EkfCore:
    """A filter that has known its biases for a while."""
    core = EkfCore(TiltAlignment(IDENTITY, (0.0, 0.0, 0.0), 1e-3), 0, PARAMS)
    core.ekf.covariance = 1e-6 * np.eye(SIZE)
    return core


@pytest.mark.parametrize("rate_deg_s", [1.0, 3.0, 10.0])
def test_a_jump_that_tilts_is_detected_and_found_by_the_next_fix(rate_deg_s: float) -> None:
    core, monitor, bias = hovering(), HorizontalVelocityMonitor(), math.radians(rate_deg_s)
    for number in range(40):
        core.time_us = number * FIX_US
        group = velocity(0.5 * GRAVITY * bias * (0.1 * number) ** 2)
        monitor.update(core, group)
        if core.tilt_jump_us is not None:
            break
    assert core.time_us < 3_000_000
    core.ekf.fuse(group)
    # To the north it is the pitch that is wrong; of the others no more is known than before.
    assert core.state.gyro_bias_frd[1] == pytest.approx(bias, rel=0.7)
    assert core.state.gyro_bias_frd[2] == pytest.approx(0.0, abs=1e-6)
    assert core.ekf.sigma(GYRO_BIAS.start + 2) > 0.5 * bias


@pytest.mark.parametrize("stepped", [False, True])
def test_inertial_sensors_that_agree_are_not_opened_to_a_receiver(*, stepped: bool) -> None:
    core, monitor = hovering(), HorizontalVelocityMonitor()
    core.gyros_agree = core.accels_agree = True
    if stepped:  # A landing gear that leaves the ground
        for force in (0.0, 3.0):
            for _ in range(100):
                core.lateral.update((force, 0.0, -9.8), (0.0, 0.0, 0.0), IDENTITY, 0.004)
    assert core.lateral.stepped is stepped
    before = core.ekf.covariance
    for number in range(40):
        core.time_us = number * FIX_US
        monitor.update(core, velocity(0.5 * GRAVITY * 0.05 * (0.1 * number) ** 2))
    assert core.tilt_jump_us is None
    assert np.array_equal(core.ekf.covariance, before)


def test_a_velocity_that_a_wrong_heading_explains_is_no_jump() -> None:
    core, monitor = hovering(), HorizontalVelocityMonitor()
    for number in range(30):
        # It gains 5 m/s each second, by a compass that is off by 6 degrees
        core.time_us = number * FIX_US
        core.state.velocity_ned = (0.0, 0.5 * number, 0.0)
        monitor.update(core, velocity(0.1 * 5.0 * min(0.1 * number, 1.0)))
    assert core.tilt_jump_us is None


def heading(innovation: float) -> Measurement:
    return Measurement(innovation, jacobian(attitude=(0.0, 0.0, 1.0)), 0.0025)


def look(core: EkfCore, monitor: HeadingMonitor, innovations: Iterable[float]) -> float:
    """Show headings at 28 Hz until a jump is detected; the last one."""
    last = 0.0
    for last in innovations:
        core.time_us += COMPASS_US
        monitor.update(core, heading(last))
        if core.turn_jump_us is not None:
            break
    return last


@pytest.mark.parametrize("rate_deg_s", [-3.0, 3.0, 10.0])
def test_a_jump_that_turns_is_detected_and_found(rate_deg_s: float) -> None:
    core, rate = hovering(), math.radians(rate_deg_s)
    ramp = (-rate * COMPASS_US * 1e-6 * number for number in range(200))
    last = look(core, HeadingMonitor(), ramp)
    assert core.turn_jump_us is not None
    assert abs(last) < math.radians(20.0)
    core.ekf.fuse([heading(last)])
    assert core.state.gyro_bias_frd[2] == pytest.approx(rate, rel=0.5)
    assert core.ekf.sigma(ATTITUDE.start) == pytest.approx(1e-3, rel=0.01)


def test_gyroscopes_that_agree_are_not_opened_to_a_compass() -> None:
    core = hovering()
    core.gyros_agree = True
    look(core, HeadingMonitor(), [0.002 * number for number in range(400)])
    assert core.turn_jump_us is None


@pytest.mark.parametrize("magnet_deg", [4.0, 8.0, 30.0, 90.0])
def test_a_magnet_is_no_jump_and_its_compass_is_not_believed_until_aligned(
    magnet_deg: float,
) -> None:
    core, monitor, magnet = hovering(), HeadingMonitor(), math.radians(magnet_deg)
    ramp = [0.002 * number for number in range(400)]
    look(core, monitor, [0.0, *([magnet] * 400)])
    assert core.turn_jump_us is None
    if magnet > 0.1:  # rad; else it is no leap
        look(core, monitor, [magnet + drift for drift in ramp])
        assert core.turn_jump_us is None
    monitor.restart()
    look(core, monitor, ramp)
    assert core.turn_jump_us is not None


def test_a_heading_that_the_current_of_the_motors_turns_is_no_jump() -> None:
    core, monitor, thrust_g = hovering(), HeadingMonitor(), 3.5
    core.ekf.acceleration_ned = (0.0, 0.0, GRAVITY * (1.0 - thrust_g))
    turned = 0.09 * (thrust_g - 1.0)
    look(core, monitor, [turned * min(0.25 * number, 1.0) for number in range(30)])
    assert core.turn_jump_us is None


def test_while_the_tilt_is_found_the_compass_is_not_judged() -> None:
    core, monitor = hovering(), HeadingMonitor()
    core.tilt_jump_us = 0
    look(core, monitor, [0.0, 0.5, -0.5, 1.0])
    core.time_us = 1_000_000
    look(core, monitor, [0.002 * number for number in range(400)])
    assert core.turn_jump_us is not None
