"""Batches on the wire: what goes out, and whose result is whose."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_server.outbox.answers import Answer, Outcome, Reply, Unreachable, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.uplinks import batches

RECORDS = [
    OutboxRecord(1, 1, "A" * 26, Stream(1, "pose"), '{"vehicle_id":1,"name":"Äcker"}', 0),
    OutboxRecord(2, 2, "B" * 26, Stream(2, "alarm"), '{"vehicle_id":2}', 0),
]


def answer(*results: object, status: int = 200) -> Answer:
    body = json.dumps({"results": list(results)}).encode()
    return Answer(status, "application/json", body)


def good(record: OutboxRecord, **fields: object) -> dict[str, object]:
    return {"message_id": record.message_id, "status": 200} | fields


def test_a_line_is_a_record_with_its_kind() -> None:
    lines = batches.write(RECORDS).decode().splitlines()
    assert [json.loads(line) for line in lines] == [
        {"kind": "pose", "record": {"vehicle_id": 1, "name": "Äcker"}},
        {"kind": "alarm", "record": {"vehicle_id": 2}},
    ]


def test_each_record_gets_its_own_result() -> None:
    reply = answer(good(RECORDS[0]), good(RECORDS[1], status=503, retry_after_s=7))
    found = batches.read(reply, RECORDS)
    assert found is not None
    assert [classify(one).outcome for one in found] == [Outcome.CONFIRMED, Outcome.TRY_LATER]
    assert classify(found[1]).retry_after_s == 7.0


def test_a_duplicate_is_confirmed_and_a_conflict_is_not() -> None:
    reply = answer(
        good(RECORDS[0], status=409, outcome="duplicate"),
        good(RECORDS[1], status=409, outcome="conflict"),
    )
    found = batches.read(reply, RECORDS)
    assert found is not None
    assert [classify(one).outcome for one in found] == [Outcome.CONFIRMED, Outcome.REJECTED]


@pytest.mark.parametrize(
    "reply",
    [Unreachable("away"), Answer(503), Answer(401), Answer(302), Answer(200, "text/html", b"<p>")],
)
def test_an_answer_that_confirms_nothing_speaks_for_all(reply: Reply) -> None:
    assert batches.read(reply, RECORDS) == [reply, reply]


FIRST, SECOND = good(RECORDS[0]), good(RECORDS[1])


@pytest.mark.parametrize(
    "results",
    [
        [],
        [FIRST],
        [SECOND, FIRST],
        [FIRST, FIRST],
        [FIRST, SECOND, SECOND],
        [FIRST, None],
        [FIRST, SECOND | {"status": True}],
        [FIRST, SECOND | {"status": "200"}],
        [FIRST, SECOND | {"status": 20}],
        [FIRST, {"status": 200}],
    ],
)
def test_results_that_do_not_fit_confirm_nothing(results: list[object]) -> None:
    assert batches.read(answer(*results), RECORDS) is None


@pytest.mark.parametrize("body", [b"", b"[]", b"null", b'{"results": {}}', b"7"])
def test_a_good_answer_without_results_confirms_nothing(body: bytes) -> None:
    assert batches.read(Answer(200, "application/json", body), RECORDS) is None


def test_results_that_are_given_twice_confirm_nothing() -> None:
    refused, confirmed = ([good(one, status=status) for one in RECORDS] for status in (503, 200))
    body = f'{{"results": {json.dumps(refused)}, "results": {json.dumps(confirmed)}}}'
    reply = Answer(200, "application/json", body.encode())
    found = batches.read(reply, RECORDS)
    assert found is not None
    assert [classify(one).outcome for one in found] == [Outcome.NO_CLOUD, Outcome.NO_CLOUD]


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text() | st.integers(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@pytest.mark.thorough
@given(JSON)
def test_whatever_the_cloud_says_is_read_without_an_error(document: object) -> None:
    """It confirms nothing; what is no JSON, such as Infinity, is no answer of the cloud."""
    body = json.dumps({"results": [document, document]}).encode()
    found = batches.read(Answer(200, "application/json", body), RECORDS)
    assert {classify(one).outcome for one in found or ()} <= {Outcome.NO_CLOUD}


@given(st.floats() | st.text() | st.none() | st.integers())
def test_a_wait_that_is_none_is_none(wish: object) -> None:
    reply = answer(good(RECORDS[0], retry_after_s=wish), good(RECORDS[1]))
    found = batches.read(reply, RECORDS)
    assert found is not None
    wait = classify(found[0]).retry_after_s
    assert wait is None or 0 <= wait <= 1e9
