"""What a vehicle's session wants done: frames to the vehicle, words to the edge server.

A session touches neither; the program's loop carries its effects out, in order.
"""

from dataclasses import dataclass, field
from typing import Any, TypeAlias

from afarcloud.state import Alarm, Battery, MissionReport, Pose, StateVector
from mavlink_broker.dialect import Message

Report: TypeAlias = Pose | Battery | StateVector | MissionReport | Alarm


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


ForEdge: TypeAlias = Report | Acknowledgement | VehicleUpdate


@dataclass(slots=True)
class Effects:
    """Everything that one step asks for."""

    messages: list[Message] = field(default_factory=list)
    for_edge: list[ForEdge] = field(default_factory=list)
