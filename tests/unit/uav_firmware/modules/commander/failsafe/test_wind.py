"""Wind from the tilt: direction, size, and that both are found again after being put in."""

import cmath
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import from_thrust_direction_and_yaw
from uav_firmware.modules.commander.failsafe.wind import (
    WindEstimator,
    drag_sample,
    wind_of,
)
from uav_firmware.msg.vectors import Quaternion

MODEL, DENSITY = DragModel(87.0, 87.0, 0.295), 1.15
speeds = st.floats(-12.0, 12.0)  # Airspeeds of 34 m/s; beyond 40 the tilt is not used any more


def leaning(drag: tuple[float, float], yaw: float) -> Quaternion:
    """Attitude that holds a vehicle still against a drag [m/s^2, north and east]."""
    return from_thrust_direction_and_yaw((-drag[0], -drag[1], -STANDARD_GRAVITY_M_S2), yaw)


def drag_of(
    wind: tuple[float, float],
    velocity: tuple[float, float],
    yaw: float = 0.0,
    ballistic: tuple[float, float] = (87.0, 87.0),
) -> tuple[float, float]:
    """Drag of a steady flight against the airspeed: rotors linear, body by the square.

    Who leans against more drag pushes harder, and harder pushing rotors drag more: iterated.
    """
    air = complex(velocity[0] - wind[0], velocity[1] - wind[1])
    ahead = cmath.rect(1.0, yaw)
    forward, right = (air / ahead).real, (air / ahead).imag
    drag = 0j
    for _ in range(50):
        thrust_ratio = math.hypot(abs(drag), STANDARD_GRAVITY_M_S2) / STANDARD_GRAVITY_M_S2
        rotors = 0.295 * math.sqrt(DENSITY / 1.225 * thrust_ratio)
        body_x, body_y = (0.5 * DENSITY / one * abs(air) for one in ballistic)
        drag = -ahead * complex((rotors + body_x) * forward, (rotors + body_y) * right)
    return drag.real, drag.imag


def test_leaning_west_means_wind_from_the_west() -> None:
    push = drag_sample(leaning((0.0, 1.97), 0.0), (0.0, 0.0, 0.0))
    assert push.drag == pytest.approx((0.0, 1.97))
    north, east = wind_of(push, (0.0, 0.0), MODEL, DENSITY)
    assert north == 0.0
    assert east == pytest.approx(6.0, abs=0.1)


@given(speeds, speeds, speeds, speeds, st.floats(-3.0, 3.0))
def test_a_wind_put_in_is_found_again(
    north: float, east: float, v_north: float, v_east: float, yaw: float
) -> None:
    wind, velocity = (north, east), (v_north, v_east)
    q = leaning(drag_of(wind, velocity), yaw)
    push = drag_sample(q, (0.0, 0.0, 0.0))
    assert wind_of(push, velocity, MODEL, DENSITY) == pytest.approx(wind, abs=1e-3)


@given(speeds, speeds, st.floats(-3.0, 3.0))
def test_the_wind_is_found_though_the_body_resists_more_to_the_side(
    north: float, east: float, yaw: float
) -> None:
    narrow = DragModel(87.0, 20.0, 0.295)
    q = leaning(drag_of((north, east), (0.0, 0.0), yaw, (87.0, 20.0)), yaw)
    estimator = WindEstimator()
    for _ in range(300):
        estimator.update(q, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
    assert estimator.wind(narrow, DENSITY) == pytest.approx((north, east), abs=1e-3)


def test_nothing_is_said_before_the_filter_has_settled() -> None:
    estimator = WindEstimator()
    q = leaning(drag_of((0.0, 8.0), (0.0, 0.0)), 0.5)
    found = []
    for _ in range(300):
        estimator.update(q, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
        found.append(estimator.wind(MODEL, DENSITY))
    assert found[50] is None
    assert found[-1] == pytest.approx((0.0, 8.0), abs=0.05)
    estimator.restart()
    assert estimator.wind(MODEL, DENSITY) is None


def test_without_the_drag_of_the_rotors_no_tilt_is_a_gale() -> None:
    estimator = WindEstimator()
    for _ in range(300):
        estimator.update(leaning((0.0, 0.9), 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
    breeze = estimator.wind(MODEL, DENSITY)
    assert breeze is not None
    assert math.hypot(*breeze) < 3.5
    assert estimator.wind(MODEL._replace(momentum_per_s=0.0), DENSITY) is None


def test_a_gust_of_a_second_moves_the_mean_a_little() -> None:
    estimator = WindEstimator()
    calm, blown = leaning((0.0, 0.0), 0.0), leaning(drag_of((0.0, 10.0), (0.0, 0.0)), 0.0)
    for step in range(400):
        q = blown if 300 <= step < 310 else calm
        estimator.update(q, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
    wind = estimator.wind(MODEL, DENSITY)
    assert wind is not None
    assert math.hypot(*wind) < 2.5
