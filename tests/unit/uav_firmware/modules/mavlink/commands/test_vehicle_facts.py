import struct
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, TICK_US, MavlinkHarness
from uav_firmware.modules.mavlink.commands.parameter_server import REFUSED_VALUE_AFTER_US
from uav_firmware.modules.mavlink.commands.vehicle_facts import vehicle_facts
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.parameters import ParameterRangeError, Registry

INT32, REAL32, READ_ONLY = 6, 9, mavlink.MAV_PARAM_ERROR_READ_ONLY


def facts(system_id: int = SYSTEM, compasses: int = 1) -> Registry:
    registry = Registry()
    registry.declare(vehicle_facts(system_id, compasses))
    return registry


@pytest.mark.parametrize("compasses", [0, 1, 2, 3])
def test_each_compass_has_an_id_and_no_other(compasses: int) -> None:
    registry = facts(compasses=compasses)
    ids = [registry.get(f"CAL_MAG{instance}_ID") for instance in range(3)]
    assert [number != 0 for number in ids] == [instance < compasses for instance in range(3)]
    assert len(set(ids[:compasses])) == compasses


@pytest.mark.parametrize("system_id", [1, 7, 255])
def test_the_system_id_is_that_of_the_vehicle_and_stays_so(system_id: int) -> None:
    registry = facts(system_id)
    registry.reset()
    assert registry.get("MAV_SYS_ID") == system_id
    assert registry.changed() == {}


def test_no_fact_can_be_changed() -> None:
    registry = facts()
    for name in registry.names():
        value = registry.get(name)
        registry.set(name, value)
        with pytest.raises(ParameterRangeError, match=name):
            registry.set(name, value + 1)


def set_to(name: str, value: float, kind: int) -> Any:
    raw = struct.unpack("<f", struct.pack("<i", int(value)))[0] if kind == INT32 else value
    return mavlink.MAVLink_param_set_message(SYSTEM, 1, name.encode(), raw, kind)


def test_an_attempt_to_change_one_is_answered_as_read_only() -> None:
    registry = facts()
    for name in registry.names():
        kind = INT32 if registry.declaration(name).is_integer else REAL32
        for change, errors in ((0, []), (1, [READ_ONLY])):
            test = MavlinkHarness(registry=facts())
            test.send(set_to(name, registry.get(name) + change, kind))
            test.run(REFUSED_VALUE_AFTER_US + TICK_US)
            received = test.received()
            assert [m.error for m in received if m.get_type() == "PARAM_ERROR"] == errors, name
            (value,) = [m for m in received if m.get_type() == "PARAM_VALUE"]
            assert value.param_id == name


def test_a_fact_with_named_values_has_one_of_them() -> None:
    registry = facts()
    named = [registry.declaration(name) for name in registry.names()]
    assert all(d.default in d.values for d in named if d.values)
