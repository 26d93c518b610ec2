"""The gimbal: directions, limits, frames of yaw, who may point it, what it looks at."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.payload.bench import (
    ALTITUDE_M,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    MISSION,
    NAN,
    OPERATOR,
    RIVAL,
    SYSTEM,
    Bench,
)
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.payload.gimbal.gimbal import (
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


def in_control(**params: float) -> Bench:
    bench = Bench()
    for name, value in params.items():
        bench.registry.set(name, value)
    assert bench.ask(CONFIGURE, -2, -2, -1, -1) == ACCEPTED
    return bench


def test_a_positive_pitch_looks_up_and_a_positive_yaw_to_the_right() -> None:
    gimbal = Gimbal()
    gimbal.follow(Angles(0.2, 0.3, locked=False))
    gimbal.update(0.0, None, 10.0, 1.0)
    assert (gimbal.pitch, gimbal.yaw) == pytest.approx((0.2, 0.3))


@given(st.floats(-3.0, 3.0), ANGLE, ANGLE, st.floats(0.1, 3.0), st.integers(1, 30))
def test_no_order_turns_faster_or_farther_than_the_gimbal_can(
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
def test_a_locked_yaw_stays_when_the_vehicle_turns_and_another_turns_with_it(
    yaw: float, before: float, after: float
) -> None:
    for locked in (True, False):
        gimbal = Gimbal()
        gimbal.follow(Angles(0.0, yaw, locked=locked))
        gimbal.update(before, None, math.inf, 0.04)
        gimbal.update(after, None, math.inf, 0.04)
        wanted = yaw if locked else after + yaw
        assert wrap_pi(gimbal.yaw - wanted) == pytest.approx(0.0, abs=1e-9)


def test_the_shorter_way_round() -> None:
    gimbal = Gimbal(yaw=math.radians(170.0))
    gimbal.follow(Angles(0.0, math.radians(-170.0), locked=True))
    gimbal.update(0.0, None, 0.1, 1.0)
    assert gimbal.rate_yaw > 0.0


def test_rates_turn_until_the_range_ends() -> None:
    gimbal = Gimbal()
    gimbal.follow(Rates(-1.0, 0.5, locked=True))
    for _ in range(10):
        gimbal.update(0.0, None, 2.0, 1.0)
    assert gimbal.pitch == PITCH_MIN
    assert wrap_pi(gimbal.yaw - 5.0) == pytest.approx(0.0, abs=1e-9)


@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), st.floats(5.0, 60.0))
def test_a_place_is_looked_at(place: tuple[float, float], height: float) -> None:
    gimbal = Gimbal()
    gimbal.follow(Place((*place, 0.0)))
    gimbal.update(0.0, (0.0, 0.0, -height), math.inf, 0.04)
    assert gimbal.pitch == pytest.approx(-math.atan2(height, math.hypot(*place)))
    if math.hypot(*place) > height:
        assert wrap_pi(gimbal.yaw - math.atan2(place[1], place[0])) == pytest.approx(0.0, abs=1e-9)


def test_only_who_took_control_may_point() -> None:
    bench = Bench()
    assert bench.ask(POINT, -30, 0, NAN, NAN) == DENIED
    assert "not in control" in bench.said()
    assert bench.ask(CONFIGURE, *OPERATOR, -1, -1) == ACCEPTED
    assert bench.ask(POINT, -30, 20, NAN, NAN) == ACCEPTED
    assert bench.ask(POINT, -60, 0, NAN, NAN, sender=RIVAL) == DENIED
    bench.run(2.0)
    assert (bench.pitch_deg, bench.yaw_deg) == pytest.approx((-30.0, 20.0))


def test_control_is_shared_handed_over_and_given_back() -> None:
    bench = Bench()
    bench.ask(CONFIGURE, -2, -2, *RIVAL)
    assert bench.gimbal.value is not None
    assert (bench.gimbal.value.primary, bench.gimbal.value.secondary) == (OPERATOR, RIVAL)
    assert bench.ask(POINT, 0, 0, sender=RIVAL) == ACCEPTED
    bench.ask(CONFIGURE, -3, -3, -1, -1, sender=RIVAL)  # not the rival's to give back
    assert bench.gimbal.value.primary == OPERATOR
    bench.ask(CONFIGURE, -3, -3, -1, -1)
    assert bench.gimbal.value.primary == Controller(0, 0)
    assert bench.gimbal.value.secondary == RIVAL
    assert bench.ask(POINT, 0, 0) == DENIED


def test_the_mission_takes_control_by_pointing() -> None:
    bench = in_control()
    bench.order(POINT, -90, 0, NAN, NAN, sender=MISSION)
    bench.run(2.0)
    assert bench.pitch_deg == pytest.approx(-90.0)
    assert bench.gimbal.value is not None
    assert bench.gimbal.value.primary == Controller(SYSTEM, 1)


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
def test_yaw_means_what_the_flags_say(flags: int, after_turning: float) -> None:
    bench = in_control()
    bench.heading_deg = 10.0
    bench.run(0.1)
    bench.ask(POINT, 0, 30, NAN, NAN, flags)
    bench.run(2.0)
    bench.heading_deg = 100.0
    bench.run(2.0)
    assert bench.yaw_deg == pytest.approx(after_turning, abs=1e-6)


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
def test_a_direction_that_cannot_be_had_is_denied(wrong: tuple[float, ...]) -> None:
    bench = in_control()
    assert bench.ask(POINT, *wrong) == DENIED


def test_a_rate_beside_an_angle_is_the_speed_of_the_way() -> None:
    bench = in_control()
    bench.ask(POINT, -60, 0, 10, NAN)
    bench.run(3.0)
    assert bench.pitch_deg == pytest.approx(-30.0, abs=1.0)


def test_the_old_command_takes_what_is_free_and_respects_who_has_control() -> None:
    bench = Bench()
    assert bench.ask(MOUNT, -45, 0, 15, 0, 0, 0, 2) == ACCEPTED
    bench.run(2.0)
    assert (bench.pitch_deg, bench.yaw_deg) == pytest.approx((-45.0, 15.0))
    assert bench.ask(MOUNT, -10, 0, 0, 0, 0, 0, 2, sender=RIVAL) == DENIED
    assert bench.ask(MOUNT, 0, 0, 0, 0, 0, 0, 1) == ACCEPTED
    bench.run(2.0)
    assert (bench.pitch_deg, bench.yaw_deg) == pytest.approx((0.0, 0.0))
    assert bench.ask(MOUNT, 0, 0, 0, 0, 0, 0, 3) == DENIED
    assert bench.ask(MOUNT, 0, 20, 0, 0, 0, 0, 2) == DENIED


def test_the_old_command_looks_at_a_place() -> None:
    bench = Bench()
    east = LONGITUDE_DEG + 10.0 / (111_320.0 * math.cos(math.radians(LATITUDE_DEG)))
    bench.run(0.1)
    assert bench.ask(MOUNT, 0, 0, 0, ALTITUDE_M, LATITUDE_DEG, east, 4) == ACCEPTED
    bench.run(3.0)
    assert bench.pitch_deg == pytest.approx(-45.0, abs=0.5)
    assert bench.yaw_deg == pytest.approx(90.0, abs=0.5)


def test_a_region_of_interest_is_looked_at_until_it_is_taken_back() -> None:
    bench = Bench()
    bench.run(0.1)
    bench.region.publish(
        RegionOfInterest(0, LATITUDE_DEG + 10.0 / 111_030.0, LONGITUDE_DEG, ALTITUDE_M)
    )
    bench.run(2.0)
    assert bench.pitch_deg == pytest.approx(-45.0, abs=0.5)
    bench.region.publish(RegionOfInterest(0, NAN, NAN, NAN))
    bench.run(2.0)
    assert bench.pitch_deg == pytest.approx(0.0, abs=1e-6)


def stream(bench: Bench, pitch: float, yaw: float, *rates: float, **fields: object) -> None:
    values = {"source": OPERATOR, "flags": 0, "normalised": False, **fields}
    pitch_rate, yaw_rate = rates or (NAN, NAN)
    bench.orders.publish(
        GimbalOrder(
            bench.now_us,
            pitch=pitch,
            yaw=yaw,
            pitch_rate=pitch_rate,
            yaw_rate=yaw_rate,
            **values,  # type: ignore[arg-type]  # fields of different types
        )
    )


def test_a_stream_of_its_controller_is_followed_and_ends_at_the_range() -> None:
    bench = in_control()
    stream(bench, 3.0, 0.5)
    stream(bench, -1.0, -1.0, source=RIVAL)
    bench.run(2.0)
    assert bench.pitch_deg == pytest.approx(30.0)
    assert bench.yaw_deg == pytest.approx(math.degrees(0.5))


def test_a_stick_turns_at_the_manual_rate() -> None:
    bench = in_control(MNT_RATE_YAW=20.0)
    stream(bench, NAN, NAN, 0.0, 0.5, normalised=True)
    bench.run(3.0)
    assert bench.yaw_deg == pytest.approx(30.0, abs=1.0)
    stream(bench, -1.0, NAN, normalised=True)
    bench.run(3.0)
    assert bench.pitch_deg == pytest.approx(-90.0)
