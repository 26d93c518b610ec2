"""Answers of the server before the application."""

import json

import pytest

from edge_server.process import workers


@pytest.mark.parametrize(
    ("status", "retry"), [(408, False), (414, False), (431, False), (503, True), (505, False)]
)
def test_a_refusal_has_the_shape_of_every_error(status: int, *, retry: bool) -> None:
    head, _, body = workers._refusal(status).partition(b"\r\n\r\n")
    start, *fields = head.decode().split("\r\n")
    headers = dict(field.split(": ", 1) for field in fields)
    assert start.startswith(f"HTTP/1.1 {status} ")
    assert headers["Content-Length"] == str(len(body))
    assert headers["Connection"] == "close"
    assert ("Retry-After" in headers) == retry
    assert json.loads(body) | {"request_id": ""} == {
        "message": workers._SENTENCES[status],
        "detail": {},
        "request_id": "",
    }


def test_a_refusal_gives_a_reason_where_the_status_does_not() -> None:
    body = workers._refusal(400, "the header field Host is present twice").partition(b"\r\n\r\n")[2]
    assert json.loads(body)["message"] == "the header field Host is present twice"
