"""Posts as bytes: truncated, damaged and invalid ones are refused."""

import json
import zlib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.edge.outbox import DeadLetter, Urgency
from mavlink_broker.edge.spool_record import (
    RecordError,
    decode_dead_letter,
    decode_post,
    encode_dead_letter,
    encode_post,
)
from tests.support.cases import failures
from tests.support.spooled_posts import post

LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
JSON = st.recursive(
    LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=4
)
BODIES = st.dictionaries(st.text(), LEAVES | st.lists(LEAVES, max_size=3), max_size=3)
FEW = settings(max_examples=30)
PATHS = st.sampled_from(["/pose/", "/mission_report/", "/broker/commands/17/ack"])


def sealed(document: Any) -> bytes:
    """Bytes with a valid checksum."""
    text = json.dumps(document).encode()
    return b"%08x %s" % (zlib.crc32(text), text)


def document(**changed: Any) -> dict[str, Any]:
    whole: dict[str, Any] = json.loads(encode_post(7, post())[9:])
    return whole | changed


@FEW
@given(BODIES, PATHS, st.none() | st.text("abc-019", min_size=1, max_size=64), st.booleans())
def test_a_post_is_read_as_it_was_written(
    body: dict[str, Any], path: str, key: str | None, known: bool
) -> None:
    sent = post(body=body, path=path, idempotency_key=key, may_be_duplicate=known, vehicle_id=3)
    again = decode_post(12, encode_post(12, sent))
    assert again.spool_number == 12
    assert (again.method, again.path, again.body) == ("POST", path, body)
    assert (again.idempotency_key, again.may_be_duplicate) == (key, known)
    assert (again.vehicle_id, again.lane, again.urgency) == (3, sent.lane, sent.urgency)


def test_a_post_that_is_read_is_inherited_and_needs_no_registration() -> None:
    again = decode_post(12, encode_post(12, post(needs_registration=True)))
    assert again.spool_number == 12
    assert again.is_inherited
    assert not again.needs_registration


def test_a_dead_letter_is_read_as_it_was_written() -> None:
    again = decode_dead_letter(12, encode_dead_letter(12, DeadLetter(post(number=3), "HTTP 409")))
    assert again.reason == "HTTP 409"
    assert again.post.body == post(number=3).body


def test_a_post_under_the_number_of_another_is_refused() -> None:
    with pytest.raises(RecordError, match="number"):
        decode_post(13, encode_post(12, post()))


@given(st.binary(max_size=200))
def test_random_bytes_are_refused(line: bytes) -> None:
    with pytest.raises(RecordError):
        decode_post(7, line)


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_damaged_byte_is_detected(place: int, change: int) -> None:
    line = bytearray(encode_post(7, post()))
    line[place % len(line)] ^= change
    with pytest.raises(RecordError):
        decode_post(7, bytes(line))


@FEW
@given(JSON)
def test_random_json_is_refused(whatever: Any) -> None:
    with pytest.raises(RecordError):
        decode_post(7, sealed(whatever))


INVALID_FIELDS: list[dict[str, Any]] = [
    {"path": "@evil.example/"},
    {"path": "//evil.example/"},
    {"path": "/pose/\n"},
    {"path": "/../plans/"},
    {"path": "/broker/commands/1/ack/../../../plans/"},
    {"path": "/pose/?x=1"},
    {"key": "two\r\nheaders: 1"},
    {"key": "k" * 65},
    {"key": ""},
    {"number": 0},
    {"number": True},
    {"number": "7"},
    {"urgency": 99},
    {"urgency": -1},
    {"lane": "no lane"},
    {"vehicle_id": "1"},
    {"vehicle_id": None},
    {"body": []},
    {"body": None},
    {"may_be_known": 1},
    {"method": "DELETE"},
]


def check_invalid_field(changed: dict[str, Any]) -> None:
    with pytest.raises(RecordError, match=next(iter(changed))):
        decode_post(7, sealed(document(**changed)))


def test_a_post_with_an_invalid_field_is_refused() -> None:
    assert failures(check_invalid_field, zip(INVALID_FIELDS)) == []


def test_deeply_nested_json_is_refused() -> None:
    text = b"[" * 100_000
    with pytest.raises(RecordError):
        decode_post(7, b"%08x %s" % (zlib.crc32(text), text))


def test_every_urgency_is_read_as_it_was_written() -> None:
    for urgency in Urgency:
        assert decode_post(1, encode_post(1, post(urgency=urgency))).urgency is urgency
