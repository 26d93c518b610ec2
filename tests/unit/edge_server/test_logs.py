"""Lines of the log: one JSON object each, with the request's id, without secrets."""

import io
import json
import logging
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import pytest

from edge_server import logs

LOG = logging.getLogger("edge_server.tested")


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _log_as_before(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Leave the root logger and the hooks as they were."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    monkeypatch.setattr("sys.excepthook", None)
    monkeypatch.setattr("threading.excepthook", threading.excepthook)
    yield
    logging.captureWarnings(capture=False)
    root.handlers[:] = handlers
    root.setLevel(level)


def lines_of(stream: io.StringIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_without_a_terminal_each_line_is_an_object() -> None:
    stream = io.StringIO()
    logs.configure("INFO", "auto", stream)
    LOG.warning("cloud %s\nis away", "A", extra={"vehicle_id": 3})
    LOG.debug("not asked for")
    (line,) = lines_of(stream)
    assert line["message"] == "cloud A\nis away"
    assert line["level"] == "WARNING"
    assert line["logger"] == "edge_server.tested"
    assert line["vehicle_id"] == 3
    moment = datetime.fromisoformat(line["time"])
    assert abs((datetime.now(UTC) - moment).total_seconds()) < 3600


@pytest.mark.parametrize(("form", "as_json"), [("auto", False), ("text", False), ("json", True)])
def test_a_terminal_gets_text_by_default(form: str, *, as_json: bool) -> None:
    stream = Terminal()
    logs.configure("INFO", form, stream)
    LOG.info("serving")
    assert stream.getvalue().startswith("{") == as_json
    assert "serving" in stream.getvalue()


def test_a_failure_is_one_line_with_its_trace() -> None:
    stream = io.StringIO()
    logs.configure("INFO", "json", stream)
    try:
        int("bad \udc80 bytes")
    except ValueError:
        LOG.exception("it failed")
    (line,) = lines_of(stream)
    assert "ValueError" in line["exc_info"]


def test_a_failing_thread_is_logged_like_other_errors() -> None:
    stream = io.StringIO()
    logs.configure("INFO", "json", stream)

    def fail() -> None:
        raise ValueError("not caught")

    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
    (line,) = lines_of(stream)
    assert line["level"] == "CRITICAL"
    assert "not caught" in line["exc_info"]


@pytest.mark.parametrize("form", ["json", "text"])
def test_every_line_of_a_request_has_its_id(form: str) -> None:
    stream = io.StringIO()
    logs.configure("INFO", form, stream)
    token = logs.REQUEST_ID.set("abc-123")
    LOG.info("within")
    logs.REQUEST_ID.reset(token)
    LOG.info("without")
    within, without = stream.getvalue().splitlines()
    assert "abc-123" in within
    assert "abc-123" not in without


@pytest.mark.parametrize("form", ["json", "text"])
def test_secrets_are_redacted_wherever_they_are(form: str) -> None:
    stream = io.StringIO()
    logs.configure("INFO", form, stream)
    key = "fm_0123abcd_s3cret"
    LOG.info("a key %s", key, extra={"header": key})
    try:
        int(key)
    except ValueError:
        LOG.exception(key)
    assert "s3cret" not in stream.getvalue()
    assert "***" in stream.getvalue()


@pytest.mark.parametrize(("form", "lines"), [("text", 0), ("json", 1)])
def test_the_access_log_is_json_only(form: str, lines: int) -> None:
    stream = io.StringIO()
    logs.configure("INFO", form, stream)
    logging.getLogger("edge_server.access").info("GET /plans/1 200")
    assert len(stream.getvalue().splitlines()) == lines
