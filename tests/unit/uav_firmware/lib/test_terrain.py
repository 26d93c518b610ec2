"""The ground below: seen through the range finder, steady while the vehicle moves."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.estimates import local_position
from uav_firmware.lib.rotation import from_euler
from uav_firmware.lib.terrain import TerrainFilter, ground_down
from uav_firmware.msg.estimate import EstimateResets, TerrainEstimate
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.vectors import Quaternion

LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
SAMPLES = 5


def seen(
    below: TerrainFilter,
    *distances_m: float,
    height_m: float = 10.0,
    q: Quaternion = LEVEL,
    altitude_valid: bool = True,
    z_count: int = 0,
) -> float:
    """What is known after these samples, all from one height above the origin."""
    down = math.nan
    for distance_m in distances_m:
        position = local_position(
            position_ned=(0.0, 0.0, -height_m),
            altitude_valid=altitude_valid,
            resets=EstimateResets(z_count=z_count),
        )
        down = below.update(SensorRange(0, distance_m, 0.1, 40.0), q, position)
    return down


@given(st.floats(1.0, 39.0), st.floats(-50.0, 50.0))
def test_ground_lies_the_measured_distance_below(distance_m: float, height_m: float) -> None:
    down = seen(TerrainFilter(), *[distance_m] * SAMPLES, height_m=height_m)
    assert down == pytest.approx(distance_m - height_m)


@given(st.floats(0.0, 29.0), st.floats(-180.0, 180.0))
def test_a_tilt_makes_no_ground_lower(tilt_deg: float, yaw_deg: float) -> None:
    tilt = math.radians(tilt_deg)
    q = from_euler(0.0, tilt, math.radians(yaw_deg))
    slant_m = 10.0 / math.cos(tilt)
    assert seen(TerrainFilter(), *[slant_m] * SAMPLES, q=q) == pytest.approx(0.0, abs=1e-6)


def test_a_climb_does_not_move_the_ground() -> None:
    below = TerrainFilter()
    downs = [seen(below, height, height_m=height) for height in (5.0, 6.0, 8.0, 11.0, 15.0, 20.0)]
    assert downs[-2:] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("outlier_m", [0.1, 3.0, 39.0])
def test_a_single_wrong_sample_does_not_count(outlier_m: float) -> None:
    assert seen(TerrainFilter(), 10.0, 10.0, outlier_m, 10.0, 10.0) == pytest.approx(0.0)


@pytest.mark.parametrize("distance_m", [math.nan, math.inf, 0.0, 0.05, 41.0, -1.0])
def test_a_sample_without_an_echo_proves_nothing(distance_m: float) -> None:
    below = TerrainFilter()
    assert seen(below, *[10.0] * SAMPLES) == pytest.approx(0.0)
    assert math.isnan(seen(below, distance_m))
    assert math.isnan(seen(below, *[10.0] * (SAMPLES - 1)))
    assert seen(below, 10.0) == pytest.approx(0.0)


def test_nothing_is_known_far_tilted_or_without_a_height() -> None:
    tilted = from_euler(math.radians(35.0), 0.0, 0.0)
    assert math.isnan(seen(TerrainFilter(), *[10.0] * SAMPLES, q=tilted))
    assert math.isnan(seen(TerrainFilter(), *[10.0] * SAMPLES, altitude_valid=False))


def test_samples_before_a_reset_of_the_height_do_not_count() -> None:
    below = TerrainFilter()
    seen(below, *[10.0] * SAMPLES)
    assert math.isnan(seen(below, 10.0, height_m=25.0, z_count=1))
    assert seen(below, *[10.0] * SAMPLES, height_m=25.0, z_count=1) == pytest.approx(-15.0)


def test_ground_that_was_measured_long_ago_is_not_below_any_more() -> None:
    measured = TerrainEstimate(1_000_000, 3.0)
    assert ground_down(measured, 1_500_000) == 3.0
    assert math.isnan(ground_down(measured, 1_500_001))
    assert math.isnan(ground_down(None, 0))


def climbed(
    below: TerrainFilter,
    heights_m: list[float],
    *,
    distance_m: float | None = None,
    north_m: float = 0.0,
    is_flying: bool = True,
) -> float:
    """What is known after a motion through these heights above level ground.

    The range finder measures `distance_m` all the time; None: the height. `north_m` is the way
    north of each step.
    """
    down = math.nan
    for step, height_m in enumerate(heights_m):
        position = local_position(position_ned=(step * north_m, 0.0, -height_m))
        sample = SensorRange(0, height_m if distance_m is None else distance_m, 0.1, 40.0)
        down = below.update(sample, LEVEL, position, is_flying=is_flying)
    return down


DESCENT_M = [20.0 - 0.1 * step for step in range(15)]


@given(st.floats(0.1, 40.0), st.sampled_from([DESCENT_M, DESCENT_M[::-1]]))
def test_a_distance_that_no_motion_changes_is_of_no_ground(
    distance_m: float, heights_m: list[float]
) -> None:
    below = TerrainFilter()
    assert math.isnan(climbed(below, heights_m, distance_m=distance_m))
    assert below.has_failed


def test_a_range_finder_that_follows_again_is_believed_again() -> None:
    below = TerrainFilter()
    climbed(below, DESCENT_M, distance_m=0.3)
    assert math.isnan(climbed(below, [DESCENT_M[-1]] * 10))  # Nothing has moved yet
    assert climbed(below, [DESCENT_M[-1] - 0.1 * step for step in range(30)]) == pytest.approx(0.0)
    assert not below.has_failed


@given(st.lists(st.floats(0.1, 40.0), min_size=SAMPLES, max_size=SAMPLES))
def test_samples_that_do_not_agree_show_no_ground(distances_m: list[float]) -> None:
    _, lower, _, upper, _ = sorted(distances_m)
    assert math.isnan(seen(TerrainFilter(), *distances_m)) == (upper - lower > 1.0)


@given(st.floats(0.11, 2.0))
def test_a_flight_along_a_slope_proves_nothing(north_m: float) -> None:
    below = TerrainFilter()
    assert not math.isnan(climbed(below, DESCENT_M, distance_m=8.0, north_m=north_m))
    assert not below.has_failed


def test_nor_does_it_prove_that_a_stuck_range_finder_follows() -> None:
    below = TerrainFilter()
    climbed(below, DESCENT_M, distance_m=8.0)
    climbed(below, DESCENT_M[::-1], distance_m=8.0, north_m=0.3)
    assert below.has_failed


def test_a_vehicle_on_the_ground_proves_nothing() -> None:
    """Its estimated height drifts with the air pressure."""
    below = TerrainFilter()
    climbed(below, DESCENT_M, distance_m=0.2, is_flying=False)
    assert not below.has_failed


def test_a_reset_of_the_height_is_no_motion() -> None:
    below = TerrainFilter()
    seen(below, *[10.0] * SAMPLES)
    seen(below, *[10.0] * SAMPLES, height_m=12.0, z_count=1)
    assert not below.has_failed
