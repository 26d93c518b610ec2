import pytest

from uav_firmware.modules.land_detector.signs import (
    Observation,
    Thresholds,
    is_clear,
    lifts_off,
    stands,
    touches_ground,
)

LIMITS = Thresholds(
    vertical_speed=0.25, horizontal_speed=1.5, rotation=0.35, thrust=0.12, lift_thrust=0.09
)
STANDING = Observation((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.08, 0.0, commanded_sink=0.7)


def test_at_rest_without_thrust_it_stands() -> None:
    assert stands(STANDING, LIMITS)


@pytest.mark.parametrize(
    "flying",
    [
        STANDING._replace(thrust=0.25),
        STANDING._replace(velocity_ned=(0.0, 0.0, 0.7)),
        STANDING._replace(velocity_ned=(0.0, 0.0, -0.7)),
        STANDING._replace(velocity_ned=(2.0, 0.0, 0.0)),
        STANDING._replace(commanded_sink=0.0),
        STANDING._replace(commanded_sink=-1.0),
        STANDING._replace(commanded_sink=0.3, velocity_ned=(0.0, 0.0, 0.2)),  # It follows
    ],
)
def test_thrust_or_motion_is_no_ground(flying: Observation) -> None:
    assert not touches_ground(flying, LIMITS)
    assert not stands(flying, LIMITS)


def test_a_velocity_of_which_little_is_known_hides_no_ground_and_makes_none() -> None:
    trembling = STANDING._replace(velocity_ned=(0.0, 0.0, 0.35))
    assert not stands(trembling, LIMITS)
    assert stands(trembling._replace(sink_accuracy=0.15), LIMITS)
    falling = STANDING._replace(velocity_ned=(0.0, 0.0, 1.1), sink_accuracy=0.8)
    assert not touches_ground(falling, LIMITS)
    assert not touches_ground(trembling._replace(sink_accuracy=0.15, thrust=0.25), LIMITS)


def test_tipping_over_touches_but_does_not_stand() -> None:
    tipping = STANDING._replace(rate_frd=(0.0, -1.0, 0.0))
    assert touches_ground(tipping, LIMITS)
    assert not stands(tipping, LIMITS)


def test_turning_on_the_spot_stands() -> None:
    assert stands(STANDING._replace(rate_frd=(0.0, 0.0, 1.0)), LIMITS)


def test_rising_under_thrust_lifts_off() -> None:
    assert lifts_off(STANDING._replace(thrust=0.3, velocity_ned=(0.0, 0.0, -0.5)), LIMITS)
    assert lifts_off(STANDING._replace(thrust=0.3, height=0.5), LIMITS)


def test_rising_without_thrust_is_an_error_of_the_estimate() -> None:
    assert not lifts_off(STANDING._replace(height=0.5), LIMITS)


def test_falling_is_flying() -> None:
    assert lifts_off(STANDING._replace(velocity_ned=(0.0, 0.0, 2.0)), LIMITS)


def test_clear_is_a_metre_up() -> None:
    assert not is_clear(STANDING._replace(height=0.9))
    assert is_clear(STANDING._replace(height=1.1))
