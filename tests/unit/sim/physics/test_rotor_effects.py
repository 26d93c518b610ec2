"""Rotor drag and ground effect by direction, limits and published figures."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.rotor_effects import ground_effect_factor, rotor_drag
from sim.physics.truth import Motors, Vector3

HOVER: Motors = (5065.0, 5065.0, 5065.0, 5065.0)
STILL: Vector3 = (0.0, 0.0, 0.0)
DENSITY = 1.15
HUBS = ((0.1651, 0.1651), (-0.1651, -0.1651), (0.1651, -0.1651), (-0.1651, 0.1651))
"""Forward and right [m] of each rotor, as in docs/explanation/simulated-vehicle.md."""

speeds = st.floats(-20.0, 20.0)
rates = st.floats(-20.0, 20.0)
rotor_speeds = st.tuples(*[st.floats(0.0, 11_000.0)] * 4)


@given(rotor_speeds, speeds, speeds, rates, rates, rates, st.floats(0.6, 1.3))
def test_rotors_take_energy_from_the_motion_and_never_give_any(
    rpm: Motors, u: float, v: float, p: float, q: float, r: float, density: float
) -> None:
    forward_n, right_n, yaw_nm = rotor_drag(rpm, (u, v, 0.0), (p, q, r), density)
    # The force acts 25 mm above the centre, whose velocity the rotation adds to.
    power_w = forward_n * (u - 0.025 * q) + right_n * (v + 0.025 * p) + yaw_nm * r
    assert power_w <= 1e-9


@given(rotor_speeds, speeds, speeds, rates)
def test_the_whole_is_the_sum_of_the_forces_at_the_hubs(
    rpm: Motors, u: float, v: float, r: float
) -> None:
    forces = [
        (-k * (u - r * right), -k * (v + r * ahead))
        for k, (ahead, right) in zip([0.1 * n / 5065.0 for n in rpm], HUBS, strict=True)
    ]
    moment = sum(a * fy - b * fx for (fx, fy), (a, b) in zip(forces, HUBS, strict=True))
    forward_n, right_n, yaw_nm = rotor_drag(rpm, (u, v, 3.0), (0.0, 0.0, r), DENSITY)
    assert forward_n == pytest.approx(sum(fx for fx, _ in forces), abs=1e-9)
    assert right_n == pytest.approx(sum(fy for _, fy in forces), abs=1e-9)
    assert yaw_nm == pytest.approx(moment, abs=1e-9)


def test_in_hover_four_rotors_resist_six_metres_a_second_with_2_4_newton() -> None:
    forward_n, right_n, _ = rotor_drag(HOVER, (6.0, 0.0, 0.0), STILL, DENSITY)
    assert forward_n == pytest.approx(-2.4)
    assert right_n == 0.0


def test_a_hover_in_thinner_air_drags_with_the_root_of_the_density() -> None:
    share = 0.7
    faster = HOVER[0] / math.sqrt(share)  # The same thrust
    forward_n, _, _ = rotor_drag((faster,) * 4, (6.0, 0.0, 0.0), STILL, share * DENSITY)
    assert forward_n == pytest.approx(-2.4 * math.sqrt(share))


def test_standing_rotors_do_not_drag() -> None:
    assert rotor_drag((0.0, 0.0, 0.0, 0.0), (5.0, 5.0, 5.0), (1.0, 1.0, 10.0), DENSITY) == (0, 0, 0)


def test_two_rotors_that_carry_the_weight_turn_the_vehicle_at_some_thousand_degrees_a_second() -> (
    None
):
    reaction_nm = 0.0196 * 1.4 * 9.81
    speed_rpm = 5065.0 * 2.0**0.5
    _, _, yaw_nm = rotor_drag((0.0, 0.0, speed_rpm, speed_rpm), STILL, (0.0, 0.0, 17.5), DENSITY)
    assert yaw_nm == pytest.approx(-reaction_nm, rel=0.05)


def test_far_from_the_ground_there_is_no_ground_effect() -> None:
    assert ground_effect_factor(5.0) == pytest.approx(1.0, abs=1e-4)


def test_a_rotor_half_its_radius_up_lifts_a_third_more() -> None:
    assert ground_effect_factor(0.0) == pytest.approx(4.0 / 3.0, abs=1e-3)


def test_a_rotor_one_radius_up_lifts_a_fifteenth_more() -> None:
    assert ground_effect_factor(0.1194 - 0.025) == pytest.approx(16.0 / 15.0, abs=1e-6)


@given(low=st.floats(-1.0, 10.0), step=st.floats(0.0, 10.0))
def test_the_nearer_the_ground_the_more_lift(low: float, step: float) -> None:
    assert ground_effect_factor(low) >= ground_effect_factor(low + step) >= 1.0
