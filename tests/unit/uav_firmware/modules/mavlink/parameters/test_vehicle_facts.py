import struct
from dataclasses import fields
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, Bench
from uav_firmware.modules.mavlink.parameters.vehicle_facts import FACTS, VehicleFacts
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.parameters import Registry

SECOND_US = 1_000_000


def bench() -> Bench:
    registry = Registry()
    registry.add(VehicleFacts)
    return Bench(registry=registry)


def test_every_fact_is_read_only() -> None:
    assert {entry.metadata["parameter"].name for entry in fields(VehicleFacts)} == FACTS


def set_to(name: str, value: int) -> Any:
    carried = struct.unpack("<f", struct.pack("<i", value))[0]
    return mavlink.MAVLink_param_set_message(SYSTEM, 1, name.encode(), carried, 6)


@pytest.mark.parametrize(("value", "error"), [(1, []), (2, [mavlink.MAV_PARAM_ERROR_READ_ONLY])])
def test_a_fact_can_be_confirmed_and_not_changed(value: int, error: list[int]) -> None:
    test = bench()
    test.say(set_to("COM_RC_IN_MODE", value))
    test.run()
    heard = test.hear()
    assert [m.error for m in heard if m.get_type() == "PARAM_ERROR"] == error
    assert [m.param_id for m in heard if m.get_type() == "PARAM_VALUE"] == ["COM_RC_IN_MODE"]
    assert test.registry.get("COM_RC_IN_MODE") == 1
