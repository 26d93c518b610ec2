"""The broker's requests about logs, answered by the edge server; and what goes wrong in between."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any, Final, cast

import pytest
import requests

from mavlink_broker.edge.bounded_http import Answer, EdgeConnection, NoKeyError
from mavlink_broker.edge.uploads import PART_BYTES, FrameUploader, LogUploader
from mavlink_broker.effects import (
    BeginLog,
    DropLog,
    FindLogs,
    FramesNotSent,
    FramesOutcome,
    FrameSpan,
    FramesSent,
    LogJob,
    LogJobDone,
    LogJobFailed,
    LogJobOutcome,
    LogRequest,
    SendFrames,
    SendLogPart,
)
from mavlink_broker.links.frame_log import FrameFiles, copy_frames
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.unit.edge_server.archive.flown import FINISHED, begin, report
from tests.unit.edge_server.conftest import Edge

LOG: Final = BeginLog(
    name="01K9Z4T1W8F6Q2M3N5P7R9S0VX",
    format="ulg",
    started_at=datetime(2026, 11, 21, 12, 0, 0, 123_000, tzinfo=UTC),
    ended_at=datetime(2026, 11, 21, 12, 10, tzinfo=UTC),
    listed_s=1_795_262_398,
    size_bytes=10,
)


class Wire:
    """Carries requests to the edge server without a network; `fault` replaces its answers."""

    def __init__(self, edge: Edge) -> None:
        self._edge = edge
        self.fault: Answer | Exception | None = None
        self.is_cut: Callable[[], bool] = lambda: False  # The answer to the request is lost

    def request(
        self,
        method: str,
        path: str,
        *,
        body: Any = None,
        data: bytes | None = None,
    ) -> Answer:
        if isinstance(self.fault, Exception):
            raise self.fault
        if self.fault is not None:
            return self.fault
        options: Mapping[str, Any] = (
            {}
            if body is None and data is None
            else {"json": body}
            if data is None
            else {"data": data, "content_type": "application/octet-stream"}
        )
        answer = self._edge.ask(method, path, "broker", **options)
        if self.is_cut():
            raise requests.ConnectionError("cut off")
        return Answer(answer.status_code, answer.data)


class Broker:
    """The broker's end."""

    def __init__(self, edge: Edge) -> None:
        self.wire = Wire(edge)
        self._uploader = LogUploader(lambda: cast("EdgeConnection", self.wire))

    def ask(self, request: LogRequest) -> LogJobOutcome:
        return self._uploader(LogJob(7, 1, request))

    def send_frames(
        self, folder: Path, flight: FrameSpan | None, limit_bytes: int = 1 << 30
    ) -> FramesOutcome:
        upload = FrameUploader(lambda: cast("EdgeConnection", self.wire), folder)
        return upload(SendFrames(7, 1, 1, flight, limit_bytes))


@pytest.fixture
def broker(edge: Edge) -> Broker:
    """A broker, and an edge server with a flight of vehicle 1."""
    begin(edge)
    edge.clock.pass_s(600.0)
    report(edge, FINISHED)
    return Broker(edge)


def state(outcome: LogJobOutcome) -> tuple[BeginLog, int, bool]:
    assert isinstance(outcome, LogJobDone), outcome
    assert outcome.number == 7
    (log,) = outcome.logs
    return log.log, log.received_bytes, log.is_complete


def refusal(outcome: LogJobOutcome) -> tuple[bool, bool]:
    """Whether a failure is final, and whether it is temporary."""
    assert isinstance(outcome, LogJobFailed), outcome
    return outcome.is_final, outcome.is_temporary


def test_a_log_is_begun_sent_and_known(broker: Broker, edge: Edge) -> None:
    assert state(broker.ask(LOG)) == (LOG, 0, False)
    part = SendLogPart(LOG.name, 0, b"ULog", is_last=False)
    assert state(broker.ask(part)) == (LOG, 4, False)
    assert state(broker.ask(LOG)) == (LOG, 4, False)
    assert state(broker.ask(FindLogs())) == (LOG, 4, False)
    last = SendLogPart(LOG.name, 4, b"123456", is_last=True)
    assert state(broker.ask(last)) == (LOG, 10, True)
    assert broker.ask(FindLogs()) == LogJobDone(7)
    assert edge.ask("GET", "/flights/1/log", "operator").data == b"ULog123456"
    assert broker.ask(DropLog(LOG.name)) == LogJobDone(7)
    assert edge.get("/flights/1/logs") == []


def test_a_log_is_continued_by_what_is_shown_of_it(broker: Broker) -> None:
    precise = replace(LOG, started_at=LOG.started_at.replace(microsecond=123_456))
    broker.ask(precise)
    shown, _, _ = state(broker.ask(FindLogs()))
    assert state(broker.ask(shown)) == (shown, 0, False)


def test_a_part_that_was_received_before_is_asked_for_again(broker: Broker) -> None:
    broker.ask(LOG)
    part = SendLogPart(LOG.name, 0, b"ULog", is_last=False)
    broker.ask(part)
    assert refusal(broker.ask(part)) == (False, False)
    assert state(broker.ask(LOG)) == (LOG, 4, False)


def test_refusals_are_final_unless_they_may_pass(broker: Broker) -> None:
    late = datetime(2026, 11, 22, tzinfo=UTC)
    assert refusal(broker.ask(replace(LOG, started_at=late, ended_at=late))) == (False, False)
    assert refusal(broker.ask(replace(LOG, size_bytes=2**31))) == (True, False)
    too_large = SendLogPart(LOG.name, 0, bytes(11), is_last=True)
    broker.ask(LOG)
    assert refusal(broker.ask(too_large)) == (True, False)
    assert refusal(broker.ask(SendLogPart("another", 0, b"x", is_last=True))) == (False, False)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (requests.ConnectionError("refused"), (False, True)),
        (NoKeyError("no key"), (False, True)),
        (Answer(503, b'{"message": "busy"}'), (False, True)),
        (Answer(507, b'{"message": "full"}'), (False, True)),
        (Answer(401, b'{"message": "unknown key"}'), (False, True)),
        (Answer(404, b"<html>"), (False, False)),
        (Answer(413, b"<html>"), (True, False)),
        (Answer(500, b"[]"), (False, False)),
        (Answer(200, b"<html>Sign in</html>"), (False, True)),
        (Answer(200, b'{"name": 5}'), (False, True)),
        (Answer(200, b"[1]"), (False, True)),
        (Answer(200, b'{"name": "../x", "listed_at": null}'), (False, True)),
    ],
)
def test_every_answer_has_one_outcome(
    broker: Broker, fault: Answer | Exception, expected: tuple[bool, bool]
) -> None:
    broker.wire.fault = fault
    for request in (LOG, SendLogPart(LOG.name, 0, b"x", is_last=True), FindLogs()):
        assert refusal(broker.ask(request)) == expected


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("received_bytes", value) for value in ("-5", "11", "NaN", "1e999", '"4"', "true")),
        *(("size_bytes", value) for value in ("-5", "4294967296", "1e999", '"10"', "null")),
    ],
)
def test_an_answer_that_names_an_impossible_part_is_refused(
    broker: Broker, field: str, value: str
) -> None:
    """The next part of the log would be requested of its vehicle with it."""
    shown = {
        "name": LOG.name,
        "format": "ulg",
        "started_at": "2026-11-21T12:00:00Z",
        "ended_at": "2026-11-21T12:00:00Z",
        "listed_at": None,
        "size_bytes": 10,
        "received_bytes": 4,
        "is_complete": False,
    }
    body = json.dumps(shown)
    broker.wire.fault = Answer(200, body.encode())
    assert isinstance(broker.ask(LOG), LogJobDone)
    wrong = body.replace(f'"{field}": {shown[field]}', f'"{field}": {value}')
    broker.wire.fault = Answer(200, wrong.encode())
    outcome = broker.ask(LOG)
    assert refusal(outcome) == (False, True)
    assert isinstance(outcome, LogJobFailed)
    assert field in outcome.reason


FLIGHT: Final = FrameSpan("01K9Z4T1W8F6Q2M3N5P7R9S0VZ", LOG.started_at, LOG.ended_at)


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """The frame log of a flight, which is sent in three parts."""
    folder, encoder = tmp_path / "tlog", Encoder(1, 1)
    files = FrameFiles(folder, file_bytes=PART_BYTES, files=8)
    stamp = int(LOG.started_at.timestamp() * 1e6).to_bytes(8, "big")
    text = mavlink.MAVLink_statustext_message(6, b"x" * 50)
    record = stamp + encoder.encode(text)
    for _ in range(5):
        files.append(record * (PART_BYTES // 2 // len(record)), LOG.started_at)
    files.close()
    return folder


def bytes_of(folder: Path) -> bytes:
    with (folder / "copy").open("w+b") as file:
        copy_frames(folder, 1, LOG.started_at, LOG.ended_at, file)
        file.seek(0)
        return file.read()


def test_the_frames_of_a_flight_are_a_log_beside_the_vehicles_own(
    broker: Broker, edge: Edge, frames: Path
) -> None:
    expected = bytes_of(frames)
    assert broker.send_frames(frames, FLIGHT) == FramesSent(7, len(expected))
    (listed,) = edge.get("/flights/1/logs")
    assert (listed["format"], listed["size_bytes"]) == ("tlog", len(expected))
    assert listed["file_name"].endswith(".tlog")
    found = edge.ask("GET", "/flights/1/log?format=tlog", "operator")
    assert found.data == expected
    assert edge.ask("GET", "/flights/1/log", "operator").status_code == 404
    broker.ask(LOG)
    broker.ask(SendLogPart(LOG.name, 0, b"ULog123456", is_last=True))
    assert edge.ask("GET", "/flights/1/log", "operator").data == b"ULog123456"
    assert edge.ask("GET", "/flights/1/log?format=ulg", "operator").data == b"ULog123456"
    assert edge.ask("GET", "/flights/1/log?format=bin", "operator").status_code == 404
    assert edge.ask("GET", "/flights/1/log?format=x", "operator").status_code == 422


@pytest.mark.parametrize("answered", range(5))
def test_frames_whose_answers_are_lost_are_continued_by_the_next_run(
    broker: Broker, edge: Edge, frames: Path, answered: int
) -> None:
    expected = bytes_of(frames)
    requests_made = count()
    broker.wire.is_cut = lambda: next(requests_made) >= answered
    first = broker.send_frames(frames, FLIGHT)
    broker.wire.is_cut = lambda: False
    assert isinstance(first, FramesSent) == (answered > 3)
    assert isinstance(broker.send_frames(frames, None), FramesSent)
    assert edge.ask("GET", "/flights/1/log?format=tlog", "operator").data == expected
    assert broker.send_frames(frames, None) == FramesSent(7, 0)


def test_frames_that_cannot_be_sent_say_why(broker: Broker, frames: Path, tmp_path: Path) -> None:
    def failed(outcome: FramesOutcome) -> FramesNotSent:
        assert isinstance(outcome, FramesNotSent)
        return outcome

    late = datetime(2026, 11, 22, tzinfo=UTC)
    assert "no frames" in failed(broker.send_frames(frames, FrameSpan("late", late, late))).reason
    assert "100 are the limit" in failed(broker.send_frames(frames, FLIGHT, 100)).reason
    missing = failed(broker.send_frames(tmp_path / "missing", FLIGHT))
    assert ("missing" in missing.reason, missing.is_final) == (True, False)
    broker.wire.fault = Answer(507, b'{"message": "full"}')
    assert failed(broker.send_frames(frames, FLIGHT)).is_temporary
    assert failed(broker.send_frames(frames, None)).is_temporary


def test_an_edge_server_that_forgets_parts_is_not_sent_them_for_ever(
    broker: Broker, frames: Path
) -> None:
    begun = b'{"name": "a", "format": "tlog", "started_at": 0, "listed_at": null, "size_bytes": 9,'
    begun = begun.replace(b"0,", b'"2026-11-21T12:00:00Z",', 1)
    begun += b'"ended_at": "2026-11-21T12:00:00Z", "received_bytes": 0, "is_complete": false}'
    broker.wire.fault = Answer(200, begun)
    outcome = broker.send_frames(frames, FLIGHT)
    assert isinstance(outcome, FramesNotSent)
    assert "has lost a part" in outcome.reason
