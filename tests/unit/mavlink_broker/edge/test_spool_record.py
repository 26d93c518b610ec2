"""Posts to lines and back; nothing is believed that is torn, damaged or not ours."""

import json
import zlib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.edge.spool_record import (
    RecordError,
    Settled,
    Waiting,
    line_of,
    line_of_answered,
    read,
)
from tests.support.spooled_posts import post

LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
JSON = st.recursive(
    LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=4
)
BODIES = st.dictionaries(st.text(), LEAVES | st.lists(LEAVES, max_size=3), max_size=3)
FEW = settings(max_examples=30)
PATHS = st.sampled_from(["/pose/", "/mission_report/", "/broker/commands/17/ack"])


def sealed(document: Any) -> bytes:
    """A line of somebody who knows how lines are made."""
    text = json.dumps(document).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def document(**changed: Any) -> dict[str, Any]:
    whole: dict[str, Any] = json.loads(line_of(7, post())[9:])
    return whole | changed


def waiting(line: bytes) -> Post:
    record = read(line)
    assert isinstance(record, Waiting)
    return record.post


@FEW
@given(BODIES, PATHS, st.none() | st.text("abc-019", min_size=1, max_size=64), st.booleans())
def test_a_post_comes_back_as_it_was(
    body: dict[str, Any], path: str, key: str | None, known: bool
) -> None:
    told = post(body=body, path=path, idempotency_key=key, may_be_known=known, vehicle_id=3)
    line = line_of(12, told)
    assert line.count(b"\n") == 1
    again = waiting(line)
    assert again.kept_as == 12
    assert (again.method, again.path, again.body) == ("POST", path, body)
    assert (again.idempotency_key, again.may_be_known) == (key, known)
    assert (again.vehicle_id, again.lane, again.urgency) == (3, told.lane, told.urgency)


def test_what_comes_back_is_of_an_earlier_run_and_needs_no_registration() -> None:
    again = waiting(line_of(12, post(needs_registration=True)))
    assert again.kept_as == 12
    assert again.is_inherited
    assert not again.needs_registration


@given(st.sets(st.integers(1, 2**53)))
def test_answers_come_back_as_they_were(numbers: set[int]) -> None:
    assert read(line_of_answered(numbers)) == Settled(tuple(sorted(numbers)))


@given(st.binary(max_size=200))
def test_bytes_of_chance_are_no_record(line: bytes) -> None:
    with pytest.raises(RecordError):
        read(line)


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_damaged_byte_is_noticed(place: int, change: int) -> None:
    line = bytearray(line_of(7, post()))
    line[place % len(line)] ^= change
    with pytest.raises(RecordError):
        read(bytes(line))


@FEW
@given(JSON)
def test_json_of_chance_is_no_record(whatever: Any) -> None:
    with pytest.raises(RecordError):
        read(sealed(whatever))


@pytest.mark.parametrize(
    "changed",
    [
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
    ],
    ids=str,
)
def test_a_line_that_says_what_none_may_say_is_refused(changed: dict[str, Any]) -> None:
    with pytest.raises(RecordError, match=next(iter(changed))):
        read(sealed(document(**changed)))


@pytest.mark.parametrize("numbers", [[0], ["1"], "1", [1.5], None, {"1": 1}], ids=str)
def test_answers_that_are_no_numbers_are_refused(numbers: Any) -> None:
    with pytest.raises(RecordError):
        read(sealed({"answered": numbers}))


def test_json_that_never_ends_is_refused() -> None:
    text = b"[" * 100_000
    with pytest.raises(RecordError):
        read(b"%08x %s\n" % (zlib.crc32(text), text))


def test_every_urgency_comes_back() -> None:
    for urgency in Urgency:
        assert waiting(line_of(1, post(urgency=urgency))).urgency is urgency
