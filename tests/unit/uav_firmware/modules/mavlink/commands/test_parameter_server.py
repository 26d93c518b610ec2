import math
import struct
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    SYSTEM,
    TICK_US,
    MavlinkHarness,
)
from uav_firmware.modules.mavlink.commands.parameter_server import REFUSED_VALUE_AFTER_US
from uav_firmware.modules.mavlink.commands.vehicle_facts import vehicle_facts
from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack
from uav_firmware.parameters import Registry, param

INT32, REAL32, UINT32 = 6, 9, 5
DOES_NOT_EXIST, OUT_OF_RANGE, PERMISSION_DENIED, TYPE_MISMATCH = 1, 2, 3, 7
SECOND_US = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SomeParams:
    altitude: float = param(
        "MIS_TAKEOFF_ALT", 2.5, unit="m", minimum=0.0, maximum=80.0, short="Height of take-off"
    )
    action: int = param(
        "NAV_DLL_ACT", 0, unit="-", minimum=-0x80000000, maximum=0x7FFFFFFF, short="On link loss"
    )
    full_name: float = param(
        "ABCDEFGHIJKLMNOP", 1.0, unit="-", minimum=-1e30, maximum=1e30, short="Sixteen letters"
    )
    flown: int = param(
        "LND_FLIGHT_T_LO",
        0,
        unit="-",
        minimum=0,
        maximum=0x7FFFFFFF,
        short="Changes by itself",
        volatile=True,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LockedParams:
    rotor: float = param(
        "CA_ROTOR0_PX", 0.1, unit="m", minimum=-1.0, maximum=1.0, short="Place",
        locked_while_armed=True,
    )  # fmt: skip


def registry() -> Registry:
    made = Registry()
    made.add(SomeParams)
    return made


def harness(**options: Any) -> MavlinkHarness:
    return MavlinkHarness(registry=registry(), **options)


def request_list(**target: int) -> Any:
    system = target.get("target_system", SYSTEM)
    return mavlink.MAVLink_param_request_list_message(system, 1)


def read(name: bytes, index: int = -1) -> Any:
    return mavlink.MAVLink_param_request_read_message(SYSTEM, 1, name, index)


def write(name: bytes, raw: bytes, kind: int) -> Any:
    (value,) = struct.unpack("<f", raw)
    return mavlink.MAVLink_param_set_message(SYSTEM, 1, name, value, kind)


def real(value: float) -> bytes:
    return struct.pack("<f", value)


def say_raw(test: MavlinkHarness, name: bytes, raw: bytes, kind: int) -> None:
    """Send a PARAM_SET whose value field has exactly these four bytes."""
    payload = pack(write(name, real(1.0), kind))
    datagram = frame(payload._replace(body=raw + payload.body[4:]), 0, 255, 190)
    test.memory.incoming.append((datagram, ("192.0.2.2", 14550)))


def raw_value(message: Any) -> bytes:
    return bytes(message.get_msgbuf()[10:14])


def test_the_list_begins_with_the_hash_and_has_every_parameter_once() -> None:
    test = harness()
    test.send(request_list())
    test.run(SECOND_US)
    first, *rest = test.received("PARAM_VALUE")
    assert (first.param_id, first.param_type, first.param_index) == ("_HASH_CHECK", UINT32, 0xFFFF)
    assert [m.param_id for m in rest] == test.registry.names()
    assert [m.param_index for m in rest] == [0, 1, 2, 3]
    assert {m.param_count for m in rest} == {4}
    assert {m.param_type for m in rest} == {INT32, REAL32}
    assert test.received("PARAM_VALUE", at=BROKER) == []


def raw_crc32(data: bytes) -> int:
    """CRC32 bit by bit as PX4 computes it: polynomial 0xEDB88320, from 0, no inversion."""
    state = 0
    for byte in data:
        state ^= byte
        for _ in range(8):
            state = state >> 1 ^ (0xEDB88320 if state & 1 else 0)
    return state


@given(st.floats(0.0, 80.0), st.integers(-0x80000000, 0x7FFFFFFF))
def test_the_hash_is_that_of_names_and_values_without_the_volatile_ones(
    altitude: float, action: int
) -> None:
    test = harness()
    test.registry.set("MIS_TAKEOFF_ALT", altitude)
    test.registry.set("NAV_DLL_ACT", action)
    test.registry.set("LND_FLIGHT_T_LO", 77)
    (message,) = test.request(read(b"_HASH_CHECK"), "PARAM_VALUE")
    covered = (
        b"ABCDEFGHIJKLMNOP" + real(1.0) + b"MIS_TAKEOFF_ALT" + real(altitude)
        + b"NAV_DLL_ACT" + struct.pack("<i", action)
    )  # fmt: skip
    assert raw_value(message) == struct.pack("<I", raw_crc32(covered))


def test_a_ground_station_that_knows_the_hash_stops_the_list() -> None:
    made = Registry()
    made.add(SomeParams)
    test = MavlinkHarness(registry=made)
    test.send(request_list())
    test.run()
    (first,) = test.received("PARAM_VALUE")
    test.send(write(b"_HASH_CHECK", real(first.param_value), UINT32))
    test.run(SECOND_US)
    assert len(test.received("PARAM_VALUE")) <= 2


def test_a_second_request_restarts_the_list() -> None:
    test = harness()
    test.send(request_list())
    test.run(8_000)
    test.send(request_list())
    test.received()
    test.run(SECOND_US)
    assert [m.param_index for m in test.received("PARAM_VALUE")] == [0xFFFF, 0, 1, 2, 3]


def test_a_value_is_read_by_name_and_by_index() -> None:
    test = harness()
    (by_name,) = test.request(read(b"MIS_TAKEOFF_ALT"), "PARAM_VALUE")
    (by_index,) = test.request(read(b"", by_name.param_index), "PARAM_VALUE")
    assert by_name.to_dict() == by_index.to_dict()
    assert by_name.param_value == 2.5
    (longest,) = test.request(read(b"ABCDEFGHIJKLMNOP"), "PARAM_VALUE")
    assert longest.param_id == "ABCDEFGHIJKLMNOP"


@pytest.mark.parametrize(("name", "index"), [(b"NOT_THERE", -1), (b"", 4), (b"", -2), (b"", 32767)])
def test_unknown_parameters_are_an_error(name: bytes, index: int) -> None:
    test = harness()
    (error,) = test.request(read(name, index), "PARAM_ERROR")
    assert error.error == DOES_NOT_EXIST
    assert test.received("PARAM_VALUE") == []


@given(st.integers(-0x80000000, 0x7FFFFFFF))
def test_an_integer_is_set_and_returned_bit_for_bit(value: int) -> None:
    test = harness()
    raw = struct.pack("<i", value)
    say_raw(test, b"NAV_DLL_ACT", raw, INT32)
    test.run()
    assert test.registry.get("NAV_DLL_ACT") == value
    (reported,) = test.received("PARAM_VALUE")
    assert raw_value(reported) == raw
    assert test.received("PARAM_ERROR") == []


@given(st.integers(-0x1000000, 0x1000000))
def test_an_integer_as_a_real_sets_an_integer(value: int) -> None:
    test = harness()
    say_raw(test, b"NAV_DLL_ACT", real(value), REAL32)
    test.run()
    assert test.registry.get("NAV_DLL_ACT") == value
    (reported,) = test.received("PARAM_VALUE")
    assert (raw_value(reported), reported.param_type) == (struct.pack("<i", value), INT32)


@pytest.mark.parametrize("raw", [real(2.5), real(math.nan), real(math.inf), struct.pack("<i", 5)])
def test_a_fractional_real_does_not_set_an_integer(raw: bytes) -> None:
    test = harness()
    before = test.registry.get("NAV_DLL_ACT")
    say_raw(test, b"NAV_DLL_ACT", raw, REAL32)
    test.run()
    assert [m.error for m in test.received("PARAM_ERROR")] == [TYPE_MISMATCH]
    assert test.registry.get("NAV_DLL_ACT") == before


def test_a_change_is_sent_to_every_peer_and_saved() -> None:
    saved: list[float | int] = []
    made = registry()
    test = MavlinkHarness(registry=made, save=lambda: saved.append(made.get("MIS_TAKEOFF_ALT")))
    test.send(write(b"MIS_TAKEOFF_ALT", real(7.5), REAL32))
    test.run()
    assert [m.param_value for m in test.received("PARAM_VALUE")] == [7.5]
    assert [m.param_value for m in test.received("PARAM_VALUE", at=BROKER)] == [7.5]
    assert saved == [7.5]


@pytest.mark.parametrize(
    ("raw", "kind", "error"),
    [
        (real(81.0), REAL32, OUT_OF_RANGE),
        (real(-0.1), REAL32, OUT_OF_RANGE),
        (real(math.nan), REAL32, OUT_OF_RANGE),
        (real(math.inf), REAL32, OUT_OF_RANGE),
        (struct.pack("<i", 5), INT32, TYPE_MISMATCH),
        (real(5.0), 10, TYPE_MISMATCH),
        (real(5.0), 0, TYPE_MISMATCH),
    ],
)
def test_an_invalid_value_changes_nothing_and_is_answered_with_the_current_one(
    raw: bytes, kind: int, error: int
) -> None:
    saved: list[bool] = []
    test = MavlinkHarness(registry=registry(), save=lambda: saved.append(True))
    say_raw(test, b"MIS_TAKEOFF_ALT", raw, kind)
    test.run(REFUSED_VALUE_AFTER_US + TICK_US)
    received = test.received()
    assert [m.param_value for m in received if m.get_type() == "PARAM_VALUE"] == [2.5]
    assert [m.error for m in received if m.get_type() == "PARAM_ERROR"] == [error]
    assert saved == []


def answers(test: MavlinkHarness, run_us: int) -> list[str | float]:
    """Names of errors, and values of parameters, that a peer is sent in a time."""
    test.run(run_us)
    return [
        m.param_id if m.get_type() == "PARAM_ERROR" else m.param_value
        for m in test.received()
        if m.get_type() in {"PARAM_ERROR", "PARAM_VALUE"}
    ]


def test_the_value_that_stays_comes_when_the_client_has_ended_the_request() -> None:
    """A value that comes during its next request would be an answer to that for MAVSDK."""
    test, name = harness(), "MIS_TAKEOFF_ALT"
    say_raw(test, name.encode(), real(81.0), REAL32)
    assert answers(test, TICK_US) == [name]
    assert answers(test, REFUSED_VALUE_AFTER_US - 2 * TICK_US) == []
    assert answers(test, 2 * TICK_US) == [2.5]
    assert answers(test, SECOND_US) == []


@pytest.mark.parametrize("value", [82.0, 7.5])
def test_each_request_for_a_refused_parameter_gets_one_answer(value: float) -> None:
    test, name = harness(), "MIS_TAKEOFF_ALT"
    say_raw(test, name.encode(), real(81.0), REAL32)
    assert answers(test, TICK_US) == [name]
    say_raw(test, name.encode(), real(value), REAL32)
    is_refused = value > 80.0
    assert answers(test, REFUSED_VALUE_AFTER_US) == [name if is_refused else value]
    assert answers(test, SECOND_US) == ([2.5] if is_refused else [])


def test_a_refused_parameter_that_is_read_is_sent_once() -> None:
    test, name = harness(), "MIS_TAKEOFF_ALT"
    say_raw(test, name.encode(), real(81.0), REAL32)
    assert answers(test, TICK_US) == [name]
    test.send(read(name.encode()))
    assert answers(test, SECOND_US) == [2.5]


def test_an_unknown_name_cannot_be_set() -> None:
    test = harness()
    (error,) = test.request(write(b"NOT_THERE", real(1.0), REAL32), "PARAM_ERROR")
    assert (error.error, error.param_id) == (DOES_NOT_EXIST, "NOT_THERE")


def test_a_change_that_cannot_be_saved_applies_and_is_reported() -> None:
    def refuse() -> None:
        raise OSError(28, "No space left on device")

    test = MavlinkHarness(registry=registry(), save=refuse)
    test.send(write(b"MIS_TAKEOFF_ALT", real(7.5), REAL32))
    test.run()
    received = test.received()
    assert [m.param_value for m in received if m.get_type() == "PARAM_VALUE"] == [7.5]
    assert "No space left" in "".join(m.text for m in received if m.get_type() == "STATUSTEXT")


def test_requests_for_another_system_are_ignored() -> None:
    test = harness()
    assert test.request(request_list(target_system=SYSTEM + 1), "PARAM_VALUE") == []


def test_a_long_list_is_rate_limited_and_telemetry_continues() -> None:
    many = type(
        "Many",
        (),
        {"__annotations__": {}},
    )
    fields = {
        f"p{i}": param(f"TEST_{i:04d}", 0.5, unit="-", minimum=0.0, maximum=1.0, short="x")
        for i in range(1000)
    }
    group = type("Group", (many,), {"__annotations__": dict.fromkeys(fields, float), **fields})
    made = Registry()
    made.add(dataclass(frozen=True)(group))
    test = MavlinkHarness(registry=made)
    test.send(request_list())
    test.run(SECOND_US)
    received = test.received()
    assert 900 <= sum(m.get_type() == "PARAM_VALUE" for m in received) <= 1001
    assert sum(m.get_type() == "ATTITUDE" for m in received) >= 14
    test.run(SECOND_US // 4)
    reported = [m.param_index for m in test.received("PARAM_VALUE")]
    assert reported[-1] == 999


def test_a_locked_parameter_is_answered_with_permission_denied() -> None:
    test = harness()
    test.registry.add(LockedParams)
    test.registry.armed = True
    say_raw(test, b"CA_ROTOR0_PX", real(0.5), REAL32)
    test.run(SECOND_US // 10)
    (error,) = test.received("PARAM_ERROR")
    assert (error.param_id, error.error) == ("CA_ROTOR0_PX", PERMISSION_DENIED)
    assert test.registry.get("CA_ROTOR0_PX") == pytest.approx(0.1)


def test_a_value_that_the_vehicle_changes_itself_is_announced() -> None:
    test = harness()
    test.registry.set("NAV_DLL_ACT", 1)
    test.registry.put_back("NAV_DLL_ACT")
    test.run(SECOND_US // 10)
    (value,) = test.received("PARAM_VALUE")
    assert (value.param_id, raw_value(value)) == ("NAV_DLL_ACT", bytes(4))


def bench_with_facts() -> MavlinkHarness:
    registry = Registry()
    registry.declare(vehicle_facts(SYSTEM, compasses=1))
    return MavlinkHarness(registry=registry)


def set_to(name: str, value: int) -> Any:
    carried = struct.unpack("<f", struct.pack("<i", value))[0]
    return mavlink.MAVLink_param_set_message(SYSTEM, 1, name.encode(), carried, 6)


@pytest.mark.parametrize(("value", "error"), [(1, []), (2, [mavlink.MAV_PARAM_ERROR_READ_ONLY])])
def test_a_read_only_parameter_accepts_only_its_value(value: int, error: list[int]) -> None:
    test = bench_with_facts()
    test.send(set_to("COM_RC_IN_MODE", value))
    test.run(REFUSED_VALUE_AFTER_US + TICK_US)
    received = test.received()
    assert [m.error for m in received if m.get_type() == "PARAM_ERROR"] == error
    assert [m.param_id for m in received if m.get_type() == "PARAM_VALUE"] == ["COM_RC_IN_MODE"]
    assert test.registry.get("COM_RC_IN_MODE") == 1
