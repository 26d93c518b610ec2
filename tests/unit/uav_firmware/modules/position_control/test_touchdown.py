"""What does not sink, although it is led down and the rotors do not carry it, stands."""

import math

import pytest

from uav_firmware.modules.position_control.controller import Motion
from uav_firmware.modules.position_control.touchdown import HOLD_S, TouchDown, settle

NAN = math.nan
STEP_S = 0.016
LIGHT = 0.8  # of the hover thrust


def led_down(speed: float = 0.42, *, height_down: float = NAN) -> Motion:
    return Motion((0.0, 0.0, height_down), (0.0, 0.0, speed), (0.0, 0.0, 0.0))


def after(
    seconds: float, wanted: Motion, *, sink_speed: float, hover_share: float
) -> tuple[TouchDown, bool]:
    touchdown, carried = TouchDown(), False
    for step in range(round(seconds / STEP_S) + 1):
        carried = touchdown.update(step * STEP_S, wanted, sink_speed, hover_share)
    return touchdown, carried


def test_the_ground_carries_what_is_light_and_does_not_sink() -> None:
    assert after(2.0 * HOLD_S, led_down(), sink_speed=0.02, hover_share=LIGHT)[1]


def test_one_instant_is_not_enough() -> None:
    assert not after(0.5 * HOLD_S, led_down(), sink_speed=0.0, hover_share=LIGHT)[1]


@pytest.mark.parametrize(
    ("wanted", "sink_speed", "hover_share"),
    [
        (led_down(), 0.4, LIGHT),  # sinks as it should
        (led_down(), -0.4, LIGHT),  # an updraught, or a bounce
        (led_down(), 0.0, 1.0),  # held by its rotors
        (led_down(0.0), 0.0, LIGHT),  # nobody leads it down
        (led_down(-1.0), 0.0, LIGHT),  # led up
        (led_down(NAN), 0.0, LIGHT),
        (led_down(height_down=-5.0), 0.0, LIGHT),  # a descent to a height, not to the ground
    ],
)
def test_what_flies_does_not_stand(wanted: Motion, sink_speed: float, hover_share: float) -> None:
    assert not after(2.0, wanted, sink_speed=sink_speed, hover_share=hover_share)[1]


def test_a_velocity_within_its_deviation_is_none() -> None:
    touchdown, carried = TouchDown(), False
    for step in range(round(1.0 / STEP_S)):
        carried = touchdown.update(step * STEP_S, led_down(), 0.3, LIGHT, 0.12)
    assert carried
    assert not touchdown.update(1.0, led_down(), 0.5, LIGHT, 0.12)


def test_sinking_after_all_ends_it_at_once() -> None:
    touchdown, carried = after(1.0, led_down(), sink_speed=0.0, hover_share=LIGHT)
    assert carried
    assert not touchdown.update(1.1, led_down(), 0.5, 0.3)
    assert not touchdown.update(1.1 + STEP_S, led_down(), 0.0, 0.3)


def test_settling_leads_down_and_nowhere_else() -> None:
    motion = settle(1.5)
    assert motion.velocity_ned[2] == 1.5
    assert all(math.isnan(axis) for axis in (*motion.position_ned, *motion.velocity_ned[:2]))
    assert motion.acceleration_ned == (0.0, 0.0, 0.0)
