import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.control_allocator.test_geometry import QUAD_X
from uav_firmware.modules.control_allocator.allocation import Allocation, allocate, motor_commands
from uav_firmware.modules.control_allocator.geometry import mix_of
from uav_firmware.msg.vectors import Motors, Vector3

MIX = mix_of(QUAD_X)
torques = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
shares = st.floats(0.0, 1.0)


def produced(result: Allocation) -> tuple[float, float, float, float]:
    """Roll, pitch and yaw torque and mean thrust of four motors, in normalised units."""
    a, b, c, d = result.thrust
    root = 2.0**0.5 / 4.0
    return (
        root * (b + c - a - d),
        root * (a + c - b - d),
        0.25 * (a + b - c - d),
        0.25 * (a + b + c + d),
    )


def test_what_fits_is_produced_exactly() -> None:
    result = allocate((0.1, -0.05, 0.08), 0.5, MIX)
    assert produced(result) == pytest.approx((0.1, -0.05, 0.08, 0.5))
    assert result.unallocated_torque_frd == (0.0, 0.0, 0.0)
    assert result.unallocated_thrust == 0.0


@given(torques, shares)
def test_motors_stay_within_their_range(torque: Vector3, thrust: float) -> None:
    assert all(0.0 <= motor <= 1.0 for motor in allocate(torque, thrust, MIX).thrust)


@given(torques, shares)
def test_wanted_is_produced_plus_unallocated(torque: Vector3, thrust: float) -> None:
    result = allocate(torque, thrust, MIX)
    roll, pitch, yaw, level = produced(result)
    left = result.unallocated_torque_frd
    assert (roll + left[0], pitch + left[1], yaw + left[2]) == pytest.approx(torque, abs=1e-9)
    assert level + result.unallocated_thrust == pytest.approx(thrust, abs=1e-9)


@given(torques, shares)
def test_no_torque_is_reversed(torque: Vector3, thrust: float) -> None:
    for wanted, got in zip(torque, produced(allocate(torque, thrust, MIX)), strict=False):
        assert wanted * got >= -1e-12


@given(st.floats(-0.35, 0.35), st.floats(-0.35, 0.35), st.floats(-1.0, 1.0), shares)
def test_roll_and_pitch_that_fit_the_motors_range_are_never_cut(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    result = allocate((roll, pitch, yaw), thrust, MIX)
    assert produced(result)[:2] == pytest.approx((roll, pitch), abs=1e-9)


def test_at_full_thrust_thrust_gives_way_to_roll() -> None:
    roll, _, _, thrust = produced(allocate((0.2, 0.0, 0.0), 1.0, MIX))
    assert roll == pytest.approx(0.2)
    assert thrust < 1.0


def test_yaw_gives_way_before_roll_and_pitch() -> None:
    result = allocate((0.5, 0.0, 0.9), 0.5, MIX)
    roll, _, yaw, _ = produced(result)
    assert roll == pytest.approx(0.5)
    assert 0.0 < yaw < 0.9


def test_thrust_moves_by_a_bounded_amount_for_yaw() -> None:
    _, _, yaw, thrust = produced(allocate((0.0, 0.0, 0.5), 1.0, MIX))
    assert thrust == pytest.approx(0.85)
    assert yaw == pytest.approx(0.15)


@given(st.tuples(shares, shares, shares, shares), shares)
def test_motor_commands_invert_the_thrust_model(thrust: Motors, factor: float) -> None:
    for command, wanted in zip(motor_commands(thrust, factor, 0.0), thrust, strict=True):
        assert 0.0 <= command <= 1.0 + 1e-12
        model = factor * command * command + (1.0 - factor) * command
        assert model == pytest.approx(wanted, abs=1e-6)


def test_no_motor_is_commanded_below_idle_and_what_is_no_number_stays_none() -> None:
    commands = motor_commands((0.0, 0.01, 0.5, math.nan), 0.8, 0.055)
    assert commands[:2] == (0.055, 0.055)
    assert commands[2] > 0.5
    assert math.isnan(commands[3])
