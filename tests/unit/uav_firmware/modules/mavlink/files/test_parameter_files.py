import struct
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavftp import MAVFTP

from tests.unit.uav_firmware.modules.mavlink.files.harness import FileHarness
from uav_firmware.modules.mavlink.files.codec import Fault, Opcode
from uav_firmware.modules.mavlink.files.parameter_pack import (
    PackedParameter,
    PackError,
    read_pack,
    write_pack,
)
from uav_firmware.parameters import Registry, param

PACK = "@PARAM/param.pck"
NAMES = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_", min_size=1, max_size=16)
INT32 = st.integers(-0x80000000, 0x7FFFFFFF)
FLOAT32 = st.floats(width=32, allow_nan=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class SomeParams:
    altitude: float = param(
        "MIS_TAKEOFF_ALT", 2.5, unit="m", minimum=0.0, maximum=80.0, short="Height of take-off"
    )
    distance: float = param(
        "MIS_DIST_1WP", 0.1, unit="m", minimum=-1.0, maximum=1e6, short="Far enough"
    )
    action: int = param("NAV_DLL_ACT", 0, unit="-", minimum=0, maximum=6, short="On link loss")
    big: int = param(
        "SYS_BIG", -5_000_000, unit="-", minimum=-0x80000000, maximum=0x7FFFFFFF, short="Big"
    )


@pytest.fixture
def registry() -> Registry:
    made = Registry()
    made.add(SomeParams)
    return made


@pytest.fixture
def harness(tmp_path: Path, registry: Registry) -> FileHarness:
    return FileHarness(tmp_path, registry=registry)


def upload(count: int, records: bytes) -> bytes:
    """An upload as of ground stations: the third number is the length."""
    return struct.pack("<HHH", 0x671B, count, 6 + len(records)) + records


@st.composite
def parameters(draw: st.DrawFn) -> list[PackedParameter]:
    made = []
    for name in sorted(draw(st.sets(NAMES, max_size=30))):
        is_integer = draw(st.booleans())
        value = INT32 if is_integer else FLOAT32
        made.append(PackedParameter(name, draw(value), draw(value), is_integer))
    return made


@given(parameters())
def test_stock_clients_decode_the_packed_messages(packed: list[PackedParameter]) -> None:
    data = write_pack(packed, total=len(packed) + 3, with_defaults=True)
    read = MAVFTP.ftp_param_decode(data)
    assert read is not None
    assert read.params == [(p.name.encode(), p.value, 3 if p.is_integer else 4) for p in packed]
    assert (read.defaults or []) == [
        (p.name.encode(), p.default, 3 if p.is_integer else 4) for p in packed
    ]


@given(parameters(), st.booleans())
def test_a_pack_is_read_back(packed: list[PackedParameter], with_defaults: bool) -> None:
    data = write_pack(packed, total=len(packed), with_defaults=with_defaults)
    assert read_pack(data) == [(p.name, p.value) for p in packed]


@given(st.binary(max_size=60))
def test_an_invalid_pack_is_refused_without_effect(data: bytes) -> None:
    try:
        read_pack(struct.pack("<H", 0x671B) + data)
    except PackError:
        return


def test_the_file_has_every_parameter_with_its_default(
    harness: FileHarness, registry: Registry
) -> None:
    registry.set("MIS_TAKEOFF_ALT", 7.25)
    read = MAVFTP.ftp_param_decode(harness.download(f"{PACK}?withdefaults=1"))
    assert read is not None
    assert [name.decode() for name, _, _ in read.params] == registry.names()
    for name, value, kind in read.params:
        assert value == registry.get(name.decode())
        assert (kind == 3) == registry.declaration(name.decode()).is_integer
    defaults = {name: value for name, value, _ in read.defaults}
    assert (defaults[b"MIS_TAKEOFF_ALT"], defaults[b"SYS_BIG"]) == (2.5, -5_000_000)


def test_a_default_rounded_to_float32_is_not_a_difference(harness: FileHarness) -> None:
    """0.1 is stored with four bytes; rounding alone must not add the default."""
    size = len(harness.download(PACK))
    assert len(harness.download(f"{PACK}?withdefaults=1")) == size


def test_a_part_of_the_list_has_the_total_count(harness: FileHarness, registry: Registry) -> None:
    data = harness.download(f"{PACK}?start=1&count=2")
    assert struct.unpack("<HHH", data[:6]) == (0x671B, 2, 4)
    assert [name for name, _ in read_pack(data)] == registry.names()[1:3]


@pytest.mark.parametrize("query", ["?withdefaults=x", "?start=-1", "?else=1"])
def test_an_invalid_query_is_refused(harness: FileHarness, query: str) -> None:
    answer = harness.request(Opcode.OPEN_FILE_RO, PACK + query)
    assert answer.data == bytes((Fault.FAIL_ERRNO, 22))  # EINVAL


def test_an_open_file_does_not_change(harness: FileHarness, registry: Registry) -> None:
    session = harness.open(PACK)
    before = harness.request(Opcode.READ_FILE, session=session, size=239).data
    registry.set("MIS_TAKEOFF_ALT", 7.25)
    assert harness.request(Opcode.READ_FILE, session=session, size=239).data == before


def test_an_upload_sets_parameters_by_value(harness: FileHarness, registry: Registry) -> None:
    """Clients choose the smallest type that holds a value, also for a float parameter."""
    records = (
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a"  # int8
        b"\x02\xa0NAV_DLL_ACT\x02\x00"  # int16
        b"\x00\x00"  # padding
        b"\x03\x60SYS_BIG" + struct.pack("<i", 77)
    )
    assert harness.upload(PACK, upload(3, records)).acknowledged
    assert registry.get("MIS_TAKEOFF_ALT") == 10.0
    assert registry.get("NAV_DLL_ACT") == 2
    assert registry.get("SYS_BIG") == 77
    assert harness.taken == ["MIS_TAKEOFF_ALT", "NAV_DLL_ACT", "SYS_BIG"]


def test_a_downloaded_parameter_file_can_be_uploaded(
    harness: FileHarness, registry: Registry
) -> None:
    registry.set("MIS_TAKEOFF_ALT", 7.25)
    data = harness.download(f"{PACK}?withdefaults=1")
    registry.set("MIS_TAKEOFF_ALT", 3.0)
    assert harness.upload(PACK, data).acknowledged
    assert registry.get("MIS_TAKEOFF_ALT") == 7.25


@pytest.mark.parametrize(
    "records",
    [
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a" + b"\x01\xa0NAV_DLL_ACT\x09",  # out of range
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a" + b"\x01\x60NO_SUCH\x01",
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a" + b"\x04\xa0NAV_DLL_ACT" + struct.pack("<f", 1.5),
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a" + b"\x04\xb0MIS_DIST_1WP" + struct.pack("<f", float("nan")),
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a" + b"\x09\xa0NAV_DLL_ACT\x01",  # no such type
        b"\x01\xe0MIS_TAKEOFF_ALT\x0a" + b"\x01\xa0NAV_DLL",  # truncated
    ],
)
def test_an_upload_sets_all_values_or_none(
    harness: FileHarness, registry: Registry, records: bytes
) -> None:
    answer = harness.upload(PACK, upload(2, records))
    assert answer.data == bytes((Fault.FAIL_ERRNO, 22))  # EINVAL
    assert registry.changed() == {}
    assert harness.taken == []
    (text,) = harness.status_texts
    assert text.startswith("Parameter file refused: ")


def test_an_upload_closed_by_a_reset_takes_effect_and_an_abandoned_one_does_not(
    harness: FileHarness, registry: Registry
) -> None:
    data = upload(1, b"\x01\xe0MIS_TAKEOFF_ALT\x0a")
    session = harness.open(PACK, Opcode.CREATE_FILE)
    harness.request(Opcode.WRITE_FILE, data, session=session)
    harness.tick(70.0)
    assert registry.changed() == {}
    session = harness.open(PACK, Opcode.CREATE_FILE)
    harness.request(Opcode.WRITE_FILE, data, session=session)
    assert harness.request(Opcode.RESET_SESSIONS).acknowledged
    assert registry.get("MIS_TAKEOFF_ALT") == 10.0


def test_an_upload_is_bounded(harness: FileHarness) -> None:
    session = harness.open(PACK, Opcode.CREATE_FILE)
    answer = harness.request(Opcode.WRITE_FILE, b"x", session=session, offset=1_000_000)
    assert answer.data == bytes((Fault.FAIL_ERRNO, 27))  # EFBIG
