import math

import pytest

from tests.support.estimates import local_position
from uav_firmware.modules.position_control.controller import Motion
from uav_firmware.modules.position_control.wanted_motion import observable, wants_climb

WANTED = Motion((1.0, 2.0, -3.0), (0.1, 0.2, -0.3), (0.01, 0.02, 0.03))
NAN = float("nan")


def test_with_a_full_estimate_nothing_is_changed() -> None:
    assert observable(WANTED, local_position()) == WANTED


def test_without_position_the_velocity_is_kept() -> None:
    motion = observable(WANTED, local_position(position_valid=False))
    assert math.isnan(motion.position_ned[0])
    assert motion.position_ned[2] == -3.0
    assert motion.velocity_ned == WANTED.velocity_ned


def test_without_velocity_the_vehicle_stays_level() -> None:
    motion = observable(WANTED, local_position(position_valid=False, velocity_valid=False))
    assert math.isnan(motion.velocity_ned[0])
    assert motion.acceleration_ned[:2] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("asked", "accuracy", "sink"),
    [(-0.3, 0.05, 0.5), (NAN, 0.05, 0.5), (1.5, 0.05, 1.5), (0.4, 0.4, 0.8)],
)
def test_without_height_it_comes_down_at_a_speed_that_the_accelerometer_tells(
    asked: float, accuracy: float, sink: float
) -> None:
    wanted = WANTED._replace(velocity_ned=(0.1, 0.2, asked))
    estimate = local_position(altitude_valid=False, sink_accuracy_m_s=accuracy)
    motion = observable(wanted, estimate)
    assert math.isnan(motion.position_ned[2])
    assert motion.velocity_ned[2] == sink
    assert motion.acceleration_ned[2] == 0.0


def test_without_height_and_vertical_velocity_it_sinks_softly() -> None:
    estimate = local_position(altitude_valid=False, sink_accuracy_m_s=1.5)
    motion = observable(WANTED, estimate)
    assert math.isnan(motion.position_ned[2])
    assert math.isnan(motion.velocity_ned[2])
    assert 0.0 < motion.acceleration_ned[2] < 0.5


@pytest.mark.parametrize(
    ("position_down", "velocity_down", "climbs"),
    [(-5.0, 0.0, True), (NAN, -0.5, True), (0.0, 0.0, False), (NAN, 0.7, False), (2.0, NAN, False)],
)
def test_what_counts_as_an_order_to_climb(
    position_down: float, velocity_down: float, climbs: bool
) -> None:
    wanted = Motion((0.0, 0.0, position_down), (0.0, 0.0, velocity_down), (0.0, 0.0, 0.0))
    assert wants_climb(wanted, local_position()) is climbs
