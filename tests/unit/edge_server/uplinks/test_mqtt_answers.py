"""An answer of the cloud, or of somebody who should not speak."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_server.outbox.answers import Answer, Meaning, Unreachable, judge
from edge_server.uplinks.mqtt_answers import read_answer

KEY = "01K9Z4T1W8F6Q2M3N5P7R9S0VX"


def test_a_status_is_what_http_would_have_said() -> None:
    answer = {"message_id": KEY, "status": 503, "retry_after_s": 30}
    reply = read_answer(KEY, json.dumps(answer).encode())
    assert isinstance(reply, Answer)
    assert (reply.status, reply.retry_after_s) == (503, 30.0)


def test_a_duplicate_that_the_cloud_has_is_confirmed() -> None:
    answer = {"message_id": KEY, "status": 409, "outcome": "duplicate"}
    assert judge(read_answer(KEY, json.dumps(answer).encode())).meaning is Meaning.CONFIRMED
    answer["outcome"] = "conflict"
    assert judge(read_answer(KEY, json.dumps(answer).encode())).meaning is Meaning.REJECTED


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"200",
        b'"200"',
        b"[200]",
        b"null",
        b"{}",
        b'{"status": true}',
        b'{"status": 200.0}',
        b'{"status": "200"}',
        b'{"status": 99}',
        b'{"status": 600}',
        b'{"status": NaN}',
        b'{"status": 200, "message_id": "another"}',
        b'{"status": 200, "message_id": null}',
        b'{"status": 200',
        b"\xff\xfe",
        b"<html>",
        b"[" * 60_000,
        b'{"status": 200}' + b" " * 70_000,
    ],
)
def test_what_is_no_answer_confirms_nothing(payload: bytes) -> None:
    assert isinstance(read_answer(KEY, payload), Unreachable)


@given(st.binary(max_size=200))
def test_no_bytes_break_it(payload: bytes) -> None:
    reply = read_answer(KEY, payload)
    assert not isinstance(reply, Answer) or reply.status


@pytest.mark.parametrize("wish", [None, "soon", True, -1, math.nan, math.inf, 1e300, [], 10**400])
def test_a_strange_wish_is_harmless(wish: object) -> None:
    reply = read_answer(KEY, json.dumps({"status": 503, "retry_after_s": wish}).encode())
    assert isinstance(reply, Answer)
    assert reply.retry_after_s is None or 0.0 <= reply.retry_after_s <= 1e9
