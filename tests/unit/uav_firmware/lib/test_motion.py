"""Arcs and bends are continuous, keep to their limits and end where they should."""

import math

from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.motion import Arc, MotionLimits, MotionState, arcs, bend_piece
from uav_firmware.lib.speed_profile import Limits, cruise_for
from uav_firmware.lib.vector import norm, subtract
from uav_firmware.msg.vectors import Vector3

LIMITS = MotionLimits(6.0, 3.0, 2.0, 4.0, 4.0, 4.0, 12.0)
PROFILE = Limits(3.0, 1.5, 4.0)
CENTRE: Vector3 = (4.0, -7.0, -12.0)

radii = st.floats(1.0, 60.0).flatmap(lambda size: st.sampled_from([size, -size]))
bearings = st.floats(-math.pi, math.pi)
angles = st.floats(0.1, 20.0)
speeds = st.floats(-4.0, 4.0)
slopes = st.floats(-2.0, 2.0)
velocities = st.tuples(speeds, speeds, st.floats(-2.0, 2.0))


@given(radii, bearings, angles)
def test_an_arc_stays_on_its_circle_and_turns_exactly_its_angle(
    radius: float, bearing: float, angle: float
) -> None:
    pieces = arcs(CENTRE, radius, bearing, cruise_for(angle * abs(radius), PROFILE))
    turned = sum(arc.length_at(arc.duration) for arc in pieces) / radius
    assert math.isclose(turned, math.copysign(angle, radius), rel_tol=1e-6)
    state = pieces[0].at(0.0)
    for arc in pieces:
        assert norm(subtract(arc.at(0.0).position, state.position)) < 1e-6
        assert norm(subtract(arc.at(0.0).velocity, state.velocity)) < 1e-6
        for share in (0.0, 0.3, 0.7, 1.0):
            state = arc.at(share * arc.duration)
            north, east, down = subtract(state.position, CENTRE)
            assert math.isclose(math.hypot(north, east), abs(radius), rel_tol=1e-9)
            assert down == 0.0
            assert math.hypot(*state.velocity) <= PROFILE.speed * (1.0 + 1e-9)
    assert norm(state.velocity) < 1e-6


@given(radii, bearings)
def test_a_positive_radius_is_clockwise_seen_from_above(radius: float, bearing: float) -> None:
    state = Arc(1.0, CENTRE, radius, bearing, 2.0, 0.0, 0.0).at(0.0)
    outward = subtract(state.position, CENTRE)
    clockwise = outward[0] * state.velocity[1] - outward[1] * state.velocity[0]
    assert clockwise * radius > 0.0


@given(radii, bearings, st.floats(0.1, 5.0))
def test_velocity_and_acceleration_are_the_slopes_of_the_position(
    radius: float, bearing: float, time: float
) -> None:
    arc = Arc(10.0, CENTRE, radius, bearing, 0.5, 0.4, 0.1)
    step = 1e-4
    before, here, after = arc.at(time - step), arc.at(time), arc.at(time + step)
    for axis in range(3):
        slope = (after.position[axis] - before.position[axis]) / (2.0 * step)
        assert math.isclose(slope, here.velocity[axis], abs_tol=1e-4)
        slope = (after.velocity[axis] - before.velocity[axis]) / (2.0 * step)
        assert math.isclose(slope, here.acceleration[axis], abs_tol=1e-4)


@given(velocities, st.tuples(slopes, slopes, slopes), velocities)
def test_a_bend_begins_as_it_is_and_ends_steady_at_the_velocity_wanted(
    velocity: Vector3, acceleration: Vector3, wanted: Vector3
) -> None:
    state = MotionState(CENTRE, velocity, acceleration)
    piece = bend_piece(state, wanted, LIMITS)
    assert piece.at(0.0) == state
    end = piece.end()
    assert norm(subtract(end.velocity, wanted)) < 1e-6
    assert norm(end.acceleration) < 1e-4
