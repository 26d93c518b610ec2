"""Secrets are redacted in every form; other text stays readable."""

import io
import json
import logging
import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_server import logs
from edge_server.logs import redact
from edge_server.store.rows import keys

KEY = "fm_0123abcd_" + "5e" * 32
JWS = "eyJhbGciOiJFZERTQSJ9..c2lnbmF0dXJlLW9mLWEtcGxhbg"
SECRETS = [KEY.rpartition("_")[2], "c2lnbmF0dXJl", "dXNlcjpwYXNz", "hunter2", "topsecretvalue"]
LINES = [
    f"Authorization: Bearer {KEY}",
    f"{{'Authorization': 'Bearer {KEY}', 'Accept': '*/*'}}",
    '{"headers": "{\\"authorization\\": \\"Basic dXNlcjpwYXNz\\"}"}',
    "authorization=Basic dXNlcjpwYXNz",
    "sent b'Authorization', b'Basic dXNlcjpwYXNz'",
    f"X-API-Key: {KEY}",
    "x-api-key: topsecretvalue",
    f"X-JWS-Signature: {JWS}",
    f"the token {JWS} is not good",
    "GET /plans/?key=topsecretvalue HTTP/1.1",
    "GET http://farm:8000/pose?after=1&token=topsecretvalue",
    "postgresql+psycopg://edge:hunter2@db/edge cannot be reached",
    f"ValueError: {KEY}",
    "Proxy-Authorization: Digest topsecretvalue",
]


@pytest.mark.parametrize("line", LINES)
def test_secrets_are_removed(line: str) -> None:
    for secret in SECRETS:
        assert secret not in redact(line)


@pytest.mark.parametrize(
    "line",
    [
        "serving on http://127.0.0.1:8000",
        "POST /plans/5/dispatch 409",
        "refused operator GET /audit: the role operator may not do this",
        "the database /var/edge/edge.sqlite3 is broken (malformed); is it a bearer of bad news?",
        "0123456789abcdef" * 4,
    ],
)
def test_other_text_stays(line: str) -> None:
    assert redact(line) == line


def test_the_prefix_of_a_key_stays() -> None:
    assert redact(f"wrong key {KEY}") == "wrong key fm_0123abcd_***"


@pytest.mark.thorough
@given(before=st.text(max_size=20), after=st.text(max_size=20))
def test_a_key_is_redacted_wherever_it_is(before: str, after: str) -> None:
    secret = KEY.rpartition("_")[2]
    assert secret not in redact(f"{before} {keys.generate()[:3]}{KEY[3:]} {after}")


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> Iterator[io.StringIO]:
    """The log of this process as JSON, redacted as the program redacts it."""
    monkeypatch.setattr("sys.excepthook", None)
    monkeypatch.setattr("threading.excepthook", threading.excepthook)
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    stream = io.StringIO()
    logs.configure("INFO", "json", stream)
    yield stream
    logging.captureWarnings(capture=False)
    root.handlers[:] = handlers
    root.setLevel(level)


def fail() -> None:
    """Fail with secrets in the message."""
    raise ValueError(f"cannot use {KEY} of {{'Authorization': 'Bearer {KEY}'}}")


def test_a_traceback_is_redacted_and_still_json(log: io.StringIO) -> None:
    try:
        fail()
    except ValueError:
        logging.getLogger("edge_server").exception("it fails with %s", JWS)
    line = json.loads(log.getvalue())
    for secret in SECRETS:
        assert secret not in json.dumps(line)
    assert "cannot use fm_0123abcd_***" in line["exc_info"]
