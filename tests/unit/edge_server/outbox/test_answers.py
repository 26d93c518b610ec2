"""What the cloud's answers mean, over all status codes."""

import itertools

import pytest

from edge_server.outbox.answers import Answer, Outcome, Unreachable, classify
from tests.support.cases import failures

JSON = "application/json"


def check_status(status: int) -> None:
    outcome = classify(Answer(status, JSON, b"{}")).outcome
    if status in {200, 201, 203, 204, 205}:
        assert outcome is Outcome.CONFIRMED
    elif status in {401, 403}:
        assert outcome is Outcome.NO_ACCESS
    elif 300 <= status < 400:
        assert outcome is Outcome.NO_CLOUD
    elif status in {404, 410}:
        assert outcome is Outcome.NO_ENDPOINT
    elif status == 424:
        assert outcome is Outcome.HELD_BACK
    elif 400 <= status < 500 and status not in {408, 425, 429}:
        assert outcome is Outcome.REJECTED
    else:
        assert outcome is Outcome.TRY_LATER


def test_every_status_has_its_outcome() -> None:
    assert failures(check_status, itertools.product(range(100, 600))) == []


@pytest.mark.parametrize(
    ("content_type", "body"),
    [
        (JSON, b'{"id": 1}'),
        ("application/json; charset=utf-8", b"[]"),
        ("application/problem+json", b"null"),
        (JSON, b"7"),
        ("text/html", b""),
        ("", b"  \r\n"),
    ],
)
def test_json_or_nothing_confirms(content_type: str, body: bytes) -> None:
    assert classify(Answer(200, content_type, body)).outcome is Outcome.CONFIRMED


@pytest.mark.parametrize(
    ("content_type", "body"),
    [
        ("text/html", b"<html>"),
        ("text/html", b"{}"),
        ("", b"{}"),
        (JSON, b"{"),
        (JSON, b"NaN"),
        (JSON, b'{"height": -Infinity}'),
        (JSON, b"<html>"),
        (JSON, b"[" * 100_000),
        (JSON, b"\xff"),
        (JSON, b'{"id": 1, "id": 2}'),
        (JSON, b'\xef\xbb\xbf{"id": 1}'),
    ],
)
def test_anything_else_is_no_cloud(content_type: str, body: bytes) -> None:
    assert classify(Answer(200, content_type, body)).outcome is Outcome.NO_CLOUD


def test_silence_is_no_cloud_and_keeps_its_reason() -> None:
    result = classify(Unreachable("no answer in time"))
    assert (result.outcome, result.reason) == (Outcome.NO_CLOUD, "no answer in time")


def test_the_clouds_wish_is_passed_on() -> None:
    assert classify(Answer(503, retry_after_s=7.0)).retry_after_s == 7.0


def test_a_conflict_with_itself_confirms() -> None:
    known = Answer(409, JSON, b'{"outcome": "duplicate"}')
    assert classify(known).outcome is Outcome.CONFIRMED


@pytest.mark.parametrize(
    ("content_type", "body"),
    [
        (JSON, b'{"outcome": "conflict"}'),
        (JSON, b'["duplicate"]'),
        (JSON, b""),
        ("text/html", b'{"outcome": "duplicate"}'),
    ],
)
def test_any_other_conflict_rejects(content_type: str, body: bytes) -> None:
    assert classify(Answer(409, content_type, body)).outcome is Outcome.REJECTED


@pytest.mark.parametrize(
    "body",
    [
        b'{"outcome": "conflict", "outcome": "duplicate"}',
        b'{"outcome": "duplicate", "outcome": "conflict"}',
        b'\xef\xbb\xbf{"outcome": "duplicate"}',
        b'{"outcome": "dupl',
    ],
)
def test_a_conflict_that_cannot_be_read_is_tried_again(body: bytes) -> None:
    assert classify(Answer(409, JSON, body)).outcome is Outcome.TRY_LATER


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (b'{"message": "altitude is not plausible"}', ": altitude is not plausible"),
        (b'{"title": "Unprocessable", "detail": "too high"}', ": too high"),
        (b'{"error": "a\\nb\\u0000c \\ud800\\u202e"}', ": a b c"),
        (b'{"detail": {"no": "text"}, "message": 7}', ""),
        (b'{"message": "  "}', ""),
        (b"[1]", ""),
        (b"<p>no</p>", ""),
    ],
)
def test_a_rejection_has_the_clouds_reason_as_one_line(body: bytes, reason: str) -> None:
    assert classify(Answer(422, JSON, body)).reason == f"422 rejects the record{reason}"


def test_a_long_reason_is_cut_off() -> None:
    body = b'{"message": "' + b"x" * 100_000 + b'"}'
    assert len(classify(Answer(422, JSON, body)).reason) < 300
