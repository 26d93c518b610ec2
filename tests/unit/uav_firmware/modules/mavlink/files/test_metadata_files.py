import json
import lzma
import struct
import zlib
from pathlib import Path

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
