"""What makes the filter reckon with a jump of an accelerometer, and what proves one of a gyro."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.rotation import IDENTITY, from_euler
from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.fault_detection.accel_bias_jump import VerticalVelocityMonitor
from uav_firmware.modules.estimator.fault_detection.gyro_bias_jump import HorizontalVelocityMonitor
from uav_firmware.modules.estimator.fault_detection.gyro_jump_confirmation import (
    GyroJumpConfirmation,
)
from uav_firmware.modules.estimator.fault_detection.innovation_cusum import InnovationCusum
from uav_firmware.modules.estimator.fault_detection.lateral_force import LateralForce
from uav_firmware.modules.estimator.kalman_filter.alignment import TiltAlignment
from uav_firmware.modules.estimator.kalman_filter.bias_jump import EVERY_AXIS, accel_jump_covariance
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf, Noise
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    SIZE,
    VELOCITY,
    NominalState,
)
from uav_firmware.modules.estimator.params import EstimatorParams

FIX_US = 100_000
GRAVITY = 9.8
QUIET = Noise(
    accel=0.0, gyro=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0, baro_bias_walk=0.0,
    heading_bias_walk=0.0, gps_height_sigma=0.0, gps_height_time=120.0,
)  # fmt: skip


def hovering() -> EkfCore:
    """A filter that has known its biases for a while."""
    core = EkfCore(TiltAlignment(IDENTITY, (0.0, 0.0, 0.0), 1e-3), 0, EstimatorParams())
    core.ekf.covariance = 1e-6 * np.eye(SIZE)
    return core


def velocity(north: float, down: float) -> list[Measurement]:
    rows = np.eye(3, SIZE, VELOCITY.start)
    return [
        Measurement(off, tuple(row), 0.01)
        for off, row in zip((north, 0.0, down), rows, strict=True)
    ]


@pytest.mark.parametrize("bias", [-3.0, -1.0, 1.0, 2.0, 3.0, 20.0])
def test_a_vertical_jump_is_found_by_the_next_fix_and_is_none_of_the_gyroscope(
    bias: float,
) -> None:
    core, tilt, vertical = hovering(), HorizontalVelocityMonitor(), VerticalVelocityMonitor()
    for number in range(30):
        core.time_us = number * FIX_US
        group = velocity(0.0, -bias * 0.1 * number)
        tilt.update(core, group)
        vertical.update(core, group)
        if core.accel_jump_us is not None:
            break
    assert core.accel_jump_us is not None
    assert core.time_us <= 1_300_000
    assert core.tilt_jump_us is None
    core.ekf.fuse(group)
    assert core.state.accel_bias_frd[2] == pytest.approx(bias, rel=0.7)
    assert core.state.gyro_bias_frd == pytest.approx((0.0, 0.0, 0.0), abs=1e-5)


def test_a_receiver_whose_vertical_velocity_steps_is_no_bad_accelerometer() -> None:
    core, vertical = hovering(), VerticalVelocityMonitor()
    for number in range(50):
        core.time_us = number * FIX_US
        vertical.update(core, velocity(0.0, 3.0 if number > 5 else 0.0))
    assert core.accel_jump_us is None


@pytest.mark.thorough
@given(roll=st.floats(-0.5, 0.5), pitch=st.floats(-0.5, 0.5), yaw=st.floats(-3.0, 3.0))
def test_the_covariance_of_a_jump_is_what_the_filter_would_have_made_of_it(
    roll: float, pitch: float, yaw: float
) -> None:
    q, sigma, ago_s, moments = from_euler(roll, pitch, yaw), 0.8, 1.2, 8
    expected = np.zeros((SIZE, SIZE))
    for moment in range(moments):
        ekf = ErrorStateEkf(NominalState(q), np.full(SIZE, 1e-9), QUIET, GRAVITY)
        for axis in range(ACCEL_BIAS.start, ACCEL_BIAS.stop):
            ekf.forget(axis, sigma)
        seconds = ago_s * (moment + 0.5) / moments
        steps = 4 * max(1, round(seconds / 0.016))
        for _ in range(steps):
            ekf.predict((0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY), seconds / steps)
        expected += ekf.covariance / moments
    ekf = ErrorStateEkf(NominalState(q), np.full(SIZE, 1e-3), QUIET, GRAVITY)
    got = accel_jump_covariance(ekf, EVERY_AXIS, sigma, ago_s)
    assert got == pytest.approx(expected, rel=0.05, abs=1e-3 * sigma**2)


@pytest.mark.thorough
@given(pace=st.floats(1.5, 50.0), sign=st.sampled_from([-1.0, 1.0]), ripple=st.floats(0.0, 1.0))
def test_what_leaps_and_goes_on_growing_is_a_drift(pace: float, sign: float, ripple: float) -> None:
    """Also where every other step of the ramp is no leap by itself."""
    watch = InnovationCusum(slack=1.0, limit=8.0, leap=4.0, ramps=True)
    ramp = [sign * (pace * number + ripple * (number % 2)) for number in range(20)]
    assert any(watch.update([0.0, z], number * FIX_US) for number, z in enumerate(ramp))


@given(st.floats(8.0, 100.0), st.integers(0, 1000))
def test_what_leaps_and_stays_is_none(step: float, seed: int) -> None:
    watch = InnovationCusum(slack=1.0, limit=8.0, leap=4.0, ramps=True)
    noise = 0.8 * np.random.default_rng(seed).standard_normal(100)
    stepped = [0.0, *(step + float(z) for z in noise.clip(-1.9, 1.9))]
    assert not any(watch.update([z], n * FIX_US) for n, z in enumerate(stepped))


LEVEL = (1.0, 0.0, 0.0, 0.0)


def force_after(
    seconds: float,
    step: float,
    pace: float = 0.0,
    speeding_up: float = 0.0,
    drag_per_s: float = 0.29,
    stated_per_s: float | None = 0.29,
) -> LateralForce:
    """Five seconds of hover in vibration, then a step and a slope of the force along x.

    `speeding_up` [m/s^2] is a motion over the ground; its drag is `drag_per_s` of the speed, and
    `stated_per_s` what the airframe's parameters say of it.
    """
    force, noise = LateralForce(), np.random.default_rng(1)
    force.set_drag(None if stated_per_s is None else DragModel(87.0, 87.0, stated_per_s))
    for number in range(round((5.0 + seconds) * 250)):
        late_s = max(0.0, number * 0.004 - 5.0)
        speed = speeding_up * late_s
        x = (step if late_s > 0.0 else 0.0) + pace * late_s - drag_per_s * speed
        sample = (x + 0.4 * noise.standard_normal(), 0.4 * noise.standard_normal(), -9.8)
        force.update(sample, (speed, 0.0, 0.0), LEVEL, 4e-3)
    return force


def test_a_step_of_the_lateral_force_is_seen_and_vibration_or_growing_drag_is_not() -> None:
    assert force_after(0.3, 1.0).stepped
    assert force_after(0.3, 1.0, speeding_up=3.0).stepped
    assert not force_after(10.0, 0.0).stepped
    assert not force_after(4.0, 0.0, 0.3).stepped  # The wind grows by 1 m/s each second
    assert not force_after(4.0, 0.0, speeding_up=5.0).stepped
    assert not force_after(9.0, 1.0).stepped  # Long ago


@pytest.mark.parametrize("drag_per_s", [0.0, 0.1, 0.29, 0.45])
def test_no_drag_of_an_airframe_that_states_none_is_a_step(drag_per_s: float) -> None:
    for speeding_up in (-5.0, 2.0, 5.0):
        assert not force_after(
            4.0, 0.0, speeding_up=speeding_up, drag_per_s=drag_per_s, stated_per_s=None
        ).stepped
    # A bias that jumps, and the velocity that it feigns
    for bias in (-2.0, -1.0, 1.0, 2.0):
        assert force_after(0.3, bias, speeding_up=bias, drag_per_s=0.0, stated_per_s=None).stepped


@given(off=st.floats(-0.3, 0.3), stated=st.floats(0.05, 0.6), speeding_up=st.floats(-5.0, 5.0))
@settings(max_examples=15, deadline=None)
def test_a_drag_that_is_stated_wrong_by_a_third_is_no_step(
    off: float, stated: float, speeding_up: float
) -> None:
    assert not force_after(
        4.0, 0.0, speeding_up=speeding_up, drag_per_s=(1.0 + off) * stated, stated_per_s=stated
    ).stepped


def test_the_drag_falls_with_the_thrust() -> None:
    """Rotors that hardly turn drag hardly: M goes with the root of the thrust."""
    force = LateralForce()
    force.set_drag(DragModel(87.0, 87.0, 0.29))
    for number in range(2000):
        speed = max(0.0, 6.0 * (number * 0.004 - 5.0))
        force.update((-0.29 * 0.2 * speed, 0.0, -0.04 * 9.8), (speed, 0.0, 0.0), LEVEL, 4e-3)
        assert not force.stepped


class Bias:
    """A bias estimate over time, at 10 Hz."""

    def __init__(self) -> None:
        self.proof = GyroJumpConfirmation()
        self.now_us = 0

    def hold(self, bias_deg_s: float, seconds: float, turning: float = 0.0) -> None:
        for _ in range(round(seconds * 10)):
            self.now_us += FIX_US
            bias, sigma = math.radians(bias_deg_s), math.radians(0.1)
            self.proof.update((0.0, bias, 0.0), (sigma, sigma, sigma), turning, self.now_us)

    def suspect(self, bias_deg_s: float = 0.0) -> None:
        self.proof.expect((0.0, math.radians(bias_deg_s), 0.0), self.now_us)


def test_only_a_bias_that_moves_and_stays_is_a_jump() -> None:
    moved = Bias()
    moved.suspect()
    moved.hold(2.0, 2.0)
    assert moved.proof.jumped_us is not None
    for bias_deg_s, seconds, turning in ((0.3, 9.0, 0.0), (3.0, 0.3, 0.0), (3.0, 9.0, 0.1)):
        still = Bias()
        still.suspect()
        still.hold(bias_deg_s, seconds, turning)
        still.hold(0.0, 9.0)
        assert still.proof.jumped_us is None
    unsuspected = Bias()
    unsuspected.hold(5.0, 9.0)
    assert unsuspected.proof.jumped_us is None
