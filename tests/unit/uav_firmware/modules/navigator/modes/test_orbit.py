"""Orbits: the law's limits, and circles flown by a kinematic vehicle."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.toy_vehicle import HOME, NAN, ToyVehicle, at
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne
from uav_firmware.lib.motion import Arc, MotionLimits
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.lib.vector import norm
from uav_firmware.modules.navigator.modes.orbit_speed import heading_at, speed_on
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.guidance import OrbitHeading
from uav_firmware.msg.status import Command, NavigationState

ACCEPTED, NOT_NOW, DENIED = 0, 1, 2
LIMITS = MotionLimits(12.0, 3.0, 2.0, 5.0, 4.0, 3.0, 25.0)
TILT = math.radians(35.0)

radii = st.floats(1.0, 1000.0).flatmap(lambda size: st.sampled_from([size, -size]))


@given(radii, st.floats(0.1, 12.0), st.floats(0.1, 2.0), st.floats(1.0, 8.0), st.floats(2.0, 80.0))
def test_a_circle_keeps_to_acceleration_jerk_and_yaw_rate(
    radius: float, wanted: float, yaw_rate: float, acceleration: float, jerk: float
) -> None:
    limits = LIMITS._replace(acceleration_horizontal=acceleration, jerk=jerk)
    speed, slope, jerk_along = speed_on(
        radius, wanted, limits, tilt_max=TILT, yaw_rate_max=yaw_rate
    ).limits
    assert 0.0 < speed <= wanted
    assert speed / abs(radius) <= yaw_rate
    assert speed**2 / abs(radius) <= 2.0 + 1e-9
    arc = Arc(1.0, (0.0, 0.0, 0.0), radius, 0.3, speed, slope, jerk_along)
    assert norm(arc.at(0.0).acceleration) <= acceleration * (1.0 + 1e-6)
    step = 1e-6 * min(1.0, abs(radius) / speed)
    change = [
        (b - a) / step
        for a, b in zip(arc.at(0.0).acceleration, arc.at(step).acceleration, strict=True)
    ]
    assert math.hypot(*change) <= jerk * 1.01


@given(radii, st.floats(0.1, 12.0))
def test_a_slower_speed_is_never_clipped_and_the_clip_of_a_faster_one_is_reported(
    radius: float, wanted: float
) -> None:
    chosen = speed_on(radius, wanted, LIMITS, tilt_max=TILT, yaw_rate_max=math.inf)
    assert (chosen.limits.speed < wanted - 0.01) == bool(chosen.clipped_by)
    again = speed_on(
        radius, 0.9 * chosen.limits.speed, LIMITS, tilt_max=TILT, yaw_rate_max=math.inf
    )
    assert again.clipped_by == ""


@given(radii, st.floats(-math.pi, math.pi))
def test_headings_match_their_names(radius: float, bearing: float) -> None:
    state = Arc(1.0, (0.0, 0.0, 0.0), radius, bearing, 1.0, 0.0, 0.0).at(0.0)
    outward = math.atan2(state.position[1], state.position[0])
    ahead = math.atan2(state.velocity[1], state.velocity[0])
    wanted = {
        OrbitHeading.FORWARDS: ahead,
        OrbitHeading.BACKWARDS: ahead + math.pi,
        OrbitHeading.AWAY: outward,
        OrbitHeading.TOWARDS_CENTRE: outward + math.pi,
    }
    for heading, direction in wanted.items():
        assert abs(wrap_pi(heading_at(heading, bearing, radius) - direction)) < 1e-6


def order(
    vehicle: ToyVehicle,
    radius: float = 10.0,
    speed: float = 3.0,
    heading: float = 3.0,
    angle: float = 0.0,
    centre: tuple[float, float] = (0.0, 0.0),
    height: float = 5.0,
) -> int:
    place = at(*centre)
    return vehicle.send(
        Command.DO_ORBIT, radius, speed, heading, angle, place["x"], place["y"], HOME[2] + height
    )


def turned_on_the_circle(vehicle: ToyVehicle) -> float:
    status = vehicle.orbit_status.value
    return 0.0 if status is None else status.turned


@pytest.mark.first_case
@pytest.mark.parametrize("radius", [10.0, -6.0])
@pytest.mark.parametrize("turns", [0.5, 1.0, 2.25])
def test_the_commanded_turns_are_flown_and_end_in_hold(radius: float, turns: float) -> None:
    vehicle = airborne()
    assert order(vehicle, radius, 3.0, 3.0, turns * math.tau, (20.0, 5.0)) == ACCEPTED
    assert vehicle.mode is NavigationState.ORBIT
    bearings: list[float] = []
    vehicle.run_until(lambda v: math.hypot(*v.velocity) > 0.5, 10.0)

    def done(v: ToyVehicle) -> bool:
        bearings.append(math.atan2(v.position[1] - 5.0, v.position[0] - 20.0))
        return v.mode is NavigationState.AUTO_LOITER

    vehicle.run_until(done, 90.0)
    vehicle.run(1.0)
    turned = sum(wrap_pi(b - a) for a, b in itertools.pairwise(bearings))
    assert turned == pytest.approx(math.copysign(turns * math.tau, radius), abs=0.06)
    assert math.dist(vehicle.position[:2], (20.0, 5.0)) == pytest.approx(abs(radius), abs=0.05)


@pytest.mark.first_case
@pytest.mark.parametrize("heading", list(OrbitHeading))
def test_each_heading_is_held_on_the_circle(heading: OrbitHeading) -> None:
    vehicle = airborne()
    initial = vehicle.yaw
    assert order(vehicle, 10.0, math.radians(20.0) * 10.0, float(heading)) == ACCEPTED
    vehicle.run_until(lambda v: turned_on_the_circle(v) > 0.1, 60.0)
    for _ in range(100):
        vehicle.run(0.2)
        setpoint = vehicle.setpoints[-1]
        north, east = setpoint.position_ned[:2]
        ahead = math.atan2(setpoint.velocity_ned[1], setpoint.velocity_ned[0])
        wanted = {
            OrbitHeading.FORWARDS: ahead,
            OrbitHeading.BACKWARDS: ahead + math.pi,
            OrbitHeading.AWAY: math.atan2(east, north),
            OrbitHeading.TOWARDS_CENTRE: math.atan2(-east, -north),
        }.get(heading, initial)
        assert abs(wrap_pi(setpoint.yaw - wanted)) < math.radians(1.0)


def test_the_speed_is_cut_to_what_the_circle_allows_and_said_so() -> None:
    vehicle = airborne()
    assert order(vehicle, 4.0, 8.0, 1.0) == ACCEPTED
    vehicle.run(30.0)
    status = vehicle.orbit_status.value
    assert status is not None
    assert status.active
    assert status.speed_m_s == pytest.approx(math.sqrt(8.0))
    assert math.hypot(*vehicle.setpoints[-1].velocity_ned) == pytest.approx(math.sqrt(8.0))
    assert any("Orbit speed limited to 2.83 m/s" in text for text in vehicle.texts)


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"radius": 0.5}, "parameter 1"),
        ({"radius": 5000.0}, "parameter 1"),
        ({"speed": 11.0}, "parameter 2"),
        ({"speed": -1.0}, "parameter 2"),
        ({"heading": 8.0}, "parameter 3"),
        ({"heading": 1.5}, "parameter 3"),
        ({"angle": -1.0}, "parameter 4"),
        ({"height": -103.0}, "parameter 7"),
    ],
)
def test_an_orbit_outside_the_limits_is_denied(parameters: dict[str, float], named: str) -> None:
    vehicle = airborne()
    assert order(vehicle, **parameters) == DENIED  # type: ignore[arg-type]  # all numbers
    assert named in vehicle.texts[-1]
    assert vehicle.mode is NavigationState.AUTO_LOITER


def test_no_orbit_from_the_ground() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    assert order(vehicle) == NOT_NOW


def test_what_is_left_open_is_the_present_place_and_the_defaults() -> None:
    vehicle = airborne()
    assert vehicle.send(Command.DO_ORBIT, NAN, NAN, NAN, NAN, NAN, NAN, NAN) == ACCEPTED
    vehicle.run(20.0)
    assert math.hypot(*vehicle.position[:2]) == pytest.approx(10.0, abs=0.2)
    assert vehicle.height == pytest.approx(5.0, abs=0.05)
    status = vehicle.orbit_status.value
    assert status is not None
    assert status.turned > math.tau / 4


def test_a_pause_ends_the_orbit_and_its_report() -> None:
    vehicle = airborne()
    assert order(vehicle) == ACCEPTED
    vehicle.run(20.0)
    assert vehicle.set_mode(3) == ACCEPTED
    vehicle.run(6.0)
    assert math.hypot(*vehicle.velocity) < 0.01
    status = vehicle.orbit_status.value
    assert status is not None
    assert not status.active


def test_the_setpoint_never_jumps_in_an_orbit() -> None:
    vehicle = airborne()
    begin = len(vehicle.setpoints)
    assert order(vehicle, angle=4.0, centre=(12.0, 12.0)) == ACCEPTED
    vehicle.run(30.0)
    for before, after in zip(
        vehicle.setpoints[begin:], vehicle.setpoints[begin + 1 :], strict=False
    ):
        assert math.dist(before.position_ned, after.position_ned) < 5.0 * 0.008 + 1e-3
        assert math.dist(before.velocity_ned, after.velocity_ned) < 5.5 * 0.008 + 1e-3
        assert math.dist(before.acceleration_ned, after.acceleration_ned) < 25.5 * 0.008 + 1e-3


def on_a_circle_with_sticks(yaw_stick: float, seconds: float, **sticks: float) -> ToyVehicle:
    """A vehicle on a circle whose heading is the pilot's, after the stick has been held."""
    vehicle = airborne()
    assert order(vehicle, 10.0, 2.0, float(OrbitHeading.PILOT)) == ACCEPTED
    vehicle.run_until(lambda v: turned_on_the_circle(v) > 0.1, 60.0)
    values = {"forward": 0.0, "right": 0.0, "up": 0.0, "yaw": 0.0}
    for held in ({}, {"yaw": yaw_stick, **sticks}):
        for _ in range(5 if not held else round(seconds / 0.1)):
            vehicle.sticks.publish(ManualControlSetpoint(vehicle.now_us, **{**values, **held}))
            vehicle.run(0.1)
    return vehicle


@pytest.mark.first_case
@pytest.mark.parametrize("stick", [-1.0, -0.5, 0.5, 1.0])
def test_a_pilot_turns_the_nose_on_the_circle_by_the_yaw_stick(stick: float) -> None:
    before = on_a_circle_with_sticks(0.0, 2.0).setpoints[-1].yaw
    vehicle = on_a_circle_with_sticks(stick, 2.0)
    assert vehicle.mode is NavigationState.ORBIT
    turned = wrap_pi(vehicle.setpoints[-1].yaw - before)
    assert math.copysign(1.0, turned) == math.copysign(1.0, stick)
    assert 0.4 * abs(stick) < abs(turned) <= 2.0 * math.radians(45.0) * abs(stick)


def test_the_nose_rests_when_the_pilot_falls_silent_and_turns_on_from_there() -> None:
    vehicle = on_a_circle_with_sticks(1.0, 1.0)
    vehicle.run(2.0)
    rested = vehicle.setpoints[-1].yaw
    vehicle.run(3.0)
    assert vehicle.setpoints[-1].yaw == pytest.approx(rested, abs=0.01)


def test_other_sticks_still_take_the_vehicle_over() -> None:
    vehicle = on_a_circle_with_sticks(0.0, 1.0, right=1.0)
    assert vehicle.mode is NavigationState.POSCTL
