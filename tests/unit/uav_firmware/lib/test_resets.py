"""Steps of the estimate, as a keeper of setpoints follows them."""

import math

import pytest

from uav_firmware.lib.resets import ResetFollower
from uav_firmware.msg.estimate import EstimateResets


def test_what_was_before_the_first_look_is_not_followed() -> None:
    follower = ResetFollower()
    assert follower.update(EstimateResets(xy_count=3, position_total_ned=(9.0, 0.0, 0.0))) is None


def test_several_resets_between_two_looks_are_one_step() -> None:
    follower = ResetFollower()
    follower.update(EstimateResets(xy_count=1, position_total_ned=(1.0, 2.0, 0.0)))
    step = follower.update(
        EstimateResets(
            xy_count=3,
            z_count=1,
            heading_count=1,
            position_delta_ned=(1.0, 1.0, -4.0),
            position_total_ned=(6.0, 1.0, -4.0),
            velocity_total_ned=(0.5, 0.0, 0.0),
            heading_total=math.radians(-10.0),
        )
    )
    assert step is not None
    assert step.position_ned == pytest.approx((5.0, -1.0, -4.0))
    assert step.velocity_ned == pytest.approx((0.5, 0.0, 0.0))
    assert step.heading == pytest.approx(math.radians(-10.0))


def test_without_a_reset_there_is_no_step() -> None:
    follower = ResetFollower()
    resets = EstimateResets(z_count=2)
    follower.update(resets)
    assert follower.update(resets) is None
    assert follower.update(EstimateResets(z_count=2)) is None
