"""Posts as lines: truncated, damaged and invalid lines are refused."""

import json
import zlib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.edge.spool_record import (
    AnsweredPosts,
    PendingPost,
    RecordError,
    decode,
    encode_answered,
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
    """A line with a valid checksum."""
    text = json.dumps(document).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def document(**changed: Any) -> dict[str, Any]:
    whole: dict[str, Any] = json.loads(encode_post(7, post())[9:])
    return whole | changed


def waiting(line: bytes) -> Post:
    record = decode(line)
    assert isinstance(record, PendingPost)
    return record.post


@FEW
@given(BODIES, PATHS, st.none() | st.text("abc-019", min_size=1, max_size=64), st.booleans())
def test_a_post_is_read_as_it_was_written(
    body: dict[str, Any], path: str, key: str | None, known: bool
) -> None:
    sent = post(body=body, path=path, idempotency_key=key, may_be_duplicate=known, vehicle_id=3)
    line = encode_post(12, sent)
    assert line.count(b"\n") == 1
    again = waiting(line)
    assert again.spool_number == 12
    assert (again.method, again.path, again.body) == ("POST", path, body)
    assert (again.idempotency_key, again.may_be_duplicate) == (key, known)
    assert (again.vehicle_id, again.lane, again.urgency) == (3, sent.lane, sent.urgency)


def test_a_post_that_is_read_is_inherited_and_needs_no_registration() -> None:
    again = waiting(encode_post(12, post(needs_registration=True)))
    assert again.spool_number == 12
    assert again.is_inherited
    assert not again.needs_registration


@given(st.sets(st.integers(1, 2**53)))
def test_answered_posts_are_read_as_they_were_written(numbers: set[int]) -> None:
    assert decode(encode_answered(numbers)) == AnsweredPosts(tuple(sorted(numbers)))


@given(st.binary(max_size=200))
def test_random_bytes_are_refused(line: bytes) -> None:
    with pytest.raises(RecordError):
        decode(line)


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_damaged_byte_is_detected(place: int, change: int) -> None:
    line = bytearray(encode_post(7, post()))
    line[place % len(line)] ^= change
    with pytest.raises(RecordError):
        decode(bytes(line))


@FEW
@given(JSON)
def test_random_json_is_refused(whatever: Any) -> None:
    with pytest.raises(RecordError):
        decode(sealed(whatever))


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
        decode(sealed(document(**changed)))


def test_a_line_with_an_invalid_field_is_refused() -> None:
    assert failures(check_invalid_field, zip(INVALID_FIELDS)) == []


@pytest.mark.parametrize("numbers", [[0], ["1"], "1", [1.5], None, {"1": 1}], ids=str)
def test_answered_posts_without_valid_numbers_are_refused(numbers: Any) -> None:
    with pytest.raises(RecordError):
        decode(sealed({"answered": numbers}))


def test_deeply_nested_json_is_refused() -> None:
    text = b"[" * 100_000
    with pytest.raises(RecordError):
        decode(b"%08x %s\n" % (zlib.crc32(text), text))


def test_every_urgency_is_read_as_it_was_written() -> None:
    for urgency in Urgency:
        assert waiting(encode_post(1, post(urgency=urgency))).urgency is urgency
