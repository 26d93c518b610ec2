"""Records of the journal: what is written is read again, and nothing else is believed."""

import hashlib
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.journal import MAX_BYTES, JournalError, decode_record, encode_record
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import OverriddenParameter, OverriddenPlan
from mavlink_broker.microservices.mission_protocol import FENCE, RALLY
from mavlink_broker.planning.situation import Pose
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecoveryRecord,
    VehicleIdentity,
)

IDENTITY = VehicleIdentity(1, "0123456789abcdef")
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
    OverriddenPlan,
    before=st.lists(ITEMS, max_size=4).map(tuple),
    placed=st.none() | st.lists(ITEMS, max_size=4).map(tuple),
)
VALUES = st.dictionaries(
    st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=16),
    st.builds(OverriddenParameter, before=NUMBERS, placed=st.lists(NUMBERS, max_size=8).map(tuple)),
    max_size=4,
)
POSES = st.builds(Pose, st.floats(-90, 90), st.floats(-180, 180), NUMBERS, NUMBERS)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
RECORDS = st.builds(
    RecoveryRecord,
    plans=st.dictionaries(st.sampled_from([FENCE, RALLY]), PLANS),
    values=VALUES,
    borrowed=VALUES,
    hover=st.none() | POSES,
    hover_mode=st.none() | TEXTS,
    descent=st.none() | TEXTS,
    descent_s=st.none() | NUMBERS,
    pending_return=st.none() | st.builds(PendingReturn, mission=TEXTS, reason=TEXTS),
    abort=st.none()
    | st.builds(
        PendingAbort,
        work_id=st.integers(0, 2**31 - 1),
        identity=st.none() | TEXTS,
        event_type=st.sampled_from([1, 2]),
        point=st.none() | POSES,
        noted_s=st.none() | NUMBERS,
    ),
    segment=st.none() | TEXTS,
    segment_s=st.none() | NUMBERS,
    has_flown=st.booleans(),
    paused=st.none() | TEXTS,
    is_tracking=st.booleans(),
    has_camera=st.booleans(),
    healthy=st.lists(st.text(min_size=1, max_size=40), max_size=3).map(tuple),
    armed_s=st.none() | NUMBERS,
    arming_s=st.none() | NUMBERS,
    foreign_order=st.none() | st.tuples(st.integers(1, 255), st.integers(0, 2**16 - 1)),
    is_disarmed_by_others=st.booleans(),
    taken_mode=st.none() | TEXTS,
    shows_manual=st.booleans(),
    live=st.none()
    | st.builds(
        LiveCommandProgress,
        name=TEXTS,
        is_accepted=st.booleans(),
        began_s=st.none() | NUMBERS,
        accepted_s=st.none() | NUMBERS,
        start=st.none() | POSES,
        steps=st.integers(0, 1000),
    ),
)
IDENTITIES = st.builds(
    VehicleIdentity, st.integers(1, 255), st.text("0123456789abcdef", max_size=36)
)
ENCODED = encode_record(
    IDENTITY, RecoveryRecord(borrowed={"FLW_TGT_HT": OverriddenParameter(8.0, (10.0,))})
)


def encoded(body: object, version: int = 1) -> bytes:
    """A record with a valid checksum and any content."""
    text = body if isinstance(body, bytes) else json.dumps(body).encode()
    return f"farm-journal {version} {hashlib.sha256(text).hexdigest()}\n".encode() + text


@settings(max_examples=50)
@given(identity=IDENTITIES, record=RECORDS)
def test_a_record_is_decoded_as_it_was_encoded(
    identity: VehicleIdentity, record: RecoveryRecord
) -> None:
    assert decode_record(encode_record(identity, record)) == (identity, record)


@given(cut=st.integers(0, len(ENCODED) - 1))
def test_an_incomplete_record_is_refused(cut: int) -> None:
    with pytest.raises(JournalError):
        decode_record(ENCODED[:cut])


@given(place=st.integers(0, len(ENCODED) - 1), flip=st.integers(1, 255))
def test_a_record_with_a_changed_byte_is_refused(place: int, flip: int) -> None:
    changed = bytearray(ENCODED)
    changed[place] ^= flip
    with pytest.raises(JournalError):
        decode_record(bytes(changed))


@given(data=st.binary())
def test_random_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(JournalError):
        decode_record(data)


@settings(max_examples=40)
@given(
    data=st.binary() | st.recursive(st.none() | NUMBERS, st.lists).map(json.dumps).map(str.encode)
)
def test_random_content_with_a_valid_checksum_is_refused_or_read(data: bytes) -> None:
    with pytest.raises(JournalError):
        decode_record(encoded(data))


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
def test_the_error_names_the_invalid_field(body: object, reason: str) -> None:
    with pytest.raises(JournalError, match=reason):
        decode_record(encoded(body))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_a_parameter_value_must_be_a_number(number: str) -> None:
    body = f'{{"system":1,"uid":"","borrowed":{{"X":{{"before":{number},"placed":[]}}}}}}'
    with pytest.raises(JournalError, match=r"borrowed\.X\.before"):
        decode_record(encoded(body.encode()))


def test_another_version_is_refused() -> None:
    with pytest.raises(JournalError, match="version"):
        decode_record(encoded({"system": 1, "uid": ""}, version=2))


def test_an_unset_yaw_stays_unset() -> None:
    item = MissionItem(command=mavlink.MAV_CMD_NAV_WAYPOINT, parameters=(0.0, 0.0, 0.0, math.nan))
    _, record = decode_record(
        encode_record(IDENTITY, RecoveryRecord(plans={FENCE: OverriddenPlan((item,), None)}))
    )
    assert math.isnan(record.plans[FENCE].before[0].parameters[3])


def test_values_of_a_hostile_vehicle_cannot_make_a_record_unreadable() -> None:
    for record in (
        RecoveryRecord(values={"X": OverriddenParameter(math.nan, ())}),
        RecoveryRecord(values={"a name that is too long": OverriddenParameter(0.0, ())}),
        RecoveryRecord(plans={FENCE: OverriddenPlan((MissionItem(command=5001),) * 5_001, None)}),
    ):
        with pytest.raises(JournalError):
            encode_record(IDENTITY, record)
    assert len(encode_record(IDENTITY, EMPTY_RECORD)) < 200 < MAX_BYTES
