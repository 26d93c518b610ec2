"""Sends the logs of vehicles to the edge server, request by request, on the thread of a worker.

`EdgeClient` and its spool carry what must arrive: a log is large and may be lost, so it has
requests of its own, which delay no report. Each request may be repeated; the edge server knows how
much of a log it has, also for the next run of the broker.
"""

import re
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote

import requests

from afarcloud.numbers import format_time
from mavlink_broker.edge.bounded_http import (
    Answer,
    EdgeConnection,
    NoKeyError,
    explain,
    is_final,
    is_temporary_refusal,
)
from mavlink_broker.effects import (
    BeginLog,
    DropLog,
    FindLogs,
    LogJob,
    LogJobDone,
    LogJobFailed,
    LogJobOutcome,
    LogState,
    SendLogPart,
)

MEDIA_TYPE: Final = "application/octet-stream"
MAX_LOGS: Final = 16
"""Logs of an earlier run that are continued."""
_RETRIED: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT})
"""The flight may not be archived yet; a part may have been received, and its answer lost."""
_MAX_REASON: Final = 300
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
            answer = self._exchange(self._connection, job)
            return _outcome(job, answer)
        except (requests.RequestException, NoKeyError) as error:
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
                return connection.request(
                    "PATCH", f"{path}/{quote(name)}{query}", data=data, media_type=MEDIA_TYPE
                )
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
    except (requests.RequestException, KeyError, TypeError, ValueError, OverflowError):
        reason = f"HTTP {status} is not of the edge server"
        return LogJobFailed(job.number, reason, is_final=False, is_temporary=True)


def _read(shown: Mapping[str, Any]) -> LogState:
    """Read how much of a log the edge server has.

    Raises:
        KeyError, TypeError, ValueError, OverflowError: if it does not state that.
    """
    listed_at = shown["listed_at"]
    name = shown["name"]
    if not _NAME.fullmatch(name):
        raise ValueError(name)
    return LogState(
        BeginLog(
            name=name,
            format=str(shown["format"]),
            started_at=_time(shown["started_at"]),
            ended_at=_time(shown["ended_at"]),
            listed_s=0 if listed_at is None else int(_time(listed_at).timestamp()),
            size_bytes=int(shown["size_bytes"]),
        ),
        received_bytes=int(shown["received_bytes"]),
        is_complete=bool(shown["is_complete"]),
    )


def _time(text: str) -> datetime:
    time = datetime.fromisoformat(text)
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)
