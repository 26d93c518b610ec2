"""Effects of a session's step: messages to the vehicle, messages to the edge server, slow jobs.

A session does no input or output; the program's loop applies its effects in order.
"""

from dataclasses import dataclass, field
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


Job: TypeAlias = FetchUrl | ConvertPicture


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


JobOutcome: TypeAlias = Downloaded | ConvertedPicture | JobFailed


Report: TypeAlias = Pose | Battery | StateVector | MissionReport | Alarm | ObservationList | Image


@dataclass(frozen=True, slots=True)
class Result:
    """A report that is the same record whenever it is posted, also by a restarted broker.

    `of` names its cause; the idempotency key is derived from it.
    """

    report: Report
    of: str


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """The answer to a piece of work: `accepted`, `refused` or `done`, and why."""

    work_id: int
    status: str
    message: str | None = None


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
