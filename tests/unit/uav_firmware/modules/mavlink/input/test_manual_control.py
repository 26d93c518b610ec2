"""MANUAL_CONTROL becomes sticks: direction, range, who holds them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, Bench
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.control_mode import ManualControlSetpoint

AXIS = st.integers(-0x8000, 0x7FFF)


def say(
    bench: Bench, x: int, y: int, z: int, r: int, target: int = SYSTEM, system: int = 255
) -> None:
    bench.say(
        mavlink.MAVLink_manual_control_message(target=target, x=x, y=y, z=z, r=r, buttons=0),
        system=system,
    )
    bench.run()


def sticks(bench: Bench) -> ManualControlSetpoint | None:
    return bench.topics.manual_control_setpoint.value


@pytest.mark.parametrize(
    ("axes", "wanted"),
    [
        ((1000, 0, 500, 0), (1.0, 0.0, 0.0, 0.0)),
        ((0, 1000, 500, 0), (0.0, 1.0, 0.0, 0.0)),
        ((0, 0, 1000, 0), (0.0, 0.0, 1.0, 0.0)),
        ((0, 0, 0, 0), (0.0, 0.0, -1.0, 0.0)),
        ((0, 0, 500, 1000), (0.0, 0.0, 0.0, 1.0)),
        ((-500, -250, 250, -1000), (-0.5, -0.25, -0.5, -1.0)),
        ((1001, -2000, -1000, 32766), (1.0, -1.0, -1.0, 1.0)),
    ],
)
def test_each_axis_has_its_direction(
    axes: tuple[int, int, int, int], wanted: tuple[float, float, float, float]
) -> None:
    bench = Bench()
    say(bench, *axes)
    heard = sticks(bench)
    assert heard is not None
    assert heard[1:] == pytest.approx(wanted)


@given(AXIS, AXIS, AXIS, AXIS)
def test_whatever_comes_is_within_range_or_ignored(x: int, y: int, z: int, r: int) -> None:
    bench = Bench()
    say(bench, x, y, z, r)
    heard = sticks(bench)
    assert (heard is None) is (0x7FFF in {x, y, z, r})
    assert heard is None or all(-1.0 <= axis <= 1.0 for axis in heard[1:])


def test_sticks_for_another_vehicle_are_not_ours() -> None:
    bench = Bench()
    for target in (0, SYSTEM + 1):
        say(bench, 1000, 0, 500, 0, target=target)
    assert sticks(bench) is None


def test_the_first_sender_keeps_the_sticks_until_it_is_silent() -> None:
    bench = Bench()
    say(bench, 1000, 0, 500, 0, system=255)
    say(bench, -1000, 0, 500, 0, system=254)
    first = sticks(bench)
    assert first is not None
    assert first.forward == 1.0
    bench.run(1_100_000)
    say(bench, -1000, 0, 500, 0, system=254)
    second = sticks(bench)
    assert second is not None
    assert second.forward == -1.0
