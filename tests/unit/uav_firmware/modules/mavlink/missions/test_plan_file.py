import math
import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.mavlink.missions.mission_items import StoredItem, plan_id
from uav_firmware.modules.mavlink.missions.plan_file import PlanFileError, decode, encode

FLOATS = st.floats(width=32)
INT32 = st.integers(-0x80000000, 0x7FFFFFFF)
ITEMS = st.builds(
    StoredItem,
    frame=st.sampled_from([0, 2, 3, 5, 6]),
    command=st.integers(0, 0xFFFF),
    current=st.booleans(),
    autocontinue=st.integers(0, 1),
    parameters=st.tuples(FLOATS, FLOATS, FLOATS, FLOATS),
    x=INT32,
    y=INT32,
    z=FLOATS,
)
PLANS = st.lists(ITEMS, max_size=6).map(tuple)
TYPES = st.sampled_from([0, 1, 2])
ITEM = StoredItem(6, 16, current=True, autocontinue=1, parameters=(0.0, 2.0, 0.0, math.nan),
                  x=404_434_000, y=-37_382_000, z=10.0)  # fmt: skip


def resealed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


@given(TYPES, PLANS)
def test_a_plan_file_is_read_back_with_the_same_id(
    mission_type: int, plan: tuple[StoredItem, ...]
) -> None:
    back = decode(mission_type, encode(mission_type, plan))
    assert repr(back) == repr(plan)
    assert plan_id(back) == plan_id(plan)


@given(PLANS, st.data())
def test_a_truncated_file_is_not_a_plan(plan: tuple[StoredItem, ...], data: st.DataObject) -> None:
    contents = encode(0, plan)
    length = data.draw(st.integers(0, len(contents) - 1))
    with pytest.raises(PlanFileError):
        decode(0, contents[:length])


@given(PLANS, st.data())
def test_a_flipped_bit_is_detected(plan: tuple[StoredItem, ...], data: st.DataObject) -> None:
    contents = bytearray(encode(0, plan))
    position = data.draw(st.integers(0, len(contents) - 1))
    contents[position] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(PlanFileError):
        decode(0, bytes(contents))


@given(st.binary(max_size=200))
def test_any_bytes_are_decoded_or_refused(contents: bytes) -> None:
    with pytest.raises(PlanFileError):
        decode(0, contents)


@pytest.mark.parametrize(
    ("contents", "reason"),
    [
        (b"", "truncated"),
        (encode(0, [ITEM])[:-5], "truncated"),
        (encode(0, [ITEM])[:-1] + b"\0", "damaged"),
        (encode(1, [ITEM]), "type 1, not 0"),
        (resealed(b"XXXX" + encode(0, [ITEM])[4:-4]), "not a plan"),
        (resealed(b"UAVP\x02" + encode(0, [ITEM])[5:-4]), "version 2"),
    ],
)
def test_the_error_names_the_fault(contents: bytes, reason: str) -> None:
    with pytest.raises(PlanFileError, match=reason):
        decode(0, contents)
