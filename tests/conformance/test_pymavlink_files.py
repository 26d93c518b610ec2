"""pymavlink's file client, which MAVProxy and scripts use, against the autopilot process."""

import random
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import development as mavlink
from pymavlink.mavftp import MAVFTP, FtpError

from tests.conformance.ground_station import vehicle_process
from tests.support.system import free_ports

pytestmark = pytest.mark.scenario

SYSTEM = 5
CARD = "/fs/microsd"
PATIENCE_S = 120.0


class Client(NamedTuple):
    """The client, its connection and the vehicle's folder."""

    ftp: Any
    link: Any
    folder: Path


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    own, broker, ground = free_ports(3)
    state = tmp_path_factory.mktemp("vehicle")
    with vehicle_process(SYSTEM, 1, (own, broker, ground), state):
        link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{ground}", source_system=255)
        assert link.wait_heartbeat(timeout=PATIENCE_S) is not None
        ftp = MAVFTP(link, SYSTEM, 1)
        # It takes silence for the end; a busy machine may be silent for a while.
        ftp.ftp_settings.idle_detection_time = 4.5
        yield Client(ftp, link, state / f"vehicle-{SYSTEM}")
        link.close()


def get(client: Client, remote: str, local: Path) -> int:
    client.ftp.cmd_get([remote, str(local)])
    return int(client.ftp.process_ftp_reply("get", timeout=PATIENCE_S).error_code)


def put(client: Client, local: Path, remote: str) -> int:
    client.ftp.cmd_put([str(local), remote])
    return int(client.ftp.process_ftp_reply("put", timeout=PATIENCE_S).error_code)


def asked(client: Client, ask: Callable[[], None], kind: str, condition: str | None = None) -> Any:
    """Ask until there is an answer: a busy machine drops datagrams."""
    for _ in range(30):
        ask()
        answer = client.link.recv_match(type=kind, condition=condition, blocking=True, timeout=4)
        if answer is not None:
            return answer
    raise AssertionError(f"no {kind}")


@pytest.mark.parametrize("burst_size", [80, 239])
@pytest.mark.parametrize("blocks", [0, 3, 400])
def test_an_uploaded_file_can_be_downloaded(
    client: Client, tmp_path: Path, burst_size: int, blocks: int
) -> None:
    client.ftp.ftp_settings.burst_read_size = burst_size
    local, back = tmp_path / "local", tmp_path / "back"
    local.write_bytes(random.Random(blocks).randbytes(burst_size * blocks + 1))
    assert put(client, local, f"{CARD}/file.bin") == FtpError.Success
    assert get(client, f"{CARD}/file.bin", back) == FtpError.Success
    assert back.read_bytes() == local.read_bytes()


def test_the_tree_can_be_walked(client: Client) -> None:
    (client.folder / "image").mkdir(exist_ok=True)
    (client.folder / "image" / "1.jpg").write_bytes(b"picture")
    listed = client.ftp.cmd_list(["/"]).directory_listing
    assert [(e.name, e.is_dir) for e in listed] == [
        ("@MAV_LOG", True),
        ("@PARAM", True),
        ("etc", True),
        ("fs", True),
    ]
    images = client.ftp.cmd_list([f"{CARD}/image"]).directory_listing
    assert [(e.name, e.is_dir, e.size_b) for e in images] == [("1.jpg", False, 7)]


def test_the_checksum_agrees(client: Client, caplog: pytest.LogCaptureFixture) -> None:
    contents = random.Random(7).randbytes(300_000)
    (client.folder / "files" / "sum.bin").write_bytes(contents)
    with caplog.at_level("INFO"):
        assert client.ftp.cmd_crc([f"{CARD}/sum.bin"]).error_code == FtpError.Success
    assert f"0x{zlib.crc32(contents, 0xFFFFFFFF) ^ 0xFFFFFFFF:08x}" in caplog.text


def test_the_parameter_file_equals_the_parameter_stream(client: Client, tmp_path: Path) -> None:
    streamed: dict[str, float] = {}
    count = 1

    def ask() -> None:
        client.link.mav.param_request_list_send(SYSTEM, 1)

    message = asked(client, ask, "PARAM_VALUE")
    while len(streamed) < count:
        if message is None:
            message = asked(client, ask, "PARAM_VALUE")
        if message.param_id != "_HASH_CHECK":
            count = message.param_count
            raw = struct.pack("<f", message.param_value)
            is_integer = message.param_type == mavlink.MAV_PARAM_TYPE_INT32
            (streamed[message.param_id],) = struct.unpack("<i" if is_integer else "<f", raw)
        message = client.link.recv_match(type="PARAM_VALUE", blocking=True, timeout=4)
    local = tmp_path / "param.pck"
    assert get(client, "@PARAM/param.pck?withdefaults=1", local) == FtpError.Success
    read = MAVFTP.ftp_param_decode(local.read_bytes())
    assert read is not None
    assert {name.decode(): value for name, value, _ in read.params} == streamed


def test_a_parameter_file_that_is_put_takes_effect(client: Client, tmp_path: Path) -> None:
    record = b"\x01\xe0MIS_TAKEOFF_ALT\x0b"
    local = tmp_path / "upload"
    local.write_bytes(struct.pack("<HHH", 0x671B, 1, 6 + len(record)) + record)
    assert put(client, local, "@PARAM/param.pck") == FtpError.Success
    message = asked(
        client,
        lambda: client.link.mav.param_request_read_send(SYSTEM, 1, b"MIS_TAKEOFF_ALT", -1),
        "PARAM_VALUE",
        "PARAM_VALUE.param_id=='MIS_TAKEOFF_ALT'",
    )
    assert message.param_value == 11.0


def test_the_vehicle_reports_that_it_serves_files(client: Client) -> None:
    message = asked(
        client,
        lambda: client.link.mav.command_long_send(SYSTEM, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0),
        "AUTOPILOT_VERSION",
    )
    assert message.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_FTP
