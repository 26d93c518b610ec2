"""Pages of the journal: what is written is read again, and nothing else is believed."""

import hashlib
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.borrowed_config import ExchangedPlan
from mavlink_broker.microservices.borrowed_parameters import Borrowed
from mavlink_broker.microservices.plan_kinds import FENCE, RALLY
from mavlink_broker.recovery.encoding import LARGEST_BYTES, PageError, decode, encode
from mavlink_broker.recovery.record import NOTHING, AbortNote, Homeward, LiveNote, Memo, Owner, Pose

OWNER = Owner(1, "0123456789abcdef")
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
SINGLES = st.floats(allow_nan=False, allow_infinity=False, width=32)
ITEMS = st.builds(
    MissionItem,
    command=st.integers(0, 2**16 - 1),
    frame=st.integers(0, 255),
    parameters=st.tuples(SINGLES, SINGLES, SINGLES, SINGLES),
    latitude_deg=st.floats(-90, 90),
    longitude_deg=st.floats(-180, 180),
    altitude_m=SINGLES,
    fifth=st.integers(-(2**31), 2**31 - 1),
)
PLANS = st.builds(
    ExchangedPlan,
    before=st.lists(ITEMS, max_size=4).map(tuple),
    placed=st.none() | st.lists(ITEMS, max_size=4).map(tuple),
)
VALUES = st.dictionaries(
    st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=16),
    st.builds(Borrowed, before=NUMBERS, placed=st.lists(NUMBERS, max_size=8).map(tuple)),
    max_size=4,
)
POSES = st.builds(Pose, st.floats(-90, 90), st.floats(-180, 180), NUMBERS, NUMBERS)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
MEMOS = st.builds(
    Memo,
    plans=st.dictionaries(st.sampled_from([FENCE, RALLY]), PLANS),
    values=VALUES,
    borrowed=VALUES,
    hover=st.none() | POSES,
    homeward=st.none() | st.builds(Homeward, mission=TEXTS, reason=TEXTS),
    abort=st.none()
    | st.builds(
        AbortNote,
        work_id=st.integers(0, 2**31 - 1),
        event_type=st.sampled_from([1, 2]),
        point=st.none() | POSES,
        noted_s=st.none() | NUMBERS,
    ),
    started=st.none() | TEXTS,
    live=st.none()
    | st.builds(
        LiveNote,
        name=TEXTS,
        is_agreed=st.booleans(),
        began_s=st.none() | NUMBERS,
        going_s=st.none() | NUMBERS,
        start=st.none() | POSES,
        steps=st.integers(0, 1000),
    ),
)
OWNERS = st.builds(Owner, st.integers(1, 255), st.text("0123456789abcdef", max_size=36))
PAGE = encode(OWNER, Memo(borrowed={"FLW_TGT_HT": Borrowed(8.0, (10.0,))}))


def page_of(body: object, version: int = 1) -> bytes:
    """A page with the right checksum, whatever stands in it."""
    text = body if isinstance(body, bytes) else json.dumps(body).encode()
    return f"farm-journal {version} {hashlib.sha256(text).hexdigest()}\n".encode() + text


@settings(max_examples=50)
@given(owner=OWNERS, memo=MEMOS)
def test_what_is_written_is_read_again(owner: Owner, memo: Memo) -> None:
    assert decode(encode(owner, memo)) == (owner, memo)


@given(cut=st.integers(0, len(PAGE) - 1))
def test_a_beginning_of_a_page_is_none(cut: int) -> None:
    with pytest.raises(PageError):
        decode(PAGE[:cut])


@given(place=st.integers(0, len(PAGE) - 1), flip=st.integers(1, 255))
def test_a_page_of_which_one_byte_was_changed_is_none(place: int, flip: int) -> None:
    changed = bytearray(PAGE)
    changed[place] ^= flip
    with pytest.raises(PageError):
        decode(bytes(changed))


@given(data=st.binary())
def test_any_bytes_are_judged(data: bytes) -> None:
    with pytest.raises(PageError):
        decode(data)


@settings(max_examples=40)
@given(
    data=st.binary() | st.recursive(st.none() | NUMBERS, st.lists).map(json.dumps).map(str.encode)
)
def test_any_content_with_a_right_checksum_is_judged(data: bytes) -> None:
    with pytest.raises(PageError):
        decode(page_of(data))


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ({"system": 0, "uid": ""}, "system"),
        ({"system": 1, "uid": "../../etc"}, "uid"),
        ({"system": 1, "uid": "", "more": 1}, "more"),
        ({"system": True, "uid": ""}, "system"),
        ({"system": 1, "uid": "", "values": {"X" * 17: {"before": 1.0, "placed": []}}}, "values"),
        ({"system": 1, "uid": "", "values": {"Ü": {"before": 1.0, "placed": []}}}, "values"),
        ({"system": 1, "uid": "", "values": {"X": {"before": "1", "placed": []}}}, "values.X"),
        ({"system": 1, "uid": "", "hover": {"latitude": 1e9}}, "hover.latitude"),
    ],
)
def test_the_field_that_is_wrong_is_named(body: object, reason: str) -> None:
    with pytest.raises(PageError, match=reason):
        decode(page_of(body))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_a_parameter_is_never_set_to_what_is_no_number(number: str) -> None:
    body = f'{{"system":1,"uid":"","borrowed":{{"X":{{"before":{number},"placed":[]}}}}}}'
    with pytest.raises(PageError, match=r"borrowed\.X\.before"):
        decode(page_of(body.encode()))


def test_another_version_is_not_guessed_at() -> None:
    with pytest.raises(PageError, match="version"):
        decode(page_of({"system": 1, "uid": ""}, version=2))


def test_an_unset_yaw_stays_unset() -> None:
    item = MissionItem(command=mavlink.MAV_CMD_NAV_WAYPOINT, parameters=(0.0, 0.0, 0.0, math.nan))
    _, memo = decode(encode(OWNER, Memo(plans={FENCE: ExchangedPlan((item,), None)})))
    assert math.isnan(memo.plans[FENCE].before[0].parameters[3])


def test_what_a_hostile_vehicle_tells_makes_no_page_that_could_not_be_read() -> None:
    for memo in (
        Memo(values={"X": Borrowed(math.nan, ())}),
        Memo(values={"a name that is too long": Borrowed(0.0, ())}),
        Memo(plans={FENCE: ExchangedPlan((MissionItem(command=5001),) * 5_001, None)}),
    ):
        with pytest.raises(PageError):
            encode(OWNER, memo)
    assert len(encode(OWNER, NOTHING)) < 200 < LARGEST_BYTES
