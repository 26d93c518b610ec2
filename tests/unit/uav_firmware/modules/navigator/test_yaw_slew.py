"""The heading setpoint takes the shorter turn, within its limits, and settles."""

import math

from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.navigator.yaw_slew import YawSlew

angles = st.floats(-math.pi, math.pi)
RATE, ACCELERATION, DT = 0.8, 1.6, 0.008


@given(angles, angles)
def test_a_turn_settles_on_its_target_within_its_limits(start: float, target: float) -> None:
    slew = YawSlew()
    slew.reset(start)
    for _ in range(1500):
        before = slew.rate
        slew.advance(target, DT, RATE, ACCELERATION)
        assert abs(slew.rate) <= RATE + 1e-9
        assert abs(slew.rate - before) <= ACCELERATION * DT + 1e-3
    assert slew.settled
    assert abs(wrap_pi(slew.yaw - target)) < 1e-9


@given(angles, st.floats(-3.0, 3.0).filter(lambda turn: abs(turn) > 0.05))
def test_the_shorter_turn_is_taken_without_overshoot(start: float, turn: float) -> None:
    slew = YawSlew()
    slew.reset(start)
    travelled = 0.0
    for _ in range(1500):
        before = slew.yaw
        slew.advance(wrap_pi(start + turn), DT, RATE, ACCELERATION)
        travelled += wrap_pi(slew.yaw - before)
        assert abs(travelled) <= abs(turn) + 0.02
        assert travelled * turn >= -1e-9
