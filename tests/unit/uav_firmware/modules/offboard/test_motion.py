"""How streamed motions are flown: what is smoothed, what is passed on."""

import math

import pytest

from uav_firmware.lib.guide import Guide, GuideLimits
from uav_firmware.modules.offboard.motion import Motion, SpeedLimits, follow, wants_to_rise
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.vectors import Vector3

NAN = math.nan
UNSET: Vector3 = (NAN, NAN, NAN)
LIMITS = GuideLimits(4.0, 4.0, 3.0, 12.0, 2.0, 1.0)
SPEEDS = SpeedLimits(5.0, 2.5, 1.5)
DT = 0.016


def setpoint(
    position: Vector3 = UNSET, velocity: Vector3 = UNSET, acceleration: Vector3 = UNSET
) -> TrajectorySetpoint:
    return TrajectorySetpoint(0, position, velocity, acceleration, NAN, NAN)


def fly(target: TrajectorySetpoint, seconds: float) -> list[Motion]:
    """A vehicle that follows exactly, from rest at the origin."""
    guide, position, flown = Guide(), (0.0, 0.0, 0.0), []
    for _ in range(round(seconds / DT)):
        flown.append(follow(target, guide, position, LIMITS, SPEEDS, DT))
        position = guide.position
    return flown


@pytest.mark.parametrize(
    "place", [(30.0, 0.0, 0.0), (-3.0, 4.0, -10.0), (0.0, 0.0, 8.0), (0.2, 0.1, -0.1)]
)
def test_position_alone_is_reached_within_limits_without_overshoot(
    place: Vector3,
) -> None:
    flown = fly(setpoint(position=place), 30.0)
    assert flown[-1].position_ned == pytest.approx(place, abs=0.02)
    far = math.dist(place, (0.0, 0.0, 0.0))
    for motion in flown:
        north, east, down = motion.velocity_ned
        assert math.hypot(north, east) <= SPEEDS.horizontal + 0.05
        assert -SPEEDS.up - 0.05 <= down <= SPEEDS.down + 0.05
        along = sum(a * b for a, b in zip(motion.position_ned, place, strict=True)) / far
        assert along <= far + 0.1


def test_velocity_alone_is_flown_and_position_follows() -> None:
    last = fly(setpoint(velocity=(2.0, -1.0, 0.5)), 5.0)[-1]
    assert last.velocity_ned == pytest.approx((2.0, -1.0, 0.5), abs=0.01)
    assert all(map(math.isfinite, last.position_ned))


def test_position_with_velocity_or_acceleration_is_passed_on() -> None:
    planned = setpoint((5.0, 6.0, -7.0), (1.0, 2.0, 3.0))
    first = fly(planned, DT)[0]
    assert first.position_ned == planned.position_ned
    assert first.velocity_ned == planned.velocity_ned
    pushed = fly(setpoint(acceleration=(1.0, 0.0, -0.5)), DT)[0]
    assert pushed.acceleration_ned == (1.0, 0.0, -0.5)
    assert all(map(math.isnan, pushed.velocity_ned))


def test_horizontal_and_vertical_are_independent() -> None:
    mixed = TrajectorySetpoint(0, (NAN, NAN, -5.0), (2.0, 0.0, NAN), (0.5, 0.0, NAN), NAN, NAN)
    last = fly(mixed, 10.0)[-1]
    assert last.velocity_ned[:2] == (2.0, 0.0)
    assert math.isnan(last.position_ned[0])
    assert last.position_ned[2] == pytest.approx(-5.0, abs=0.02)


@pytest.mark.parametrize(
    ("target", "rises"),
    [
        (setpoint((0.0, 0.0, -2.0)), True), (setpoint((0.0, 0.0, 0.0)), False),
        (setpoint(velocity=(0.0, 0.0, -0.5)), True), (setpoint(velocity=(1.0, 0.0, 0.5)), False),
        (setpoint(acceleration=(0.0, 0.0, -1.0)), True), (setpoint((5.0, 5.0, 3.0)), False),
    ],
)  # fmt: skip
def test_setpoints_that_mean_take_off(target: TrajectorySetpoint, *, rises: bool) -> None:
    assert wants_to_rise(target, (0.0, 0.0, 0.0)) is rises
