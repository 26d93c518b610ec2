"""Speed along a line: arrives exactly, within its limits, and no slower than it must be."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from uav_firmware.lib.speed_profile import (
    Limits,
    Phase,
    brake,
    change_distance,
    change_duration,
    highest_start,
    plan,
    release,
)

LIMITS = Limits(5.0, 3.0, 8.0)
speeds = st.floats(0.0, 5.0)
distances = st.floats(0.01, 200.0)


def run(phases: list[Phase], speed: float, acceleration: float = 0.0) -> tuple[float, float, float]:
    """Distance, speed and acceleration after the phases."""
    distance = 0.0
    for duration, jerk in phases:
        distance += speed * duration + acceleration * duration**2 / 2 + jerk * duration**3 / 6
        speed += acceleration * duration + jerk * duration**2 / 2
        acceleration += jerk * duration
    return distance, speed, acceleration


@given(distances, speeds, speeds)
def test_a_profile_covers_its_distance_and_ends_at_its_speed(
    distance: float, start: float, end: float
) -> None:
    phases = plan(distance, start, end, LIMITS)
    if phases is None:
        assert change_distance(start, end, LIMITS) > distance
        return
    covered, speed, acceleration = run(phases, start)
    assert covered == pytest.approx(distance, abs=1e-4)
    assert speed == pytest.approx(end, abs=1e-4)
    assert acceleration == pytest.approx(0.0, abs=1e-4)


@given(speeds, speeds)
def test_a_change_keeps_acceleration_and_jerk(start: float, end: float) -> None:
    assume(abs(end - start) > 1e-3)
    duration = change_duration(end - start, LIMITS)
    assert abs(end - start) / duration <= LIMITS.acceleration + 1e-9
    # With unlimited acceleration the jerk alone allows this and no shorter time.
    assert duration**2 >= 4.0 * abs(end - start) / LIMITS.jerk - 1e-9


@given(distances, speeds)
def test_the_highest_start_is_just_possible(distance: float, end: float) -> None:
    start = highest_start(distance, end, LIMITS)
    assert end <= start <= LIMITS.speed
    assert change_distance(start, end, LIMITS) <= distance + 1e-9
    if start < LIMITS.speed:
        assert change_distance(start + 1e-3, end, LIMITS) > distance


def test_a_start_above_the_limit_is_slowed_to_it() -> None:
    phases = plan(100.0, 8.0, 0.0, LIMITS)
    assert phases is not None
    cruise = max(phases, key=lambda phase: phase.duration)
    before = phases[: phases.index(cruise)]
    assert run(before, 8.0)[1] == pytest.approx(LIMITS.speed)


def test_more_room_allows_more_speed() -> None:
    starts = [highest_start(room, 0.0, LIMITS) for room in (0.5, 1.0, 2.0, 4.0)]
    assert starts == sorted(starts)
    assert starts[0] < starts[-1]


@given(st.floats(-3.0, 3.0))
def test_a_release_ends_without_acceleration(acceleration: float) -> None:
    _, _, left = run(release(acceleration, LIMITS), 2.0, acceleration)
    assert left == pytest.approx(0.0, abs=1e-4)


@given(st.floats(-4.0, 4.0), st.floats(0.1, 20.0), st.integers(-3, 3))
def test_a_stop_ends_from_its_last_ramp_however_its_numbers_are_rounded(
    acceleration: float, jerk: float, steps: int
) -> None:
    """In the last ramp the acceleration falls to zero just as the speed does."""
    speed = -acceleration * abs(acceleration) / (2.0 * jerk)
    for _ in range(abs(steps)):
        speed = math.nextafter(speed, math.copysign(math.inf, steps))
    _, *left = run(brake(speed, acceleration, Limits(math.inf, 3.0, jerk)), speed, acceleration)
    assert left == pytest.approx([0.0, 0.0], abs=1e-4)
