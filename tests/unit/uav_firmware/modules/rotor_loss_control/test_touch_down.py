"""Ground under a spinning vehicle: both signs, for a moment, and gone when it falls."""

from uav_firmware.modules.rotor_loss_control.touch_down import TouchDownSign

DT = 0.004


def spinning() -> TouchDownSign:
    sign = TouchDownSign()
    for _ in range(500):
        assert not sign.update(0.4, 0.4, -17.0, DT)
    return sign


def seen(
    sign: TouchDownSign, seconds: float, *, sink: float, spin: float, wanted: float = 0.4
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
