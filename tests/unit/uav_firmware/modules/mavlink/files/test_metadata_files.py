import json
import lzma
import struct
import zlib
from pathlib import Path

import pytest

from tests.support import parameter_table
from tests.unit.uav_firmware.modules.mavlink.files.asking import Desk
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, Bench, command_long
from tests.unit.uav_firmware.modules.mavlink.parameters.test_parameter_server import raw_value
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.parameters import Registry

PLACE = "/etc/extras"


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Registry:
    return parameter_table.autopilot(tmp_path_factory.mktemp("vehicle")).registry


def checksum(data: bytes) -> int:
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def read(desk: Desk, uri: str) -> bytes:
    assert uri.startswith("mftp://")
    return desk.download(uri.removeprefix("mftp://"))


def test_the_general_file_leads_to_every_parameter(tmp_path: Path, registry: Registry) -> None:
    desk = Desk(tmp_path, registry=registry)
    general = json.loads(desk.download(f"{PLACE}/component_general.json"))
    (described,) = general["metadataTypes"]
    packed = read(desk, described["uri"])
    assert described["type"] == 1
    assert described["fileCrc"] == checksum(packed)
    told = json.loads(lzma.decompress(packed))["parameters"]
    assert [each["name"] for each in told] == registry.names()
    for each in told:
        declaration = registry.declaration(each["name"])
        assert each["type"] == ("Int32" if declaration.is_integer else "Float")
        assert each["min"] <= each["default"] <= each["max"]
        assert each["shortDesc"] == declaration.short


def test_who_leaves_out_what_the_metadata_calls_volatile_finds_the_vehicle_s_hash(
    tmp_path: Path,
) -> None:
    """A ground station's cache of parameters, which it keeps only while both hashes agree."""
    registry = parameter_table.autopilot(tmp_path).registry
    registry.set("EKF2_MAG_DECL", 12.5)
    registry.set("MPC_XY_CRUISE", 3.25)
    bench = Bench(registry=registry)
    bench.run(2_000_000)  # Facts that the vehicle looks up after the start are there
    bench.hear()
    bench.say(mavlink.MAVLink_param_request_list_message(SYSTEM, 1))
    bench.run(2_000_000)
    values = {m.param_id.rstrip("\0"): m for m in bench.hear("PARAM_VALUE")}
    desk = Desk(tmp_path, registry=registry)
    packed = read(desk, f"mftp://{PLACE}/parameters.json.xz")
    told = json.loads(lzma.decompress(packed))["parameters"]
    volatile = {each["name"] for each in told if each.get("volatile")}
    assert volatile == {"COM_FAIL_ACK", "EKF2_MAG_DECL"}
    state = 0xFFFFFFFF
    for name in sorted(values.keys() - volatile - {"_HASH_CHECK"}):
        state = zlib.crc32(name.encode() + raw_value(values[name]), state)
    assert raw_value(values["_HASH_CHECK"]) == struct.pack("<I", state ^ 0xFFFFFFFF)


def test_the_files_are_small_enough_for_a_radio(tmp_path: Path, registry: Registry) -> None:
    desk = Desk(tmp_path, registry=registry)
    sizes = [int(entry.split("\t")[1]) for entry in desk.names(PLACE)]
    assert len(sizes) == 2
    assert sum(sizes) < 40_000


def test_the_message_names_the_general_file_and_its_checksum(tmp_path: Path) -> None:
    bench = Bench()
    (message,) = bench.ask(command_long(512, 397.0), "COMPONENT_METADATA")
    desk = Desk(tmp_path, registry=bench.registry)
    assert message.file_crc == checksum(read(desk, message.uri.decode()))
    assert bench.ask(command_long(512, 397.0, 0, 0, 0, 0, 0, 7.0), "COMPONENT_METADATA") == []
