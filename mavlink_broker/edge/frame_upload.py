"""Sends what the frame log has of a flight to the edge server, beside the vehicle's own log of it.

The frames are copied out of the frame log's files into a temporary one, which is sent part by part:
the edge server knows how much it has, so an interrupted upload continues, also in the next run of
the broker. The files are only appended to, so that a later copy is the same, until the oldest are
deleted; a copy of another size is refused by the edge server and given up.
"""

import tempfile
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import BinaryIO, Final

from mavlink_broker.edge.bounded_http import EdgeConnection
from mavlink_broker.edge.log_upload import LogUploader
from mavlink_broker.effects import (
    BeginLog,
    FindLogs,
    FramesNotSent,
    FramesOutcome,
    FrameSpan,
    FramesSent,
    LogJob,
    LogJobDone,
    LogJobFailed,
    LogRequest,
    SendFrames,
    SendLogPart,
)
from mavlink_broker.links.frame_log import copy_frames

FORMAT: Final = "tlog"
BEFORE_S: Final = 60.0
"""The frames begin so long before arming: with the upload of the mission and the checks."""
AFTER_S: Final = 2.0
PART_BYTES: Final = 256 << 10


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
