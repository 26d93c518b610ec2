import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, mission_item
from uav_firmware.modules.mavlink.missions.mission_items import (
    ItemFault,
    StoredItem,
    for_navigator,
    plan_id,
    read_item,
    to_message,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink, pack

INT32_MAX = 0x7FFFFFFF
FLOATS = st.floats(width=32, allow_infinity=False)


def stored(**fields: Any) -> StoredItem:
    item = read_item(mission_item(0, **fields))
    assert isinstance(item, StoredItem)
    return item


@given(
    st.sampled_from([0, 2, 3, 5, 6]),
    st.integers(0, 0xFFFF),
    st.lists(FLOATS, min_size=5, max_size=5),
    st.integers(-900_000_000, 900_000_000),
    st.integers(-1_800_000_000, 1_800_000_000),
)
def test_a_download_returns_the_uploaded_bytes(
    frame: int, command: int, floats: list[float], x: int, y: int
) -> None:
    p1, p2, p3, p4, z = floats
    sent = mission_item(
        4, command, frame=frame, param1=p1, param2=p2, param3=p3, param4=p4, x=x, y=y, z=z
    )
    item = read_item(sent)
    assert isinstance(item, StoredItem)
    given_back = to_message(item, 4, current=False, mission_type=0)
    given_back.target_system, given_back.target_component = SYSTEM, 1
    assert pack(given_back) == pack(sent)


@pytest.mark.parametrize(("frame", "datum"), [(0, 0), (5, 0), (3, 3), (6, 3)])
def test_the_navigator_gets_degrees_and_a_datum(frame: int, datum: int) -> None:
    (item,) = for_navigator([stored(frame=frame, x=404_434_000, y=-37_382_000)])
    assert (item.frame, item.x, item.y, item.z) == (datum, 40.4434, -3.7382, 10.0)
    assert math.isnan(item.param4)


def test_an_item_without_a_position_keeps_plain_numbers() -> None:
    (item,) = for_navigator([stored(command=178, frame=2, x=3, y=-4, z=0.0)])
    assert (item.frame, item.x, item.y) == (2, 3.0, -4.0)


@pytest.mark.parametrize("frame", [2, 3, 6])
@pytest.mark.parametrize("unset", [INT32_MAX, -0x80000000])
def test_an_unset_coordinate_is_nan_for_the_navigator(frame: int, unset: int) -> None:
    (item,) = for_navigator([stored(frame=frame, x=unset, y=unset)])
    assert math.isnan(item.x)
    assert math.isnan(item.y)


@pytest.mark.parametrize("frame", [1, 4, 7, 8, 9, 10, 11, 12, 21, 255])
def test_other_frames_are_refused(frame: int) -> None:
    fault = read_item(mission_item(0, frame=frame))
    assert isinstance(fault, ItemFault)
    assert fault.result == mavlink.MAV_MISSION_UNSUPPORTED_FRAME


@pytest.mark.parametrize(
    ("fields", "result"),
    [
        ({"param1": math.inf}, 6),
        ({"param2": -math.inf}, 7),
        ({"param3": math.inf}, 8),
        ({"param4": math.inf}, 9),
        ({"x": 900_000_001}, 10),
        ({"x": -0x80000000 + 1}, 10),
        ({"y": 1_800_000_001}, 11),
        ({"z": math.inf}, 12),
    ],
)
def test_invalid_numbers_are_refused_by_parameter(fields: dict[str, Any], result: int) -> None:
    fault = read_item(mission_item(0, **fields))
    assert isinstance(fault, ItemFault)
    assert fault.result == result


def float_item(**fields: Any) -> Any:
    values = mission_item(0).to_dict() | {"frame": 3, "x": 40.4434, "y": -3.7382} | fields
    del values["mavpackettype"]
    return mavlink.MAVLink_mission_item_message(**values)


def test_the_deprecated_item_has_float_degrees() -> None:
    item = read_item(float_item())
    assert isinstance(item, StoredItem)
    assert (item.x, item.y) == (404_434_000, -37_382_000)


@pytest.mark.parametrize(("x", "result"), [(1e30, 10), (-91.0, 10), (math.inf, 10)])
def test_the_deprecated_item_with_invalid_coordinates_is_refused(x: float, result: int) -> None:
    fault = read_item(float_item(x=x))
    assert isinstance(fault, ItemFault)
    assert fault.result == result


def test_only_an_empty_plan_has_id_0() -> None:
    assert plan_id([]) == 0
    assert plan_id([stored()]) != 0


def test_the_same_plan_has_the_same_id_whatever_its_current_item() -> None:
    plan = [stored(), stored(x=1)]
    assert plan_id(plan) == plan_id([item._replace(current=False) for item in plan])


@pytest.mark.parametrize(
    "change",
    [
        {"frame": 3},
        {"command": 19},
        {"autocontinue": 0},
        {"param1": 1.0},
        {"param4": 0.0},
        {"x": 1},
        {"y": 1},
        {"z": 10.5},
    ],
)
def test_any_change_to_a_plan_changes_its_id(change: dict[str, Any]) -> None:
    assert plan_id([stored(), stored(**change)]) != plan_id([stored(), stored()])


def test_the_id_depends_on_the_order_of_items() -> None:
    one, other = stored(z=1.0), stored(z=2.0)
    assert plan_id([one, other]) != plan_id([other, one])
