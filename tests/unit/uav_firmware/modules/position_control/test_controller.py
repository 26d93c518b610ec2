import math

import pytest

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.position_control.control_math import (
    ThrustLimits,
    acceleration_of,
)
from uav_firmware.modules.position_control.controller import (
    Motion,
    PositionController,
    PositionGains,
    PositionLimits,
    velocity_setpoint,
)
from uav_firmware.msg.vectors import Vector3

NAN = float("nan")
UNSET: Vector3 = (NAN, NAN, NAN)
ZERO: Vector3 = (0.0, 0.0, 0.0)
REST = Motion(ZERO, ZERO, ZERO)
GAINS = PositionGains((1.0, 1.0), (3.0, 4.0), (0.8, 2.0), (0.0, 0.0))
LIMITS = PositionLimits(speed_horizontal=5.0, speed_up=3.0, speed_down=1.5)
THRUST = ThrustLimits(minimum=0.05, maximum=0.9, horizontal_margin=0.15, tilt=0.6)
HOVER = 0.25
DT = 0.01


def law() -> PositionController:
    return PositionController(GAINS, LIMITS)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_thrust_leads_towards_the_wanted_position(axis: int, sign: float) -> None:
    target = [0.0, 0.0, 0.0]
    target[axis] = sign
    wanted = Motion((target[0], target[1], target[2]), ZERO, ZERO)
    thrust = law().update(wanted, REST, THRUST, HOVER, DT)
    at_rest = law().update(REST, REST, THRUST, HOVER, DT)
    assert sign * (thrust[axis] - at_rest[axis]) > 0.0


def test_a_far_position_is_approached_no_faster_than_allowed() -> None:
    north, east, down = velocity_setpoint(
        Motion((300.0, 400.0, 50.0), ZERO, ZERO), REST, GAINS, LIMITS
    )
    assert (north, east) == pytest.approx((3.0, 4.0))
    assert down == 1.5


def test_the_feed_forward_is_flown_when_the_position_is_right() -> None:
    wanted = Motion(ZERO, (2.0, 1.0, -0.5), ZERO)
    assert velocity_setpoint(wanted, REST, GAINS, LIMITS) == (2.0, 1.0, -0.5)


def test_without_position_the_velocity_alone_is_flown() -> None:
    measured = Motion((5.0, 5.0, 5.0), ZERO, ZERO)
    wanted = Motion((NAN, NAN, 0.0), (1.0, 0.0, 0.0), ZERO)
    assert velocity_setpoint(wanted, measured, GAINS, LIMITS)[:2] == (1.0, 0.0)


def test_without_position_and_velocity_the_acceleration_alone_is_flown() -> None:
    moving = Motion((5.0, 5.0, 5.0), (3.0, 3.0, 3.0), ZERO)
    thrust = law().update(Motion(UNSET, UNSET, UNSET), moving, THRUST, HOVER, DT)
    assert thrust == pytest.approx((0.0, 0.0, -HOVER))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_acceleration_alone_is_flown_without_what_a_former_leg_has_left(axis: int) -> None:
    controller = PositionController(GAINS._replace(velocity_d=(0.1, 0.1)), LIMITS)
    controller.integral_ned = left = (0.5, -0.4, 0.3)
    velocity = [0.0, 0.0, 0.0]
    velocity[axis] = NAN
    wanted = Motion(UNSET, (velocity[0], velocity[1], velocity[2]), (1.0, 1.0, 1.0))
    moving = Motion(ZERO, ZERO, (0.2, 0.2, 0.2))
    thrust = controller.update(wanted, moving, THRUST, HOVER, DT)
    given = acceleration_of(thrust, HOVER)
    assert given[axis] == pytest.approx(1.0)
    others = [other for other in range(3) if other != axis]
    assert all(given[n] == pytest.approx(1.08 + left[n]) for n in others)
    assert controller.integral_ned[axis] == left[axis]


def test_an_acceleration_that_is_cut_by_the_tilt_leaves_the_integral_alone() -> None:
    controller = law()
    controller.integral_ned = left = (0.5, -0.4, 0.0)
    wanted = Motion(UNSET, (NAN, NAN, 0.0), (30.0, 0.0, 0.0))
    controller.update(wanted, REST, THRUST, HOVER, DT)
    assert controller.integral_ned[:2] == left[:2]


def test_where_the_estimate_is_lost_what_held_against_the_wind_goes_on() -> None:
    controller = law()
    controller.integral_ned = (0.5, -0.4, 0.3)
    wanted = Motion(UNSET, UNSET, ZERO, holds=True)
    thrust = controller.update(wanted, REST, THRUST, HOVER, DT)
    assert acceleration_of(thrust, HOVER) == pytest.approx((0.5, -0.4, 0.3))


@pytest.mark.parametrize("true_hover", [0.7 * HOVER, 1.3 * HOVER])
def test_a_hover_thrust_wrong_by_a_third_is_absorbed(true_hover: float) -> None:
    position, velocity = 0.0, 0.0
    controller = law()
    for _ in range(1500):
        measured = Motion((0.0, 0.0, position), (0.0, 0.0, velocity), ZERO)
        thrust = controller.update(REST, measured, THRUST, HOVER, DT)
        velocity += (STANDARD_GRAVITY_M_S2 + thrust[2] * STANDARD_GRAVITY_M_S2 / true_hover) * DT
        position += velocity * DT
    assert abs(position) < 0.02
    assert abs(velocity) < 0.01


def test_a_steady_wind_is_absorbed() -> None:
    position, velocity = 0.0, 0.0
    controller = law()
    for _ in range(3000):
        measured = Motion((position, 0.0, 0.0), (velocity, 0.0, 0.0), ZERO)
        thrust = controller.update(REST, measured, THRUST, HOVER, DT)
        velocity += (thrust[0] * STANDARD_GRAVITY_M_S2 / HOVER - 1.5) * DT
        position += velocity * DT
    assert abs(position) < 0.02


def test_an_unreachable_setpoint_does_not_charge_the_integral() -> None:
    controller = law()
    wanted = Motion(UNSET, (50.0, 0.0, 0.0), ZERO)
    for _ in range(2000):
        controller.update(wanted, REST, THRUST, HOVER, DT)
    assert controller.integral_ned[0] < 1.0


def test_a_descent_that_no_thrust_gives_does_not_charge_the_integral() -> None:
    controller = law()
    wanted = Motion(UNSET, (0.0, 0.0, 50.0), ZERO)
    for _ in range(2000):
        controller.update(wanted, REST, THRUST, HOVER, DT)
    assert controller.integral_ned[2] < 6.0


def test_reset_forgets_the_integral() -> None:
    controller = law()
    for _ in range(100):
        controller.update(Motion((1.0, 1.0, 1.0), ZERO, ZERO), REST, THRUST, HOVER, DT)
    controller.reset()
    assert controller.integral_ned == ZERO


def test_on_the_ground_only_the_horizontal_part_is_forgotten() -> None:
    controller = law()
    controller.integral_ned = (1.0, -2.0, 3.0)
    controller.forget_horizontal()
    assert controller.integral_ned == (0.0, 0.0, 3.0)


def test_a_new_hover_thrust_does_not_move_the_thrust() -> None:
    controller = law()
    for _ in range(50):
        before = controller.update(REST, REST, THRUST, HOVER, DT)
    controller.follow_hover(HOVER, 0.3)
    after = controller.update(REST, REST, THRUST, 0.3, DT)
    assert after == pytest.approx(before)


def test_nothing_unset_reaches_the_thrust() -> None:
    for bits in range(512):
        values = [NAN if bits >> index & 1 else 0.5 for index in range(9)]
        wanted = Motion(
            (values[0], values[1], values[2]),
            (values[3], values[4], values[5]),
            (values[6], values[7], values[8]),
        )
        thrust = law().update(wanted, REST, THRUST, HOVER, DT)
        assert all(math.isfinite(component) for component in thrust)
