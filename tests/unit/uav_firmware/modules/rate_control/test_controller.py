import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.rate_control.controller import AxisGains, RateController
from uav_firmware.msg.vectors import Vector3

GAINS = AxisGains(p=0.1, i=0.2, d=0.0, integral_limit=0.3)
DT = 0.004
STILL: Vector3 = (0.0, 0.0, 0.0)

rates = st.tuples(*[st.floats(-20.0, 20.0)] * 3)


def controller(gains: AxisGains = GAINS) -> RateController:
    return RateController((gains, gains, gains), 30.0)


def held(law: RateController) -> float:
    """Roll torque that the integrator holds: all that is left without error and motion."""
    return law.update(STILL, STILL, STILL, DT)[0]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_too_slow_a_turn_gives_torque_that_way_about_that_axis_alone(axis: int) -> None:
    wanted = tuple(1.0 if i == axis else 0.0 for i in range(3))
    torque = controller().update((wanted[0], wanted[1], wanted[2]), STILL, STILL, DT)
    assert torque[axis] == pytest.approx(0.1)
    assert sum(abs(t) for t in torque) == pytest.approx(0.1)


def test_a_rotation_that_grows_is_braked_by_the_derivative() -> None:
    law = controller(GAINS._replace(p=0.0, i=0.0, d=0.01))
    law.update(STILL, STILL, STILL, DT)
    assert law.update(STILL, (0.5, 0.0, 0.0), STILL, DT)[0] < 0.0


def test_a_step_of_the_setpoint_does_not_kick_the_derivative() -> None:
    law = controller(GAINS._replace(p=0.0, i=0.0, d=0.01))
    law.update(STILL, STILL, STILL, DT)
    assert law.update((5.0, 0.0, 0.0), STILL, STILL, DT) == STILL


def test_a_lasting_error_is_integrated() -> None:
    law = controller()
    for _ in range(250):
        law.update((0.1, 0.0, 0.0), STILL, STILL, DT)
    assert held(law) == pytest.approx(0.2 * 0.1 * 1.0, rel=0.01)


def test_the_integral_stops_at_its_limit() -> None:
    law = controller()
    for _ in range(5000):
        law.update((1.0, 0.0, 0.0), STILL, STILL, DT)
    assert held(law) == pytest.approx(0.3)


def test_the_integral_does_not_grow_where_the_motors_cannot_follow() -> None:
    law = controller()
    for _ in range(250):
        law.update((1.0, 0.0, 0.0), STILL, (0.2, 0.0, 0.0), DT)
    assert held(law) == 0.0


def test_the_integral_still_shrinks_where_the_motors_cannot_follow() -> None:
    law = controller()
    for _ in range(250):
        law.update((1.0, 0.0, 0.0), STILL, STILL, DT)
    charged = held(law)
    law.update((-1.0, 0.0, 0.0), STILL, (0.2, 0.0, 0.0), DT)
    assert held(law) < charged


def test_a_flip_does_not_charge_the_integral() -> None:
    law = controller()
    law.update((8.0, 0.0, 0.0), STILL, STILL, DT)
    assert held(law) == 0.0


def test_reset_forgets_everything() -> None:
    law = controller()
    fresh = controller()
    for _ in range(10):
        law.update((1.0, -2.0, 0.5), (0.1, 0.2, 0.3), STILL, DT)
    law.reset()
    wanted, measured = (0.3, 0.2, 0.1), (0.0, 0.1, 0.2)
    assert law.update(wanted, measured, STILL, DT) == fresh.update(wanted, measured, STILL, DT)


@given(rates, rates, rates)
def test_torque_is_always_within_one(
    wanted: Vector3, measured: Vector3, unallocated: Vector3
) -> None:
    law = controller()
    law.update(STILL, STILL, STILL, DT)
    assert all(abs(t) <= 1.0 for t in law.update(wanted, measured, unallocated, DT))
