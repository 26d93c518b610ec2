"""The guided point: it reaches its target within its limits, and waits for its vehicle."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.guide import Guide, GuideLimits, approach_speed
from uav_firmware.msg.vectors import Vector3

LIMITS = GuideLimits(
    acceleration_horizontal=4.0,
    acceleration_up=4.0,
    acceleration_down=3.0,
    jerk=8.0,
    leash_horizontal=2.0,
    leash_vertical=1.0,
)
DT = 0.016
speeds = st.floats(-10.0, 10.0)
velocities = st.tuples(speeds, speeds, st.floats(-3.0, 1.5))


def run(guide: Guide, wanted: Vector3, seconds: float) -> list[Vector3]:
    """Advance with a vehicle that follows exactly; gives the accelerations."""
    accelerations = []
    for _ in range(round(seconds / DT)):
        guide.advance(wanted, guide.position, LIMITS, DT)
        accelerations.append(guide.acceleration)
    return accelerations


@given(velocities)
def test_it_takes_the_wanted_velocity_and_comes_to_rest(wanted: Vector3) -> None:
    guide = Guide()
    run(guide, wanted, 8.0)
    assert guide.velocity == pytest.approx(wanted, abs=0.01)
    run(guide, (0.0, 0.0, 0.0), 8.0)
    place = guide.position
    run(guide, (0.0, 0.0, 0.0), 1.0)
    assert guide.velocity == (0.0, 0.0, 0.0)
    assert guide.position == place


@given(velocities, velocities)
def test_acceleration_and_jerk_stay_within_their_limits(first: Vector3, second: Vector3) -> None:
    guide = Guide()
    seen = [(0.0, 0.0, 0.0), *run(guide, first, 2.0), *run(guide, second, 2.0)]
    for before, after in pairwise(seen):
        assert math.hypot(after[0], after[1]) <= LIMITS.acceleration_horizontal + 1e-9
        assert math.dist(before, after) <= LIMITS.jerk * DT + 0.1 + 1e-9  # the end of settling


def test_it_waits_for_a_vehicle_that_stands() -> None:
    guide = Guide()
    for _ in range(500):
        guide.advance((5.0, 0.0, -2.0), (0.0, 0.0, 0.0), LIMITS, DT)
    assert guide.position == pytest.approx((2.0, 0.0, -1.0))


@given(st.floats(0.0, 200.0), st.floats(0.0, 200.0))
def test_the_nearer_the_place_the_slower(a: float, b: float) -> None:
    near, far = sorted((a, b))
    assert 0.0 <= approach_speed(near, 4.0) <= approach_speed(far, 4.0)


@given(st.floats(1.0, 150.0))
def test_the_braking_never_needs_more_than_half_the_acceleration(distance: float) -> None:
    slope = (approach_speed(distance + 1e-4, 4.0) - approach_speed(distance, 4.0)) / 1e-4
    assert approach_speed(distance, 4.0) * slope <= 2.0 + 1e-2
