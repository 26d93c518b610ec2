import json
import lzma
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest

from tests.support import parameter_table
from tests.unit.uav_firmware.modules.mavlink.commands.test_parameter_server import raw_value
from tests.unit.uav_firmware.modules.mavlink.files.harness import FileHarness
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, MavlinkHarness, command_long
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.parameters import Registry

PLACE = "/etc/extras"


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Registry:
    return parameter_table.autopilot(tmp_path_factory.mktemp("vehicle")).registry


def checksum(data: bytes) -> int:
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def read(harness: FileHarness, uri: str) -> bytes:
    assert uri.startswith("mftp://")
    return harness.download(uri.removeprefix("mftp://"))


def test_the_general_file_refers_to_every_parameter(tmp_path: Path, registry: Registry) -> None:
    harness = FileHarness(tmp_path, registry=registry)
    general = json.loads(harness.download(f"{PLACE}/component_general.json"))
    (described,) = general["metadataTypes"]
    packed = read(harness, described["uri"])
    assert described["type"] == 1
    assert described["fileCrc"] == checksum(packed)
    reported = json.loads(lzma.decompress(packed))["parameters"]
    assert [each["name"] for each in reported] == registry.names()
    for each in reported:
        declaration = registry.declaration(each["name"])
        assert each["type"] == ("Int32" if declaration.is_integer else "Float")
        assert each["min"] <= each["default"] <= each["max"]
        assert each["shortDesc"] == declaration.short


def described(tmp_path: Path, registry: Registry) -> dict[str, dict[str, Any]]:
    packed = read(FileHarness(tmp_path, registry=registry), f"mftp://{PLACE}/parameters.json.xz")
    return {each["name"]: each for each in json.loads(lzma.decompress(packed))["parameters"]}


@pytest.mark.parametrize(
    "name", ["GF_ACTION", "COM_LOW_BAT_ACT", "NAV_RCL_ACT", "NAV_DLL_ACT", "SDLOG_MODE"]
)
def test_the_choices_of_the_safety_page_have_names(
    name: str, tmp_path: Path, registry: Registry
) -> None:
    """QGroundControl's SafetyComponent.qml offers the named values alone (Fact::enumIndex)."""
    choices = {
        each["value"]: each["description"] for each in described(tmp_path, registry)[name]["values"]
    }
    assert registry.get(name) in choices
    assert len(set(choices.values())) == len(choices) > 3
    assert choices == registry.declaration(name).values


def test_named_values_and_bits_can_be_set(tmp_path: Path, registry: Registry) -> None:
    parameters = described(tmp_path, registry)
    for each in parameters.values():
        named = [entry["value"] for entry in each.get("values", ())]
        assert all(each["min"] <= value <= each["max"] for value in named)
        assert not named or each["default"] in named
    masks = {name: each["bitmask"] for name, each in parameters.items() if "bitmask" in each}
    assert {"index": 2, "description": "offboard"} in masks["COM_RCL_EXCEPT"]
    for name, bits in masks.items():
        assert sum(1 << bit["index"] for bit in bits) == parameters[name]["max"]


def test_what_is_read_at_the_start_asks_for_a_restart(tmp_path: Path, registry: Registry) -> None:
    """QGroundControl's parameter editor says so beside the value (rebootRequired)."""
    parameters = described(tmp_path, registry)
    restart = {name for name, each in parameters.items() if each.get("rebootRequired")}
    assert restart >= {"MAV_0_MODE", "MAV_1_MODE"}
    assert "MPC_XY_VEL_MAX" not in restart


def test_every_number_is_shown_with_three_digits(tmp_path: Path, registry: Registry) -> None:
    """A ground station shows, and may write back, three decimal places where none are declared."""
    parameters = described(tmp_path, registry)
    assert parameters["MC_ROLLRATE_D"]["decimalPlaces"] == 5
    assert "decimalPlaces" not in parameters["MPC_XY_VEL_MAX"]
    for each in parameters.values():
        if each["type"] == "Float" and each["default"]:
            shown = round(each["default"], each.get("decimalPlaces", 3))
            assert shown == pytest.approx(each["default"], rel=0.005), each["name"]


def test_the_hash_without_volatile_parameters_is_that_of_the_vehicle(
    tmp_path: Path,
) -> None:
    """A ground station uses its cache of parameters only while both hashes agree."""
    registry = parameter_table.autopilot(tmp_path).registry
    registry.set("EKF2_MAG_DECL", 12.5)
    registry.set("MPC_XY_CRUISE", 3.25)
    harness = MavlinkHarness(registry=registry)
    harness.run(2_000_000)  # Values that are set after the start are present
    harness.received()
    harness.send(mavlink.MAVLink_param_request_list_message(SYSTEM, 1))
    harness.run(2_000_000)
    values = {m.param_id.rstrip("\0"): m for m in harness.received("PARAM_VALUE")}
    files = FileHarness(tmp_path, registry=registry)
    packed = read(files, f"mftp://{PLACE}/parameters.json.xz")
    reported = json.loads(lzma.decompress(packed))["parameters"]
    volatile = {each["name"] for each in reported if each.get("volatile")}
    assert volatile == {"COM_FAIL_ACK", "EKF2_MAG_DECL"}
    state = 0xFFFFFFFF
    for name in sorted(values.keys() - volatile - {"_HASH_CHECK"}):
        state = zlib.crc32(name.encode() + raw_value(values[name]), state)
    assert raw_value(values["_HASH_CHECK"]) == struct.pack("<I", state ^ 0xFFFFFFFF)


def test_the_files_are_small_enough_for_a_radio(tmp_path: Path, registry: Registry) -> None:
    harness = FileHarness(tmp_path, registry=registry)
    sizes = [int(entry.split("\t")[1]) for entry in harness.names(PLACE)]
    assert len(sizes) == 2
    assert sum(sizes) < 40_000


def test_the_message_names_the_general_file_and_its_checksum(tmp_path: Path) -> None:
    harness = MavlinkHarness()
    (message,) = harness.request(command_long(512, 397.0), "COMPONENT_METADATA")
    files = FileHarness(tmp_path, registry=harness.registry)
    assert message.file_crc == checksum(read(files, message.uri.decode()))
    assert harness.request(command_long(512, 397.0, 0, 0, 0, 0, 0, 7.0), "COMPONENT_METADATA") == []
