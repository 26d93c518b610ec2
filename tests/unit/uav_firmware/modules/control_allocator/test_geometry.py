import numpy as np
import pytest

from uav_firmware.modules.control_allocator.geometry import GeometryError, Rotor, mix_of

QUAD_X = (
    Rotor(0.17, 0.17, 0.02),
    Rotor(-0.17, -0.17, 0.02),
    Rotor(0.17, -0.17, -0.02),
    Rotor(-0.17, 0.17, -0.02),
)


def test_a_right_roll_raises_the_left_rotors() -> None:
    front_right, rear_left, front_left, rear_right = (row[0] for row in mix_of(QUAD_X))
    assert rear_left > 0.0
    assert front_left > 0.0
    assert front_right < 0.0
    assert rear_right < 0.0


def test_a_nose_up_pitch_raises_the_front_rotors() -> None:
    front_right, rear_left, front_left, rear_right = (row[1] for row in mix_of(QUAD_X))
    assert front_right > 0.0
    assert front_left > 0.0
    assert rear_left < 0.0
    assert rear_right < 0.0


def test_a_right_yaw_raises_the_rotors_that_turn_counter_clockwise() -> None:
    front_right, rear_left, front_left, rear_right = (row[2] for row in mix_of(QUAD_X))
    assert front_right > 0.0
    assert rear_left > 0.0
    assert front_left < 0.0
    assert rear_right < 0.0


def test_torque_about_one_axis_makes_none_about_the_others_and_no_thrust() -> None:
    lopsided = (QUAD_X[0]._replace(x=0.25), QUAD_X[1], QUAD_X[2]._replace(y=-0.1), QUAD_X[3])
    mix = np.array(mix_of(lopsided))
    effect = np.array(
        [
            [-r.y for r in lopsided],
            [r.x for r in lopsided],
            [r.moment_ratio for r in lopsided],
            [1.0] * 4,
        ]
    )
    produced = effect @ mix
    assert np.allclose(produced - np.vstack([np.diag(np.diag(produced)), np.zeros(3)]), 0.0)
    assert (np.diag(produced) > 0.0).all()


def test_a_unit_of_torque_moves_the_rotors_by_its_share_of_their_range() -> None:
    for roll, pitch, yaw in mix_of(QUAD_X):
        assert abs(roll) == pytest.approx(0.5**0.5)
        assert abs(pitch) == pytest.approx(0.5**0.5)
        assert abs(yaw) == pytest.approx(1.0)


def test_rotors_that_all_turn_one_way_are_refused() -> None:
    same = tuple(rotor._replace(moment_ratio=0.02) for rotor in QUAD_X)
    with pytest.raises(GeometryError, match="CA_ROTOR"):
        mix_of((same[0], same[1], same[2], same[3]))
