"""Home: where it is set, who may move it, and that it stays on the earth."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.bus import Topic
from uav_firmware.modules.commander.home_position import HomePositionUpdater, home_at, home_here
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.status import HomePosition
from uav_firmware.msg.vectors import Vector3

ORIGIN = (40.44340, -3.73820, 650.0)
NAN = math.nan


def estimate(
    position: Vector3, origin: tuple[float, float, float] = ORIGIN
) -> VehicleLocalPosition:
    return VehicleLocalPosition(
        0,
        position,
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        0.5,
        *origin,
        horizontal_accuracy_m=0.1,
        vertical_accuracy_m=0.1,
        position_valid=True,
        altitude_valid=True,
        velocity_valid=True,
        heading_valid=True,
    )


def keeper() -> tuple[HomePositionUpdater, Topic[HomePosition]]:
    topic: Topic[HomePosition] = Topic()
    return HomePositionUpdater(topic), topic


def local(topic: Topic[HomePosition]) -> Vector3:
    assert topic.value is not None
    return topic.value.position_ned


coordinate = st.floats(-500.0, 500.0)


@given(coordinate, coordinate, st.floats(-50.0, 50.0))
def test_home_here_and_home_at_its_place_are_the_same(
    north: float, east: float, down: float
) -> None:
    here = home_here(0, estimate((north, east, down)))
    assert here is not None
    there = home_at(0, estimate((0.0, 0.0, 0.0)), here[1:4], NAN)
    assert there is not None
    assert there.position_ned == pytest.approx((north, east, down), abs=1e-3)
    assert there.altitude_amsl_m == pytest.approx(650.0 - down)


def test_without_an_origin_there_is_no_home() -> None:
    assert home_here(0, estimate((0.0, 0.0, 0.0), (NAN, NAN, NAN))) is None


def test_home_is_set_once_and_again_at_arming() -> None:
    home, topic = keeper()
    home.update(0, estimate((1.0, 0.0, 0.0)))
    home.update(1, estimate((2.0, 0.0, 0.0)))
    assert local(topic) == (1.0, 0.0, 0.0)
    home.on_arming(2, estimate((3.0, 0.0, 0.0)))
    assert local(topic) == (3.0, 0.0, 0.0)


def test_a_home_set_by_command_lasts_until_disarming() -> None:
    home, topic = keeper()
    home.set(0, estimate((0.0, 0.0, 0.0)), ORIGIN, 1.0)
    home.on_arming(1, estimate((9.0, 0.0, 0.0)))
    assert local(topic) == pytest.approx((0.0, 0.0, 0.0))
    home.on_disarming()
    home.on_arming(2, estimate((9.0, 0.0, 0.0)))
    assert local(topic) == (9.0, 0.0, 0.0)


def test_a_moved_origin_leaves_home_at_its_place_on_the_earth() -> None:
    home, topic = keeper()
    home.update(0, estimate((0.0, 0.0, 0.0)))
    moved = (ORIGIN[0] + 0.0001, ORIGIN[1], ORIGIN[2] + 2.0)
    home.update(1, estimate((0.0, 0.0, 0.0), moved))
    north, _, down = local(topic)
    assert north == pytest.approx(-11.1, abs=0.1)
    assert down == pytest.approx(2.0, abs=1e-3)
    assert topic.value is not None
    assert topic.value[1:4] == pytest.approx(ORIGIN)
