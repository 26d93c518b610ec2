"""Sends the logs of vehicles to the edge server, and what the frame log has of their flights.

`EdgeClient` and its spool carry what must arrive: a log is large and may be lost, so it has
requests of its own, on the threads of workers, which delay no report. Each request may be repeated;
the edge server knows how much of a log it has, also for the next run of the broker.

The frames of a flight are sent beside the vehicle's own log of it. They are copied out of the frame
log's files into a temporary one, which is sent part by part, so that an interrupted upload
continues, also in the next run. The files are only appended to, so that a later copy is the same,
until the oldest are deleted; a copy of another size is refused by the edge server and given up.
"""

import re
import tempfile
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from http import HTTPStatus
from pathlib import Path
from typing import Any, BinaryIO, Final
from urllib.parse import quote

import requests

from afarcloud.numbers import format_time
from mavlink_broker.edge.answers import explain, is_final, is_temporary_refusal
from mavlink_broker.edge.bounded_http import Answer, EdgeConnection
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
    LogState,
    SendFrames,
    SendLogPart,
)
from mavlink_broker.links.frame_log import copy_frames

FORMAT: Final = "tlog"
BEFORE_S: Final = 60.0
"""Time before arming that is included: the upload of the mission and the checks."""
AFTER_S: Final = 2.0
PART_BYTES: Final = 256 << 10
MAX_LOGS: Final = 16
"""Logs of an earlier run that are continued."""
_RETRIED: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT})
"""The flight may not be archived yet; a part may have been received, and its answer lost."""
_MAX_REASON: Final = 300
_MAX_LOG_BYTES: Final = (1 << 32) - 1
"""Limit of the size field of LOG_ENTRY and LOG_REQUEST_DATA."""
_NAME: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")


class LogUploader:
    """Carries out the requests of one worker thread; `connect` makes its connection."""

    def __init__(self, connect: Callable[[], EdgeConnection]) -> None:
        self._connect = connect
        self._connection: EdgeConnection | None = None

    def __call__(self, job: LogJob) -> LogJobOutcome:
        """Carry out one request; a failure is an outcome too."""
        if self._connection is None:
            self._connection = self._connect()
        try:
            return _outcome(job, self._exchange(self._connection, job))
        except requests.RequestException as error:
            reason = str(error)[:_MAX_REASON]
            return LogJobFailed(job.number, reason, is_final=False, is_temporary=True)

    def _exchange(self, connection: EdgeConnection, job: LogJob) -> Answer:
        path = f"/vehicles/{job.vehicle_id}/logs"
        match job.request:
            case FindLogs():
                return connection.request("GET", path)
            case BeginLog() as log:
                return connection.request("PUT", f"{path}/{quote(log.name)}", body=_described(log))
            case SendLogPart(name, offset, data, is_last):
                query = f"?offset={offset}" + ("&is_last=true" if is_last else "")
                return connection.request("PATCH", f"{path}/{quote(name)}{query}", data=data)
            case DropLog(name):
                return connection.request("DELETE", f"{path}/{quote(name)}")


def _described(log: BeginLog) -> dict[str, Any]:
    listed_at = datetime.fromtimestamp(log.listed_s, UTC) if log.listed_s else None
    return {
        "format": log.format,
        "started_at": format_time(log.started_at),
        "ended_at": format_time(log.ended_at),
        "listed_at": None if listed_at is None else format_time(listed_at),
        "size_bytes": log.size_bytes,
    }


def _outcome(job: LogJob, answer: Answer) -> LogJobOutcome:
    """Read an answer; one that is not the edge server's is a failure that may pass."""
    status = answer.status_code
    if status >= HTTPStatus.BAD_REQUEST:
        return LogJobFailed(
            job.number,
            f"HTTP {status}: {explain(answer)[:_MAX_REASON]}",
            is_final=is_final(status) and status not in _RETRIED,
            is_temporary=is_temporary_refusal(status),
        )
    if isinstance(job.request, DropLog):
        return LogJobDone(job.number)
    try:
        shown = answer.json()
        found = shown if isinstance(job.request, FindLogs) else [shown]
        return LogJobDone(job.number, tuple(_read(one) for one in found[:MAX_LOGS]))
    except (requests.RequestException, KeyError, TypeError, ValueError, OverflowError) as error:
        reason = f"HTTP {status} is not of the edge server: {error}"[:_MAX_REASON]
        return LogJobFailed(job.number, reason, is_final=False, is_temporary=True)


def _read(shown: Mapping[str, Any]) -> LogState:
    """Read how much of a log the edge server has.

    Raises:
        KeyError, TypeError, ValueError, OverflowError: if it does not state that.
    """
    listed_at = shown["listed_at"]
    name = shown["name"]
    if not _NAME.fullmatch(name):
        raise ValueError(f"name is {name!r}")
    size = _bytes(shown, "size_bytes", _MAX_LOG_BYTES)
    return LogState(
        BeginLog(
            name=name,
            format=str(shown["format"]),
            started_at=_time(shown["started_at"]),
            ended_at=_time(shown["ended_at"]),
            listed_s=0 if listed_at is None else int(_time(listed_at).timestamp()),
            size_bytes=size,
        ),
        received_bytes=_bytes(shown, "received_bytes", size),
        is_complete=bool(shown["is_complete"]),
    )


def _bytes(shown: Mapping[str, Any], field: str, most: int) -> int:
    """Read a number of bytes; the next part of the log is requested of its vehicle by it."""
    number = shown[field]
    if type(number) is not int or not 0 <= number <= most:
        raise ValueError(f"{field} must be 0 to {most}, not {number!r}")
    return number


def _time(text: str) -> datetime:
    time = datetime.fromisoformat(text)
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)


class FrameUploader:
    """Carries out the jobs of one worker thread; `connect` makes its connection."""

    def __init__(self, connect: Callable[[], EdgeConnection], folder: Path) -> None:
        self._requests = LogUploader(connect)
        self._folder = folder

    def __call__(self, job: SendFrames) -> FramesOutcome:
        """Send the frames of a flight, or complete what was begun; a failure is an outcome too."""
        try:
            return self._continue(job) if job.flight is None else self._send(job, job.flight)
        except OSError as error:
            reason = f"{self._folder}: {error.strerror or error}"
            return FramesNotSent(job.number, reason, is_final=False)

    def _continue(self, job: SendFrames) -> FramesOutcome:
        found = self._ask(job, FindLogs())
        if isinstance(found, LogJobFailed):
            return _not_sent(found)
        size = 0
        for log in (state.log for state in found.logs if state.log.format == FORMAT):
            outcome = self._send(job, FrameSpan(log.name, log.started_at, log.ended_at))
            if isinstance(outcome, FramesSent):
                size += outcome.size_bytes
            elif outcome.is_temporary:
                return outcome
        return FramesSent(job.number, size)

    def _send(self, job: SendFrames, flight: FrameSpan) -> FramesOutcome:
        begin = flight.started_at - timedelta(seconds=BEFORE_S)
        end = flight.ended_at + timedelta(seconds=AFTER_S)
        with tempfile.TemporaryFile(dir=self._folder) as copy:
            size = copy_frames(self._folder, job.system, begin, end, copy)
            if not size:
                reason = f"{self._folder} has no frames of it any more"
                return FramesNotSent(job.number, reason, is_final=True)
            if size > job.limit_bytes:
                reason = f"they have {size} bytes, {job.limit_bytes} are the limit"
                return FramesNotSent(job.number, reason, is_final=True)
            return self._send_copy(job, flight, copy, size)

    def _send_copy(
        self, job: SendFrames, flight: FrameSpan, copy: BinaryIO, size: int
    ) -> FramesOutcome:
        log = BeginLog(
            name=flight.name,
            format=FORMAT,
            started_at=flight.started_at,
            ended_at=flight.ended_at,
            listed_s=0,
            size_bytes=size,
        )
        answer, received = self._ask(job, log), 0
        while isinstance(answer, LogJobDone):
            (state,) = answer.logs
            if state.is_complete:
                return FramesSent(job.number, size)
            if state.received_bytes < received:
                return FramesNotSent(job.number, "the edge server has lost a part", is_final=False)
            received = copy.seek(state.received_bytes) + 1  # At least the last, empty part follows
            data = copy.read(PART_BYTES)
            is_last = state.received_bytes + len(data) >= size
            part = SendLogPart(flight.name, state.received_bytes, data, is_last=is_last)
            answer = self._ask(job, part)
        return _not_sent(answer)

    def _ask(self, job: SendFrames, request: LogRequest) -> LogJobDone | LogJobFailed:
        return self._requests(LogJob(job.number, job.vehicle_id, request))


def _not_sent(failed: LogJobFailed) -> FramesNotSent:
    return FramesNotSent(failed.number, failed.reason, failed.is_final, failed.is_temporary)
