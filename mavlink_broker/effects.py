"""What a vehicle's session wants done: frames to the vehicle, words to the edge server, jobs.

A session touches neither; the program's loop carries its effects out, in order.
"""

from dataclasses import dataclass, field
from typing import Any, TypeAlias

from afarcloud.state import (
    Alarm,
    Battery,
    Image,
    MissionReport,
    ObservationList,
    Pose,
    StateVector,
)
from mavlink_broker.jobs import Job
from mavlink_broker.mavlink.dialect import Message

Report: TypeAlias = Pose | Battery | StateVector | MissionReport | Alarm | ObservationList | Image


@dataclass(frozen=True, slots=True)
class Result:
    """A report that is the same record whenever it is told, also by a broker that was restarted.

    `of` names what it is the result of; the key under which it is told follows from it.
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
    """What `PUT /vehicles/<vehicle_id>` should say."""

    vehicle_id: int
    body: dict[str, Any]


Told: TypeAlias = Report | Result
ForEdge: TypeAlias = Told | Acknowledgement | VehicleUpdate


@dataclass(slots=True)
class Effects:
    """Everything that one step asks for."""

    messages: list[Message] = field(default_factory=list)
    for_edge: list[ForEdge] = field(default_factory=list)
    jobs: list[Job] = field(default_factory=list)
