"""The law of three rotors against the equations it is made for."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.rotor_loss_control.controller import (
    Poles,
    RotorArm,
    RotorLossController,
    TouchdownDetector,
    VehicleDynamics,
    limit_tilt,
    pole_placement,
    share,
    tilt_error,
)

DIAGONAL = complex(1.0, 1.0) / math.sqrt(2.0)
ARMS = (
    RotorArm(complex(-1.0, 1.0) / math.sqrt(2.0), -1.0),
    RotorArm(complex(1.0, -1.0) / math.sqrt(2.0), -1.0),
    RotorArm(complex(1.0, 1.0) / math.sqrt(2.0), 1.0),
    RotorArm(complex(-1.0, -1.0) / math.sqrt(2.0), 1.0),
)
DOWN = (0.0, 0.0, 1.0)
F450 = VehicleDynamics(185.0, 0.056, 1.326, 3.55)
POLES = Poles(tilt=8.0, rate=10.0)


@given(roll=st.floats(0.01, 0.4), pitch=st.floats(0.01, 0.4), yaw=st.floats(-3.0, 3.0))
def test_a_tilt_is_told_by_axis_and_sign_whatever_the_heading(
    roll: float, pitch: float, yaw: float
) -> None:
    assert tilt_error(from_euler(roll, 0.0, yaw), DOWN) == pytest.approx(complex(roll, 0.0))
    assert tilt_error(from_euler(0.0, pitch, yaw), DOWN) == pytest.approx(complex(0.0, pitch))
    assert tilt_error(from_euler(-roll, 0.0, yaw), DOWN).real < 0.0


def test_a_level_vehicle_has_no_tilt_error_and_an_inverted_one_has() -> None:
    assert tilt_error(from_euler(0.0, 0.0, 1.0), DOWN) == 0j
    assert abs(tilt_error(from_euler(math.pi, 0.0, 0.0), DOWN)) > 0.4


@given(
    r=st.floats(-20.0, 20.0),
    k=st.floats(-10.0, 10.0),
    tilt=st.floats(0.5, 10.0),
    rate=st.floats(1.0, 15.0),
)
def test_the_closed_loop_has_the_poles_asked_for(
    r: float, k: float, tilt: float, rate: float
) -> None:
    time_s = 0.056
    k1, k2, k3 = pole_placement(r, k, time_s, Poles(tilt, rate))
    for pole in (complex(-tilt, -r), complex(-rate, k), complex(-1.0 / time_s, 0.0)):
        through_tilt, through_rate = pole + complex(0.0, r), pole - complex(0.0, k)
        open_loop = (pole + 1.0 / time_s) * through_rate * through_tilt
        fed_back = (k1 + k2 * through_tilt + k3 * through_tilt * through_rate) / time_s
        assert abs(open_loop + fed_back) < 1e-6 * (1.0 + abs(open_loop))


@given(
    wanted=st.complex_numbers(max_magnitude=5.0, allow_nan=False),
    total=st.floats(0.0, 4.0),
    lost=st.integers(0, 3),
)
def test_thrusts_stay_in_range_and_the_lost_rotor_gives_none(
    wanted: complex, total: float, lost: int
) -> None:
    thrust = share(wanted, total, lost, ARMS)
    assert thrust[lost] == 0.0
    assert all(0.0 <= one <= 1.0 + 1e-12 for one in thrust)
    if total <= 2.0:
        assert sum(thrust) == pytest.approx(total, abs=1e-9)


@pytest.mark.parametrize("lost", [0, 1, 2, 3])
def test_a_small_demand_across_the_lost_arm_is_met_exactly(lost: int) -> None:
    pair = next(motor for motor in range(4) if motor not in (lost, (1, 0, 3, 2)[lost]))
    wanted = 0.1 * ARMS[pair].lever
    thrust = share(wanted, 1.0, lost, ARMS)
    produced = sum(arm.lever * one for arm, one in zip(ARMS, thrust, strict=True))
    assert produced == pytest.approx(wanted)


@pytest.mark.parametrize("lost", [0, 1, 2, 3])
def test_the_opposite_rotor_pushes_where_it_helps_and_else_stands(lost: int) -> None:
    opposite = (1, 0, 3, 2)[lost]
    assert share(0.1 * ARMS[opposite].lever, 1.0, lost, ARMS)[opposite] == pytest.approx(0.1)
    assert share(-0.1 * ARMS[opposite].lever, 1.0, lost, ARMS)[opposite] == 0.0


def settle(lost: int, yaw_rate: float) -> tuple[complex, complex]:
    """Tilt and rate after four seconds of the equations in the file's head."""
    law, dt = RotorLossController(ARMS), 0.004
    law.start((0.23, 0.23, 0.23, 0.23), lost)
    tilt, rate, reached = complex(0.2, -0.1), 0j, [0.23] * 4
    reached[lost] = 0.0
    for _ in range(1000):
        thrust = law.update(lost, tilt, (rate.real, rate.imag, yaw_rate), 0.23, F450, POLES, dt)
        reached = [
            old + dt / F450.motor_time_s * (new - old)
            for old, new in zip(reached, thrust, strict=True)
        ]
        spin = sum(a.spin * math.sqrt(max(f, 0.0)) for a, f in zip(ARMS, reached, strict=True))
        precession = 0.326 * yaw_rate + F450.rotor_spin * spin
        turning = F450.acceleration * sum(a.lever * f for a, f in zip(ARMS, reached, strict=True))
        # Exact turns, so that the explicit steps do not add energy
        rate = rate * complex(math.cos(precession * dt), math.sin(precession * dt)) + turning * dt
        tilt = tilt * complex(math.cos(yaw_rate * dt), -math.sin(yaw_rate * dt)) + rate * dt
    return tilt, rate


@pytest.mark.parametrize(("lost", "turn"), [(0, -1.0), (1, -1.0), (2, 1.0), (3, 1.0)])
def test_a_lean_is_righted_while_spinning(lost: int, turn: float) -> None:
    tilt, _ = settle(lost, 17.0 * turn)
    assert abs(tilt) < 0.08


@given(north=st.floats(-1.0, 1.0), east=st.floats(-1.0, 1.0), down=st.floats(-1.0, 1.0))
def test_a_limited_direction_is_of_length_one_and_no_steeper(
    north: float, east: float, down: float
) -> None:
    length = math.hypot(north, east, down)
    if length < 1e-3:
        return
    x, y, z = limit_tilt((north / length, east / length, down / length), 0.3)
    assert math.hypot(x, y, z) == pytest.approx(1.0)
    assert math.atan2(math.hypot(x, y), z) <= 0.3 + 1e-9


DT = 0.004


def spinning() -> TouchdownDetector:
    sign = TouchdownDetector()
    for _ in range(500):
        assert not sign.update(0.4, 0.4, -17.0, DT)
    return sign


def seen(
    sign: TouchdownDetector, seconds: float, *, sink: float, spin: float, wanted: float = 0.4
) -> bool:
    return any(sign.update(wanted, sink, spin, DT) for _ in range(round(seconds / DT)))


def test_sinking_that_stops_with_a_braked_spin_is_the_ground() -> None:
    assert seen(spinning(), 0.2, sink=0.0, spin=-15.0)


def test_the_ground_is_told_at_the_slow_sink_of_a_spinning_landing_too() -> None:
    assert seen(spinning(), 0.2, sink=0.0, spin=-15.0, wanted=0.21)


def test_feet_that_brush_the_ground_brake_little_and_slowly() -> None:
    assert seen(spinning(), 0.2, sink=-0.05, spin=-16.4, wanted=0.21)


def test_a_gust_that_stops_the_sinking_is_not() -> None:
    assert not seen(spinning(), 1.0, sink=0.0, spin=-17.0)


def test_a_spin_that_slows_while_sinking_is_not() -> None:
    assert not seen(spinning(), 1.0, sink=0.4, spin=-14.0)


def test_a_moment_is_not_enough() -> None:
    assert not seen(spinning(), 0.012, sink=0.0, spin=-15.0)


def test_a_vehicle_that_is_not_to_sink_does_not_touch_down() -> None:
    sign = spinning()
    assert not any(sign.update(0.0, 0.0, -10.0, DT) for _ in range(100))


def test_the_sign_lasts_while_it_stands_and_goes_when_it_falls() -> None:
    sign = spinning()
    assert seen(sign, 0.2, sink=0.0, spin=-15.0)
    assert all(sign.update(0.4, 0.0, 0.0, DT) for _ in range(2000))
    assert not sign.update(0.4, 1.1, 0.0, DT)
