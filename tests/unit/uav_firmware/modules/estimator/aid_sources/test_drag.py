"""Drag gives the airspeed: its model against one written down here, its Jacobian by differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.estimator.aid_sources.drag import (
    LOWEST_M,
    DragAiding,
    estimated_density,
    gust_variance,
    wind_share,
)
from uav_firmware.modules.estimator.aid_sources.drag_fusion import Air, drag_measurements
from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.kalman_filter.alignment import TiltAlignment
from uav_firmware.modules.estimator.kalman_filter.state import SIZE, VELOCITY, WIND, NominalState
from uav_firmware.modules.estimator.module import drag_of
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.parameters import Registry

AIR = Air(DragModel(87.0, 87.0, 0.295), 1.15)
BALLISTIC_ONLY = Air(DragModel(87.0, 87.0, 0.0), 1.15)
STEP = 1e-5

speed = st.floats(-12.0, 12.0)
tilt = st.floats(-0.6, 0.6)


def state_of(
    velocity: tuple[float, float, float], wind: tuple[float, float], euler: tuple[float, ...]
) -> NominalState:
    roll, pitch, yaw = euler
    state = NominalState(from_euler(roll, pitch, yaw))
    state.velocity_ned, state.wind_ne = velocity, wind
    return state


def test_a_vehicle_that_goes_with_the_wind_feels_its_bias_alone() -> None:
    state = state_of((6.0, -2.0, 0.0), (6.0, -2.0), (0.1, 0.2, 1.0))
    state.accel_bias_frd = (0.05, -0.03, 0.2)
    x, y = drag_measurements(state, (0.05, -0.03), AIR, 1.0)
    assert (x.innovation, y.innovation) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_a_level_flight_to_the_nose_is_braked_by_both_terms() -> None:
    state = state_of((0.0, 6.0, 0.0), (0.0, 2.0), (0.0, 0.0, math.pi / 2.0))
    felt = -(0.295 * math.sqrt(1.15 / 1.225) * 4.0 + 0.5 * 1.15 / 87.0 * 4.0**2)
    x, y = drag_measurements(state, (felt, 0.0), AIR, 1.0)
    assert (x.innovation, y.innovation) == pytest.approx((0.0, 0.0), abs=1e-9)


@given(st.tuples(speed, speed, speed), st.tuples(speed, speed), st.tuples(tilt, tilt, tilt))
def test_the_jacobian_is_the_slope_at_a_fixed_drag_factor(
    velocity: tuple[float, float, float],
    wind: tuple[float, float],
    euler: tuple[float, float, float],
) -> None:
    relative = math.hypot(velocity[0] - wind[0], velocity[1] - wind[1], velocity[2])
    factor, _ = AIR.drag.factors_per_s(max(relative, 0.01), 1.15)
    linear = Air(DragModel(1e9, 1e9, factor / math.sqrt(1.15 / 1.225)), 1.15)  # The factor, frozen
    group = drag_measurements(state_of(velocity, wind, euler), (0.0, 0.0), AIR, 1.0)
    for column in range(SIZE):
        expected = []
        for sign in (1.0, -1.0):
            state = state_of(velocity, wind, euler)
            error = np.zeros(SIZE)
            error[column] = sign * STEP
            state.inject(error.tolist())
            moved = drag_measurements(state, (0.0, 0.0), linear, 1.0)
            expected.append([-m.innovation for m in moved])
        slopes = (np.array(expected[0]) - np.array(expected[1])) / (2.0 * STEP)
        assert [m.jacobian[column] for m in group] == pytest.approx(slopes.tolist(), abs=2e-4)


def test_without_momentum_drag_a_still_vehicle_says_nothing_of_the_wind() -> None:
    x, _ = drag_measurements(
        state_of((0.0, 0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0)), (0.0, 0.0), BALLISTIC_ONLY, 1.0
    )
    assert abs(x.jacobian[WIND.start]) < 1e-3


@given(st.floats(1.0, 100.0), st.floats(0.01, 0.1))
def test_the_wind_dies_towards_the_ground_by_the_logarithm_of_the_height(
    height_m: float, roughness_m: float
) -> None:
    share = wind_share(height_m, roughness_m) / wind_share(0.5 * height_m, roughness_m)
    law = math.log(height_m / roughness_m) / math.log(0.5 * height_m / roughness_m)
    assert share == pytest.approx(law)
    lowest = wind_share(LOWEST_M, roughness_m)
    assert 0.0 < lowest <= wind_share(height_m, roughness_m)
    assert wind_share(-3.0, roughness_m) == lowest
    assert wind_share(height_m, 0.0) == 1.0


def test_gusts_make_the_drag_doubtful_as_far_as_there_is_wind() -> None:
    rest, still = (0.0, 0.0, 0.0), (0.0, 0.0)
    assert gust_variance(state_of((5.0, 0.0, 0.0), still, rest), AIR) == 0.0
    breeze, gale = (gust_variance(state_of(rest, (0.0, wind), rest), AIR) for wind in (3.0, 10.0))
    assert 2.0 < breeze < 10.0 < gale < 50.0


def test_a_vehicle_that_spins_finds_the_wind_where_it_comes_from() -> None:
    """On three rotors: a thousand degrees a second, 80 of them within the mean of a measurement."""
    spin_rad_s, step_us, wind_m_s = 17.0, 4000, 4.0
    drag, params = DragModel(60.0, 60.0, momentum_per_s=0.3), EstimatorParams()
    core = EkfCore(TiltAlignment((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1e-3), 0, params)
    core.set_origin(40.0, -3.7, 650.0)
    core.ekf.forget(VELOCITY, 0.05)  # Known by GPS
    core.on_ground = False
    aiding = DragAiding(drag)
    push = wind_m_s * drag.factors_per_s(wind_m_s, estimated_density(650.0))[0]
    for number in range(1000):
        core.time_us += step_us
        yaw = spin_rad_s * number * step_us * 1e-6
        core.state.q_ned_frd = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
        force = (push * math.cos(yaw), -push * math.sin(yaw), -9.8)  # From the south
        aiding.update(core, force, spin_rad_s * step_us * 1e-6, params)
    assert core.state.wind_ne == pytest.approx((wind_m_s, 0.0), abs=0.4)


def test_the_body_resists_along_each_axis_by_its_own_coefficient() -> None:
    """`EKF2_BCOEF_X` and `EKF2_BCOEF_Y`, as on PX4."""
    registry = Registry()
    registry.add(CommanderParams)
    registry.set("EKF2_BCOEF_Y", 20.0)
    narrow = drag_of(registry)
    assert narrow is not None
    level, still = (0.0, 0.0, 0.0), (0.0, 0.0)
    ahead, _ = drag_measurements(
        state_of((10.0, 0.0, 0.0), still, level), still, Air(narrow, 1.15), 0.1
    )
    _, beside = drag_measurements(
        state_of((0.0, 10.0, 0.0), still, level), still, Air(narrow, 1.15), 0.1
    )
    momentum = 0.295 * math.sqrt(1.15 / 1.225)
    assert ahead.innovation == pytest.approx(10.0 * (momentum + 0.5 * 1.15 / 87.0 * 10.0))
    assert beside.innovation == pytest.approx(10.0 * (momentum + 0.5 * 1.15 / 20.0 * 10.0))
