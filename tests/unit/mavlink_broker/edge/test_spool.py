"""The spool on disk: reports before pictures, a bound that holds, rows that are refused."""

import json
import sqlite3
import zlib
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker import database
from mavlink_broker.database import DATABASE_FILE, RESERVE_BYTES, DatabaseBusyError, read_rows
from mavlink_broker.edge.outbox import DeadLetter, Post, Urgency
from mavlink_broker.edge.spool import (
    MIB,
    RecordError,
    Spool,
    decode_dead_letter,
    decode_post,
    encode_dead_letter,
    encode_post,
)
from tests.support.cases import failures
from tests.support.small_disk import NoSmallDiskError, fill_up, small_disk
from tests.support.spooled_posts import numbers, picture, post, posts_on_disk, spool_in


def numbered(spool: Spool, *posts: Post) -> list[Post]:
    for one in posts:
        one.spool_number = spool.next_number()
    return list(posts)


def left_in(spool: Spool) -> list[int]:
    """Which posts an earlier run has left."""
    return numbers(list(spool.take_inherited()))


def long(number: int) -> dict[str, Any]:
    return {"sequence_number": number, "text": "x" * 1000}


def kept(spool: Spool, posts: list[Post]) -> list[int]:
    return numbers(
        [one for one in posts if one.spool_number is not None and one.spool_number in spool]
    )


def test_the_next_run_gets_the_posts_that_wait_in_order(tmp_path: Path) -> None:
    spool = spool_in(tmp_path)
    reports = numbered(spool, post(number=1), post(number=2), post(number=3))
    spool.store_reports(reports)
    spool.store_pictures(numbered(spool, picture(4)))
    spool.release(frozenset({reports[1].spool_number or 0}))
    spool.database.close()
    again = spool_in(tmp_path)
    left = list(again.take_inherited())
    assert numbers(left) == [1, 3, 4]
    assert [one.idempotency_key for one in left[:2]] == [
        "mission_report-1",
        "mission_report-3",
    ]
    assert again.next_number() > max(one.spool_number or 0 for one in left)


def test_the_next_run_gets_the_posts_while_another_program_holds_a_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without them it would not know how a mission has ended, and fly it again."""
    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 0.0)
    spool = spool_in(tmp_path)
    spool.store_reports(numbered(spool, post(number=1), post(number=2)))
    spool.database.close()
    with closing(sqlite3.connect(tmp_path / DATABASE_FILE, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        again = spool_in(tmp_path)
        left = list(again.take_inherited())
        assert numbers(left) == [1, 2]
        sent = frozenset({left[0].spool_number or 0})
        with pytest.raises(OSError, match="locked"):
            again.release(sent)
    again.release(sent)
    again.database.close()
    assert left_in(spool_in(tmp_path)) == [2]


def test_another_broker_gets_no_posts(tmp_path: Path) -> None:
    spool = spool_in(tmp_path)
    spool.store_reports(numbered(spool, post(number=1)))
    with pytest.raises(DatabaseBusyError):
        spool_in(tmp_path)


def test_an_unused_spool_writes_nothing(tmp_path: Path) -> None:
    spool = spool_in(tmp_path)
    spool.release(frozenset())
    assert spool.database.writes == 0


def test_invalid_posts_are_set_aside_and_counted_and_the_others_are_read(tmp_path: Path) -> None:
    spool = spool_in(tmp_path)
    spool.store_reports(numbered(spool, *(post(number=number) for number in range(3))))
    with spool.database.change() as rows:
        rows.execute("UPDATE posts SET data = CAST(substr(data, 1, 40) AS TEXT) WHERE number = 2")
    spool.database.close()
    again = spool_in(tmp_path)
    assert again.damaged == 1
    assert left_in(again) == [0, 2]
    again.database.close()
    ((source, data),) = read_rows(tmp_path, "SELECT source, data FROM damaged")
    assert (source, len(data)) == ("posts", 40)
    assert spool_in(tmp_path).damaged == 0


def test_pictures_have_half_of_the_space_and_the_oldest_are_stored(tmp_path: Path) -> None:
    spool = spool_in(tmp_path, 20_000)
    pictures = numbered(spool, *(picture(n, 3000) for n in range(6)))
    with pytest.raises(OSError, match="used up"):
        spool.store_pictures(pictures)
    assert kept(spool, pictures) == [0, 1, 2]


def test_a_small_picture_does_not_overtake_one_without_space(tmp_path: Path) -> None:
    spool = spool_in(tmp_path, 20_000)
    pictures = numbered(spool, picture(0, 6000), picture(1, 6000), picture(2, 10))
    with pytest.raises(OSError, match="used up"):
        spool.store_pictures(pictures)
    assert kept(spool, pictures) == [0]


def test_reports_evict_pictures(tmp_path: Path) -> None:
    spool = spool_in(tmp_path, 20_000)
    pictures = numbered(spool, picture(0, 8000))
    spool.store_pictures(pictures)
    reports = numbered(spool, *(post(number=n, body=long(n)) for n in range(14)))
    spool.store_reports(reports)
    assert kept(spool, reports) == list(range(14))
    assert spool.take_evicted() == {pictures[0].spool_number}
    assert spool.take_evicted() == frozenset()
    assert len(posts_on_disk(tmp_path)) == 14


def test_of_reports_beyond_the_limit_the_first_are_stored(tmp_path: Path) -> None:
    spool = spool_in(tmp_path, 3000)
    reports = numbered(spool, *(post(number=n, body=long(n)) for n in range(5)))
    spool.store_reports(reports[:1])
    with pytest.raises(OSError, match="used up"):
        spool.store_reports(reports[1:])
    assert kept(spool, reports) == [0, 1]
    spool.database.close()
    assert sum(map(len, posts_on_disk(tmp_path))) <= 3000
    assert left_in(spool_in(tmp_path)) == [0, 1]


def test_the_file_does_not_grow_with_the_posts_that_were_answered(tmp_path: Path) -> None:
    spool = spool_in(tmp_path, 10_000)
    last: list[Post] = []
    for number in range(200):
        reports = numbered(spool, post(number=number, body={"n": number, "text": "x" * 1000}))
        spool.store_reports(reports)
        assert (tmp_path / DATABASE_FILE).stat().st_size <= 10_000 + 2 * RESERVE_BYTES
        spool.release(frozenset(one.spool_number or 0 for one in last))
        last = reports
    spool.database.close()
    assert [one.body["n"] for one in spool_in(tmp_path).take_inherited()] == [199]


def test_reports_evict_pictures_on_a_full_disk(tmp_path: Path) -> None:
    try:
        with small_disk(tmp_path / "disk", 8) as folder:
            spool = spool_in(folder / "broker", 4 * MIB)
            pictures = numbered(spool, picture(0, 900_000))
            spool.store_pictures(pictures)
            fill_up(folder / "other")
            reports = numbered(spool, *(post(number=n, body=long(n)) for n in range(400)))
            spool.store_reports(reports)
            assert kept(spool, reports) == list(range(400))
            assert kept(spool, pictures) == []
            assert spool.take_evicted() == {pictures[0].spool_number}
            spool.database.close()
            again = spool_in(folder / "broker", 4 * MIB)
            assert len(left_in(again)) == 400
            again.release(frozenset(one.spool_number or 0 for one in reports))
            again.database.close()
            assert posts_on_disk(folder / "broker") == []
    except NoSmallDiskError as error:
        pytest.skip(str(error))


def test_what_a_full_disk_refuses_is_stored_when_there_is_space_again(tmp_path: Path) -> None:
    try:
        with small_disk(tmp_path / "disk", 8) as folder:
            spool = spool_in(folder / "broker", 4 * MIB)
            fill_up(folder / "other")
            reports = numbered(spool, *(post(number=n, body=long(n)) for n in range(2000)))
            with pytest.raises(OSError, match="No space left"):
                spool.store_reports(reports)
            first = kept(spool, reports)
            assert first == list(range(len(first)))
            assert 0 < len(first) < 2000
            (folder / "other").unlink()
            rest = reports[len(first) :]
            spool.store_reports(rest[:500])
            spool.database.close()
            again = spool_in(folder / "broker", 4 * MIB)
            assert left_in(again) == list(range(len(first) + 500))
            again.database.close()
    except NoSmallDiskError as error:
        pytest.skip(str(error))


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
