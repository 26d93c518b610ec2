"""The gimbal: directions, limits, frames of yaw, who may point it, what it looks at."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.payload.harness import (
    ALTITUDE_M,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    MISSION,
    NAN,
    OPERATOR,
    RIVAL,
    SYSTEM,
    PayloadHarness,
)
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.payload.camera.gimbal import (
    PITCH_MAX,
    PITCH_MIN,
    Angles,
    Gimbal,
    Place,
    Rates,
)
from uav_firmware.msg.guidance import RegionOfInterest
from uav_firmware.msg.payload import Controller, GimbalFlags, GimbalOrder, PayloadCommand
from uav_firmware.msg.status import CommandResult

POINT, CONFIGURE = (
    PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW,
    PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE,
)
MOUNT = PayloadCommand.DO_MOUNT_CONTROL
ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
LOCK = float(GimbalFlags.YAW_LOCK)
ANGLE = st.floats(-math.pi, math.pi)


def in_control(**params: float) -> PayloadHarness:
    harness = PayloadHarness()
    for name, value in params.items():
        harness.registry.set(name, value)
    assert harness.command(CONFIGURE, -2, -2, -1, -1) == ACCEPTED
    return harness


def test_positive_pitch_is_up_and_positive_yaw_is_right() -> None:
    gimbal = Gimbal()
    gimbal.follow(Angles(0.2, 0.3, locked=False))
    gimbal.update(0.0, None, 10.0, 1.0)
    assert (gimbal.pitch, gimbal.yaw) == pytest.approx((0.2, 0.3))


@given(st.floats(-3.0, 3.0), ANGLE, ANGLE, st.floats(0.1, 3.0), st.integers(1, 30))
def test_rates_and_range_are_limited(
    pitch: float, yaw: float, heading: float, rate: float, steps: int
) -> None:
    gimbal, dt = Gimbal(), 0.04
    gimbal.follow(Angles(pitch, yaw, locked=True))
    for _ in range(steps):
        gimbal.update(heading, None, rate, dt)
        assert PITCH_MIN <= gimbal.pitch <= PITCH_MAX
        assert abs(gimbal.rate_pitch) <= rate + 1e-6
        assert abs(gimbal.rate_yaw) <= rate + 1e-6


@given(ANGLE, ANGLE, ANGLE)
def test_locked_yaw_stays_and_unlocked_yaw_turns_with_the_vehicle(
    yaw: float, before: float, after: float
) -> None:
    for locked in (True, False):
        gimbal = Gimbal()
        gimbal.follow(Angles(0.0, yaw, locked=locked))
        gimbal.update(before, None, math.inf, 0.04)
        gimbal.update(after, None, math.inf, 0.04)
        expected = yaw if locked else after + yaw
        assert wrap_pi(gimbal.yaw - expected) == pytest.approx(0.0, abs=1e-9)


def test_yaw_turns_the_shorter_way() -> None:
    gimbal = Gimbal(yaw=math.radians(170.0))
    gimbal.follow(Angles(0.0, math.radians(-170.0), locked=True))
    gimbal.update(0.0, None, 0.1, 1.0)
    assert gimbal.rate_yaw > 0.0


def test_rates_turn_to_the_end_of_the_range() -> None:
    gimbal = Gimbal()
    gimbal.follow(Rates(-1.0, 0.5, locked=True))
    for _ in range(10):
        gimbal.update(0.0, None, 2.0, 1.0)
    assert gimbal.pitch == PITCH_MIN
    assert wrap_pi(gimbal.yaw - 5.0) == pytest.approx(0.0, abs=1e-9)


@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), st.floats(5.0, 60.0))
def test_the_gimbal_points_at_a_place(place: tuple[float, float], height: float) -> None:
    gimbal = Gimbal()
    gimbal.follow(Place((*place, 0.0)))
    gimbal.update(0.0, (0.0, 0.0, -height), math.inf, 0.04)
    assert gimbal.pitch == pytest.approx(-math.atan2(height, math.hypot(*place)))
    if math.hypot(*place) > height:
        assert wrap_pi(gimbal.yaw - math.atan2(place[1], place[0])) == pytest.approx(0.0, abs=1e-9)


def test_only_a_controller_may_point() -> None:
    harness = PayloadHarness()
    assert harness.command(POINT, -30, 0, NAN, NAN) == DENIED
    assert "not in control" in harness.status_texts()
    assert harness.command(CONFIGURE, *OPERATOR, -1, -1) == ACCEPTED
    assert harness.command(POINT, -30, 20, NAN, NAN) == ACCEPTED
    assert harness.command(POINT, -60, 0, NAN, NAN, sender=RIVAL) == DENIED
    harness.run(2.0)
    assert (harness.pitch_deg, harness.yaw_deg) == pytest.approx((-30.0, 20.0))


def test_control_is_shared_transferred_and_released() -> None:
    harness = PayloadHarness()
    harness.command(CONFIGURE, -2, -2, *RIVAL)
    assert harness.gimbal.value is not None
    assert (harness.gimbal.value.primary, harness.gimbal.value.secondary) == (OPERATOR, RIVAL)
    assert harness.command(POINT, 0, 0, sender=RIVAL) == ACCEPTED
    harness.command(CONFIGURE, -3, -3, -1, -1, sender=RIVAL)  # The rival is not in control
    assert harness.gimbal.value.primary == OPERATOR
    harness.command(CONFIGURE, -3, -3, -1, -1)
    assert harness.gimbal.value.primary == Controller(0, 0)
    assert harness.gimbal.value.secondary == RIVAL
    assert harness.command(POINT, 0, 0) == DENIED


def test_the_mission_takes_control_by_pointing() -> None:
    harness = in_control()
    harness.order(POINT, -90, 0, NAN, NAN, sender=MISSION)
    harness.run(2.0)
    assert harness.pitch_deg == pytest.approx(-90.0)
    assert harness.gimbal.value is not None
    assert harness.gimbal.value.primary == Controller(SYSTEM, 1)


@pytest.mark.parametrize(
    ("flags", "after_turning"),
    [
        (0, 130.0),
        (GimbalFlags.YAW_LOCK, 30.0),
        (GimbalFlags.YAW_LOCK | GimbalFlags.YAW_IN_EARTH_FRAME, 30.0),
        (GimbalFlags.YAW_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME, 40.0),
        (GimbalFlags.YAW_IN_EARTH_FRAME, 120.0),
        (GimbalFlags.YAW_IN_VEHICLE_FRAME, 130.0),
    ],
)
def test_flags_define_the_frame_of_yaw(flags: int, after_turning: float) -> None:
    harness = in_control()
    harness.heading_deg = 10.0
    harness.run(0.1)
    harness.command(POINT, 0, 30, NAN, NAN, flags)
    harness.run(2.0)
    harness.heading_deg = 100.0
    harness.run(2.0)
    assert harness.yaw_deg == pytest.approx(after_turning, abs=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        (31, 0),
        (-91, 0),
        (0, 400),
        (0, 0, NAN, NAN, 1),
        (0, 0, NAN, NAN, 96),
        (0, 0, NAN, NAN, 0, 0, 2),
        (0, 0, NAN, NAN, -1),
    ],
)
def test_an_unreachable_direction_is_denied(wrong: tuple[float, ...]) -> None:
    harness = in_control()
    assert harness.command(POINT, *wrong) == DENIED


def test_a_rate_with_an_angle_limits_the_turn() -> None:
    harness = in_control()
    harness.command(POINT, -60, 0, 10, NAN)
    harness.run(3.0)
    assert harness.pitch_deg == pytest.approx(-30.0, abs=1.0)


def test_mount_control_takes_free_control_only() -> None:
    harness = PayloadHarness()
    assert harness.command(MOUNT, -45, 0, 15, 0, 0, 0, 2) == ACCEPTED
    harness.run(2.0)
    assert (harness.pitch_deg, harness.yaw_deg) == pytest.approx((-45.0, 15.0))
    assert harness.command(MOUNT, -10, 0, 0, 0, 0, 0, 2, sender=RIVAL) == DENIED
    assert harness.command(MOUNT, 0, 0, 0, 0, 0, 0, 1) == ACCEPTED
    harness.run(2.0)
    assert (harness.pitch_deg, harness.yaw_deg) == pytest.approx((0.0, 0.0))
    assert harness.command(MOUNT, 0, 0, 0, 0, 0, 0, 3) == DENIED
    assert harness.command(MOUNT, 0, 20, 0, 0, 0, 0, 2) == DENIED


def test_mount_control_points_at_a_place() -> None:
    harness = PayloadHarness()
    east = LONGITUDE_DEG + 10.0 / (111_320.0 * math.cos(math.radians(LATITUDE_DEG)))
    harness.run(0.1)
    assert harness.command(MOUNT, 0, 0, 0, ALTITUDE_M, LATITUDE_DEG, east, 4) == ACCEPTED
    harness.run(3.0)
    assert harness.pitch_deg == pytest.approx(-45.0, abs=0.5)
    assert harness.yaw_deg == pytest.approx(90.0, abs=0.5)


def test_the_gimbal_follows_a_region_of_interest_until_it_is_cleared() -> None:
    harness = PayloadHarness()
    harness.run(0.1)
    harness.region.publish(
        RegionOfInterest(0, LATITUDE_DEG + 10.0 / 111_030.0, LONGITUDE_DEG, ALTITUDE_M)
    )
    harness.run(2.0)
    assert harness.pitch_deg == pytest.approx(-45.0, abs=0.5)
    harness.region.publish(RegionOfInterest(0, NAN, NAN, NAN))
    harness.run(2.0)
    assert harness.pitch_deg == pytest.approx(0.0, abs=1e-6)


def stream(
    harness: PayloadHarness, pitch: float, yaw: float, *rates: float, **fields: object
) -> None:
    values = {"source": OPERATOR, "flags": 0, "normalised": False, **fields}
    pitch_rate, yaw_rate = rates or (NAN, NAN)
    harness.orders.publish(
        GimbalOrder(
            harness.now_us,
            pitch=pitch,
            yaw=yaw,
            pitch_rate=pitch_rate,
            yaw_rate=yaw_rate,
            **values,  # type: ignore[arg-type]  # fields of different types
        )
    )


def test_a_streamed_order_is_limited_to_the_range() -> None:
    harness = in_control()
    stream(harness, 3.0, 0.5)
    stream(harness, -1.0, -1.0, source=RIVAL)
    harness.run(2.0)
    assert harness.pitch_deg == pytest.approx(30.0)
    assert harness.yaw_deg == pytest.approx(math.degrees(0.5))


def test_a_normalised_rate_uses_the_manual_rate() -> None:
    harness = in_control(MNT_RATE_YAW=20.0)
    stream(harness, NAN, NAN, 0.0, 0.5, normalised=True)
    harness.run(3.0)
    assert harness.yaw_deg == pytest.approx(30.0, abs=1.0)
    stream(harness, -1.0, NAN, normalised=True)
    harness.run(3.0)
    assert harness.pitch_deg == pytest.approx(-90.0)
