"""All errors have one shape and show no internals."""

import base64
import io
import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from gunicorn.http.errors import (  # type: ignore[import-untyped]  # it has no types
    ChunkMissingTerminator,
    InvalidChunkExtension,
    InvalidChunkSize,
    InvalidHeaderName,
    LimitRequestHeaders,
)
from sqlalchemy import event

from edge_server.services.planning import plans
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import plan, telemetry


def shape_of(answer: Any) -> dict[str, Any]:
    assert answer.mimetype == "application/json"
    body: dict[str, Any] = json.loads(answer.data, parse_constant=pytest.fail)
    assert {"message", "detail", "request_id"} <= body.keys()
    assert body.keys() <= {"message", "detail", "request_id", "errors"}
    assert body["message"]
    return body


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/nothing", 404),
        ("GET", "/plans/1", 404),
        ("GET", "/plans/99999999999999999999999", 404),
        ("GET", "/pose//", 404),
        ("GET", "/pose/-1", 404),
        ("GET", "/pose/9223372036854775808", 404),
        ("PATCH", "/plans/", 405),
        ("GET", "/latest_state_vector/", 405),
        ("POST", "/plans/", 415),
        ("PUT", "/plans/1", 415),
    ],
)
def test_errors_of_the_address(edge: Edge, method: str, path: str, status: int) -> None:
    answer = edge.ask(method, path, "admin")
    assert answer.status_code == status
    shape_of(answer)


def test_a_refused_method_lists_the_allowed_ones(edge: Edge) -> None:
    assert "POST" in edge.ask("PATCH", "/plans/", "admin").headers["Allow"]


class BrokenBody(io.BytesIO):
    """A body that the server's parser refuses while it is read."""

    def __init__(self, error: Exception) -> None:
        super().__init__(b"{}")
        self._error = error

    def read(self, _size: int | None = -1) -> bytes:
        raise self._error

    def readinto(self, _buffer: object) -> int:
        raise self._error


@pytest.mark.first_case
@pytest.mark.parametrize(
    "error",
    [
        InvalidChunkSize(b"+50"),
        InvalidChunkExtension("bare CR"),
        ChunkMissingTerminator(b"XX"),
        InvalidHeaderName("CONTENT-LENGTH"),
        LimitRequestHeaders("too many"),
    ],
)
@pytest.mark.parametrize(
    ("path", "content_type"),
    [("/plans/", "application/json"), ("/fields/", "multipart/form-data; boundary=a")],
)
def test_a_body_that_the_parser_refuses_is_a_400(
    edge: Edge, path: str, content_type: str, error: Exception
) -> None:
    answer = edge.ask(
        "POST",
        path,
        "admin",
        input_stream=BrokenBody(error),
        headers={"Content-Type": content_type, "Transfer-Encoding": "chunked"},
        environ_overrides={"wsgi.input_terminated": True},
    )
    assert answer.status_code == 400
    shape_of(answer)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("coding", "status"), [("gzip", 415), ("br, gzip", 415), ("identity", 201)]
)
def test_a_compressed_body_is_a_415(edge: Edge, coding: str, status: int) -> None:
    body = json.dumps(telemetry("pose")).encode()
    headers = {"Content-Type": "application/json", "Content-Encoding": coding}
    answer = edge.ask("POST", "/pose/", "broker", data=body, headers=headers)
    assert answer.status_code == status, answer.json


@pytest.mark.parametrize(
    ("charset", "status"),
    [
        *(("utf-16", 415), ("iso-8859-1", 415), ('"windows-1252"', 415), ("nonsense", 415)),
        *(("utf-16; charset=utf-8", 415), ("utf-8; charset=utf-16", 415), (" utf-16", 415)),
        *(("utf-8", 201), ("UTF-8", 201), ('"utf8"', 201), ("us-ascii", 201), ("'utf-8'", 201)),
    ],
)
def test_json_in_another_charset_is_a_415(edge: Edge, charset: str, status: int) -> None:
    body = json.dumps(telemetry("pose")).encode()
    headers = {"Content-Type": f"application/json; charset={charset}"}
    answer = edge.ask("POST", "/pose/", "broker", data=body, headers=headers)
    assert answer.status_code == status, answer.json
    if status == 415:
        assert "UTF-8" in shape_of(answer)["message"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    "content_type", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"]
)
def test_a_body_of_another_type_is_a_415(edge: Edge, content_type: str) -> None:
    headers = {"Content-Type": content_type}
    answer = edge.ask("POST", "/pose/", "broker", data=b"{}", headers=headers)
    assert answer.status_code == 415
    shape_of(answer)


def test_a_body_that_is_too_large_is_a_413(edge: Edge) -> None:
    answer = edge.post_plan(plan(name="x" * 2_000_000))
    assert answer.status_code == 413
    assert shape_of(answer)["detail"] == {"json": {"": ["must be at most 1048576 bytes"]}}
    assert edge.count("plan") == 0


def test_several_faults_are_reported_at_once(edge: Edge) -> None:
    answer = edge.report("pose", telemetry("pose") | {"latitude": 91, "yaw": "north"})
    assert shape_of(answer)["detail"]["json"].keys() == {"latitude", "yaw"}


def test_an_error_does_not_echo_the_request(edge: Edge) -> None:
    answer = edge.report("pose", telemetry("pose") | {"latitude": "my secret"})
    assert answer.status_code == 422
    assert b"my secret" not in answer.data


def test_an_internal_error_is_logged_and_not_answered(
    edge: Edge, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(plans, "page", fail)
    with caplog.at_level(logging.ERROR):
        answer = edge.ask("GET", "/plans/", "operator")
    assert answer.status_code == 500
    assert "inside" not in shape_of(answer)["message"]
    assert "ZeroDivisionError" in caplog.text


@contextmanager
def a_small_disk(edge: Edge) -> Iterator[None]:
    """Let the database grow no more."""

    def limit(connection: Any, _record: object, _proxy: object) -> None:
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
        connection.execute(f"PRAGMA max_page_count={pages}").close()

    engine = edge.context.database.engine
    event.listen(engine, "checkout", limit)
    yield
    event.remove(engine, "checkout", limit)
    edge.context.database.close()


@pytest.mark.thorough
def test_a_full_disk_is_a_507_and_nothing_is_half_stored(edge: Edge) -> None:
    with a_small_disk(edge):
        statuses = set()
        for number in range(20):
            before = edge.count("telemetry"), edge.count("outbox")
            status = edge.report("pose", telemetry("pose", number)).status_code
            statuses.add(status)
            if status != 201:
                assert (edge.count("telemetry"), edge.count("outbox")) == before
        image = edge.report("image", telemetry("image") | big_picture())
        assert image.status_code == 507
        shape_of(image)
        assert edge.count("telemetry") == edge.count("outbox")
    assert statuses <= {201, 507}
    assert edge.report("pose", telemetry("pose")).status_code == 201


def big_picture() -> dict[str, Any]:
    picture = b"\xff\xd8\xff" + bytes(300_000)
    return {"frame": base64.b64encode(picture).decode(), "image_size": len(picture)}


def test_answers_are_not_cached_or_guessed_at(edge: Edge) -> None:
    for answer in (edge.ask("GET", "/plans/", "operator"), edge.ask("GET", "/nothing", "admin")):
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert answer.headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("Idempotency-Key", "a b", "must be 1 to 64 visible ASCII characters"),
        ("Idempotency-Key", "x" * 65, "must be 1 to 64 visible ASCII characters"),
        ("Broker-Instance", "a-b", "must be 1 to 32 letters and digits"),
    ],
)
def test_a_wrong_header_field_is_named(edge: Edge, name: str, value: str, rule: str) -> None:
    body = telemetry("pose")
    answer = edge.ask("POST", "/pose/", "broker", json=body, headers={name: value})
    assert answer.status_code == 422
    assert (answer.json or {})["detail"] == {"header": {name: [rule]}}
    assert (answer.json or {})["message"] == f"{name} {rule}"
