"""Effects of a session's step: messages to the vehicle, messages to the edge server, slow jobs.

A session does no input or output; the program's loop applies its effects in order.
"""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, TypeAlias

from afarcloud.enumerations import ImageFormat
from afarcloud.state import (
    Alarm,
    Battery,
    Image,
    MissionReport,
    ObservationList,
    Pose,
    StateVector,
)
from mavlink_broker.mavlink.dialect import Message


@dataclass(frozen=True, slots=True)
class FetchUrl:
    """Download a file of at most `limit_bytes` over HTTP."""

    number: int
    url: str
    limit_bytes: int


@dataclass(frozen=True, slots=True)
class ConvertPicture:
    """Convert a picture to a format and size that AFarCloud accepts."""

    number: int
    data: bytes


@dataclass(frozen=True, slots=True)
class FindLogs:
    """List the logs of a vehicle that an earlier run has sent in part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BeginLog:
    """Begin to send a log, or learn how much of it the edge server has.

    The flight is from `started_at` to `ended_at`; `listed_s` is the log's time as the vehicle lists
    it [s since 1970], 0 if unknown.
    """

    name: str
    format: str
    started_at: datetime
    ended_at: datetime
    listed_s: int
    size_bytes: int


@dataclass(frozen=True, slots=True)
class SendLogPart:
    """Send a part of a log."""

    name: str
    offset: int
    data: bytes
    is_last: bool


@dataclass(frozen=True, slots=True)
class DropLog:
    """Delete a log that was sent in part."""

    name: str


LogRequest: TypeAlias = FindLogs | BeginLog | SendLogPart | DropLog


@dataclass(frozen=True, slots=True)
class LogJob:
    """A request to the edge server about the logs of a vehicle."""

    number: int
    vehicle_id: int
    request: LogRequest


@dataclass(frozen=True, slots=True)
class FrameSpan:
    """A flight of which the frame log is sent, and the name under which it is."""

    name: str
    started_at: datetime
    ended_at: datetime


@dataclass(frozen=True, slots=True)
class SendFrames:
    """Send the frames of a vehicle's flight, at most `limit_bytes`, to the edge server.

    Without a flight: complete what an earlier run has begun to send.
    """

    number: int
    vehicle_id: int
    system: int
    flight: FrameSpan | None
    limit_bytes: int


Job: TypeAlias = FetchUrl | ConvertPicture | LogJob | SendFrames


@dataclass(frozen=True, slots=True)
class Downloaded:
    """A file was downloaded."""

    number: int
    data: bytes


@dataclass(frozen=True, slots=True)
class ConvertedPicture:
    """A picture was converted; `frame` is its base64."""

    number: int
    format: ImageFormat
    frame: str
    size_bytes: int


@dataclass(frozen=True, slots=True)
class JobFailed:
    """The job has failed."""

    number: int
    reason: str


@dataclass(frozen=True, slots=True)
class LogState:
    """A log, and how much of it the edge server has."""

    log: BeginLog
    received_bytes: int
    is_complete: bool


@dataclass(frozen=True, slots=True)
class LogJobDone:
    """The logs that a request was about."""

    number: int
    logs: tuple[LogState, ...] = ()


@dataclass(frozen=True, slots=True)
class LogJobFailed:
    """A request about logs has failed; `is_final`: it would fail again."""

    number: int
    reason: str
    is_final: bool
    is_temporary: bool = False  # The edge server is away, or has no room now


@dataclass(frozen=True, slots=True)
class FramesSent:
    """The frames of a flight were sent, `size_bytes` of them."""

    number: int
    size_bytes: int


@dataclass(frozen=True, slots=True)
class FramesNotSent:
    """The frames of a flight were not sent; `is_final` and `is_temporary` as of `LogJobFailed`."""

    number: int
    reason: str
    is_final: bool
    is_temporary: bool = False


LogJobOutcome: TypeAlias = LogJobDone | LogJobFailed
FramesOutcome: TypeAlias = FramesSent | FramesNotSent
JobOutcome: TypeAlias = Downloaded | ConvertedPicture | JobFailed | LogJobOutcome | FramesOutcome


def failed(job: Job, reason: str) -> JobOutcome:
    """Give the outcome of a job that cannot be done at all."""
    if isinstance(job, LogJob):
        return LogJobFailed(job.number, reason, is_final=True)
    if isinstance(job, SendFrames):
        return FramesNotSent(job.number, reason, is_final=True)
    return JobFailed(job.number, reason)


Report: TypeAlias = Pose | Battery | StateVector | MissionReport | Alarm | ObservationList | Image


@dataclass(frozen=True, slots=True)
class Result:
    """A report that is the same record whenever it is posted, also by a restarted broker.

    `of` names its cause; the idempotency key is derived from it. `recorded_monotonic_s`
    is when that was, by the broker's monotonic clock; None: when the report is posted.
    """

    report: Report
    of: str
    recorded_monotonic_s: float | None = None


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """The answer to a piece of work: `accepted`, `refused` or `done`, and why."""

    work_id: int
    status: str
    message: str | None = None
    identity: str | None = None  # Of the work as it was received


@dataclass(frozen=True, slots=True)
class VehicleUpdate:
    """Body of `PUT /vehicles/<vehicle_id>`."""

    vehicle_id: int
    body: dict[str, Any]


EdgeReport: TypeAlias = Report | Result
EdgeMessage: TypeAlias = EdgeReport | Acknowledgement | VehicleUpdate


@dataclass(slots=True)
class Effects:
    """The effects of one step."""

    messages: list[Message] = field(default_factory=list)
    for_edge: list[EdgeMessage] = field(default_factory=list)
    jobs: list[Job] = field(default_factory=list)
