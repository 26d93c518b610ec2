"""Follow me: the filter on reports, and a kinematic vehicle that keeps its place."""

import math
import random
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.toy_vehicle import HOME, NAN, ToyVehicle
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.navigator.modes.target_estimator import TargetEstimator
from uav_firmware.msg.guidance import FollowTarget
from uav_firmware.msg.status import Command, NavigationState
from uav_firmware.msg.vectors import Vector3

ACCEPTED, NOT_NOW, DENIED = 0, 1, 2
UNSET: Vector3 = (NAN, NAN, NAN)
FRAME = LocalFrame(*HOME)
SECOND_US = 1_000_000
PHONE = 200


def reported(
    target: TargetEstimator, time_us: int, position: Vector3, velocity: Vector3 | None = None
) -> bool:
    return target.report(
        time_us, position, velocity, sigma=1.0, acceleration_sigma=0.9, speed_max=10.0
    )


@given(st.tuples(*[st.floats(-4.0, 4.0)] * 3), st.integers(1, 10))
def test_a_steady_target_is_known_without_lag(velocity: Vector3, rate_hz: int) -> None:
    target = TargetEstimator()
    for k in range(1, 40 * rate_hz):
        now_us = k * SECOND_US // rate_hz
        place = tuple(v * now_us * 1e-6 for v in velocity)
        assert reported(target, now_us, place)  # type: ignore[arg-type]  # three floats
    position, estimate = target.at(now_us + SECOND_US)
    for axis in range(3):
        truth = velocity[axis] * (now_us * 1e-6 + 1.0)
        assert abs(position[axis] - truth) < 0.2
        assert abs(estimate[axis] - velocity[axis]) < 0.1


@given(st.integers(0, 2**32), st.floats(-3.0, 3.0))
def test_noise_is_filtered(seed: int, speed: float) -> None:
    noise = random.Random(seed)
    target = TargetEstimator()
    errors, raw = [], []
    for k in range(1, 120):
        truth = (speed * k, 0.0, 0.0)
        seen = (truth[0] + noise.gauss(0.0, 1.0), noise.gauss(0.0, 1.0), 0.0)
        reported(target, k * SECOND_US, seen)
        if k > 20:
            errors.append(math.dist(target.at(k * SECOND_US)[0], truth))
            raw.append(math.dist(seen, truth))
    assert sum(errors) / len(errors) < 1.0 * sum(raw) / len(raw)


@given(st.floats(-math.pi, math.pi), st.floats(60.0, 5000.0))
def test_a_jump_is_dropped_and_does_not_move_the_target(direction: float, jump: float) -> None:
    target = TargetEstimator()
    for k in range(1, 10):
        reported(target, k * SECOND_US, (0.0, 0.0, 0.0))
    away = (jump * math.cos(direction), jump * math.sin(direction), 0.0)
    assert not reported(target, 10 * SECOND_US, away)
    assert math.hypot(*target.at(10 * SECOND_US)[0]) < 0.1
    assert reported(target, 11 * SECOND_US, (0.0, 0.0, 0.0))


def test_a_target_is_valid_at_its_second_report_and_lost_after_three_seconds() -> None:
    target = TargetEstimator()
    reported(target, SECOND_US, (0.0, 0.0, 0.0))
    assert not target.known(SECOND_US)
    reported(target, 2 * SECOND_US, (1.0, 0.0, 0.0))
    assert target.known(5 * SECOND_US)
    assert not target.known(5 * SECOND_US + 1)


def report(
    vehicle: ToyVehicle, place: Vector3, velocity: Vector3 = UNSET, system_id: int = PHONE
) -> None:
    geodetic = FRAME.to_geodetic(place) if math.isfinite(place[0]) else UNSET
    vehicle.follow_target.publish(
        FollowTarget(vehicle.now_us, system_id, *geodetic, velocity, accuracy_m=1.0)
    )


def follow(vehicle: ToyVehicle) -> None:
    assert vehicle.send(Command.DO_FOLLOW, float(PHONE), NAN, NAN, NAN, NAN) == ACCEPTED
    assert vehicle.mode is NavigationState.AUTO_FOLLOW_TARGET


def lead(
    vehicle: ToyVehicle, seconds: int, path: Callable[[float], Vector3], sigma: float = 1.0
) -> None:
    """Report a target once a second."""
    noise = random.Random(3)
    for k in range(seconds):
        north, east, down = path(float(k))
        report(vehicle, (north + noise.gauss(0, sigma), east + noise.gauss(0, sigma), down))
        vehicle.run(1.0)


@pytest.mark.first_case
@pytest.mark.parametrize("angle", [180.0, 0.0, 45.0, -45.0])
def test_the_place_beside_a_walking_target_is_kept(angle: float) -> None:
    vehicle = airborne()
    vehicle.registry.set("FLW_TGT_FA", angle)
    follow(vehicle)
    lead(vehicle, 60, lambda t: (1.5 * t, 10.0, 0.0))
    target = (1.5 * 60.0, 10.0)
    bearing = math.atan2(vehicle.position[1] - target[1], vehicle.position[0] - target[0])
    assert math.dist(vehicle.position[:2], target) == pytest.approx(8.0, abs=3.0)
    assert abs(wrap_pi(bearing - math.radians(angle))) < math.radians(35.0)
    assert vehicle.height == pytest.approx(8.0, abs=0.5)
    facing = math.atan2(target[1] - vehicle.position[1], target[0] - vehicle.position[0])
    assert abs(wrap_pi(vehicle.yaw - facing)) < math.radians(20.0)


def test_a_jump_of_the_reports_does_not_lead_the_vehicle_away() -> None:
    vehicle = airborne()
    follow(vehicle)
    lead(vehicle, 20, lambda _t: (15.0, 0.0, 0.0), sigma=0.3)
    before = vehicle.position
    report(vehicle, (200.0, 50.0, 0.0))
    vehicle.run(1.0)
    lead(vehicle, 5, lambda _t: (15.0, 0.0, 0.0), sigma=0.3)
    assert math.dist(vehicle.position, before) < 1.5


@pytest.mark.thorough
def test_a_silent_target_is_held_for_and_found_again() -> None:
    vehicle = airborne()
    follow(vehicle)
    lead(vehicle, 20, lambda t: (2.0 * t, 0.0, 0.0))
    vehicle.run(4.0)
    assert any("Target lost" in text for text in vehicle.texts)
    vehicle.run(3.0)
    assert math.hypot(*vehicle.velocity) < 0.01
    lead(vehicle, 10, lambda t: (45.0 + t, 0.0, 0.0))
    assert math.hypot(*vehicle.velocity) > 0.5


def test_a_target_that_tells_only_its_velocity_moves_nothing() -> None:
    vehicle = airborne()
    before = vehicle.position
    follow(vehicle)
    for _ in range(20):
        report(vehicle, UNSET, (3.0, 0.0, 0.0))
        vehicle.run(1.0)
    assert math.dist(vehicle.position, before) < 0.1


@pytest.mark.thorough
def test_another_source_waits_until_the_first_is_silent() -> None:
    vehicle = airborne()
    assert vehicle.set_mode(8) == ACCEPTED
    for _ in range(10):
        report(vehicle, (20.0, 0.0, 0.0))
        vehicle.run(0.5)
        report(vehicle, (-20.0, 0.0, 0.0), system_id=PHONE + 1)
        vehicle.run(0.5)
    assert vehicle.position[0] > 5.0
    for _ in range(30):
        report(vehicle, (-20.0, 0.0, 0.0), system_id=PHONE + 1)
        vehicle.run(1.0)
    assert vehicle.position[0] < -5.0


@pytest.mark.parametrize(
    ("parameters", "result"),
    [
        ((1.5,), DENIED),
        ((300.0,), DENIED),
        ((NAN,), DENIED),
        ((200.0, 0.0, 0.0, 3.0), DENIED),
        ((200.0, 0.0, 0.0, 2.0, NAN), DENIED),
        ((200.0, 0.0, 0.0, 2.0, -4.0), DENIED),
        ((200.0, 0.0, 0.0, NAN, 12.0), DENIED),
        ((0.0,), ACCEPTED),
    ],
)
def test_do_follow_is_checked(parameters: tuple[float, ...], result: int) -> None:
    vehicle = airborne()
    assert vehicle.send(Command.DO_FOLLOW, *parameters) == result
    assert vehicle.mode is NavigationState.AUTO_LOITER


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("altitude_mode", "height", "expected"), [(0.0, NAN, 5.0), (1.0, NAN, 8.0), (2.0, 11.0, 11.0)]
)
def test_the_height_is_that_of_the_order(
    altitude_mode: float, height: float, expected: float
) -> None:
    vehicle = airborne()
    values = (float(PHONE), 0.0, 0.0, altitude_mode, height)
    assert vehicle.send(Command.DO_FOLLOW, *values) == ACCEPTED
    lead(vehicle, 30, lambda t: (10.0, 0.0, -3.0 if t > 5 else 0.0), sigma=0.1)
    assert vehicle.height == pytest.approx(expected, abs=0.3)


def test_system_zero_ends_following_with_a_hold() -> None:
    vehicle = airborne()
    follow(vehicle)
    lead(vehicle, 5, lambda t: (3.0 * t, 0.0, 0.0))
    assert vehicle.send(Command.DO_FOLLOW, 0.0) == ACCEPTED
    assert vehicle.mode is NavigationState.AUTO_LOITER
    vehicle.run(4.0)
    assert math.hypot(*vehicle.velocity) < 0.01


@pytest.mark.thorough
def test_the_setpoint_never_jumps_while_following() -> None:
    vehicle = airborne()
    begin = len(vehicle.setpoints)
    follow(vehicle)
    lead(vehicle, 30, lambda t: (20.0 * math.sin(0.2 * t), 20.0 * math.cos(0.2 * t), 0.0))
    vehicle.run(5.0)
    pairs = zip(vehicle.setpoints[begin:], vehicle.setpoints[begin + 1 :], strict=False)
    for before, after in pairs:
        step_s = (after.time_us - before.time_us) * 1e-6
        assert math.dist(before.position_ned, after.position_ned) < 6.0 * step_s + 1e-3
        assert math.dist(before.velocity_ned, after.velocity_ned) < 7.0 * step_s + 1e-3
