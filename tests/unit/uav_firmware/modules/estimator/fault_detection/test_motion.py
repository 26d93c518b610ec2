import pytest

from uav_firmware.modules.estimator.fault_detection.motion import SpinScale


def test_a_spin_makes_the_bias_of_the_yaw_rate_doubtful_and_its_end_does_so_again() -> None:
    scale = SpinScale()
    rates = [*range(18), *range(17, -1, -1)]  # [rad/s] Up to that on three rotors, and back
    doubts = [scale.update(-float(rate)) for rate in rates]
    up, down = doubts[:18], doubts[18:]
    assert [rate for rate, doubt in enumerate(up) if doubt] == [5, 10, 15]
    assert sum(doubt * doubt for doubt in up) ** 0.5 == pytest.approx(0.043, abs=0.001)
    assert any(down)


def test_a_spin_that_goes_on_makes_nothing_doubtful_again() -> None:
    scale = SpinScale()
    assert scale.update(17.0) > 0.0
    assert not any(scale.update(rate) for rate in (17.5, 16.0, 18.0, 17.0))


@pytest.mark.parametrize("rate", [-4.9, 0.0, 4.9])
def test_a_turn_on_four_rotors_makes_nothing_doubtful(rate: float) -> None:
    assert SpinScale().update(rate) == 0.0
