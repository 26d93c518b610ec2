"""Rotor drag and ground effect by direction, limits and published figures."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.rotor_effects import ground_effect_factor, yaw_brake_nm

HOVER = (5065.0, 5065.0, 5065.0, 5065.0)


@given(rate=st.floats(-40.0, 40.0))
def test_rotors_brake_a_turn_and_never_drive_it(rate: float) -> None:
    assert yaw_brake_nm(HOVER, rate) * rate <= 0.0


def test_standing_rotors_do_not_brake() -> None:
    assert yaw_brake_nm((0.0, 0.0, 0.0, 0.0), 10.0) == 0.0


def test_two_rotors_that_carry_the_weight_turn_the_vehicle_at_some_thousand_degrees_a_second() -> (
    None
):
    reaction_nm = 0.0196 * 1.4 * 9.81
    speed_rpm = 5065.0 * 2.0**0.5
    assert yaw_brake_nm((0.0, 0.0, speed_rpm, speed_rpm), 17.5) == pytest.approx(
        -reaction_nm, rel=0.05
    )


def test_far_from_the_ground_there_is_no_ground_effect() -> None:
    assert ground_effect_factor(5.0) == pytest.approx(1.0, abs=1e-4)


def test_a_rotor_half_its_radius_up_lifts_a_third_more() -> None:
    assert ground_effect_factor(0.0) == pytest.approx(4.0 / 3.0, abs=1e-3)


def test_a_rotor_one_radius_up_lifts_a_fifteenth_more() -> None:
    assert ground_effect_factor(0.1194 - 0.025) == pytest.approx(16.0 / 15.0, abs=1e-6)


@given(low=st.floats(-1.0, 10.0), step=st.floats(0.0, 10.0))
def test_the_nearer_the_ground_the_more_lift(low: float, step: float) -> None:
    assert ground_effect_factor(low) >= ground_effect_factor(low + step) >= 1.0
