"""What the broker sends to the edge server: paths, bodies, lanes and idempotency keys.

Together with `client` the only module that knows the edge server's endpoints.
"""

import hashlib
from collections.abc import Mapping
from datetime import datetime
from typing import Final

from afarcloud import wire
from afarcloud.numbers import format_time
from afarcloud.state import (
    Alarm,
    Battery,
    Image,
    MissionReport,
    ObservationList,
    Pose,
    StateVector,
)
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.effects import Acknowledgement, EdgeMessage, Report, Result, VehicleUpdate

_KINDS: Final[Mapping[type[Report], tuple[wire.Kind, Urgency]]] = {
    Alarm: (wire.Kind.ALARM, Urgency.ALARM),
    Pose: (wire.Kind.POSE, Urgency.RESULT),
    ObservationList: (wire.Kind.OBSERVATION, Urgency.RESULT),
    Battery: (wire.Kind.BATTERY, Urgency.RESULT),
    Image: (wire.Kind.IMAGE, Urgency.PICTURE),
    StateVector: (wire.Kind.STATE_VECTOR, Urgency.TELEMETRY),
    MissionReport: (wire.Kind.MISSION_REPORT, Urgency.REPORT),
}
VEHICLE_LANE: Final = "vehicle"
"""Of the updates of a vehicle."""
_MISSION_LANE: Final = wire.Kind.MISSION_REPORT.value
_WORK: Final = "/broker/commands/"
_HASH_LENGTH: Final = 48
"""Of a key's 64 characters; the kind's name and a dash precede it."""
_MAX_MESSAGE: Final = 1000
"""Characters that the edge server accepts as an acknowledgement's message."""


def post_for(message: EdgeMessage, *, vehicle_id: int, recorded_at: datetime, key: str) -> Post:
    """Make the request that carries a message; `key` is its idempotency key, also in retries."""
    match message:
        case Acknowledgement():
            return _acknowledgement(message, vehicle_id)
        case VehicleUpdate():
            return _vehicle_update(message, recorded_at)
        case Result():
            return _result(message, recorded_at)
        case _:
            return _report(message, recorded_at, key)


def is_acknowledgement(post: Post) -> bool:
    """Whether a post answers work, rather than reports on a vehicle."""
    return post.path.startswith(_WORK)


def _report(report: Report, recorded_at: datetime, key: str) -> Post:
    kind, urgency = _KINDS[type(report)]
    return Post(
        method="POST",
        path=f"/{kind.value}/",
        body=wire.write(_with_time(report, recorded_at)),
        vehicle_id=report.vehicle_id,
        lane=kind.value,
        urgency=urgency,
        idempotency_key=key,
        may_be_dropped=kind is wire.Kind.STATE_VECTOR,
    )


def _result(result: Result, recorded_at: datetime) -> Post:
    """Make a post that a restarted broker makes again under the same key.

    Except for pictures it precedes the mission report that calls the command finished: a broker
    that is killed in between has either sent it, or has the command to finish again.
    """
    kind, _ = _KINDS[type(result.report)]
    digest = hashlib.sha256(result.of.encode()).hexdigest()[:_HASH_LENGTH]
    post = _report(result.report, recorded_at, f"{kind.value}-{digest}")
    post.may_be_duplicate = True
    if kind is not wire.Kind.IMAGE:
        post.lane, post.urgency = _MISSION_LANE, Urgency.REPORT
    return post


def _with_time(report: Report, recorded_at: datetime) -> Report:
    """Set the time of the report; observations of a vehicle without a clock get the same time."""
    update: dict[str, object] = {"recorded_at": recorded_at}
    if isinstance(report, ObservationList):
        now_s = int(recorded_at.timestamp())
        update["observation_array"] = tuple(
            one if one.result_time else one.model_copy(update={"result_time": now_s})
            for one in report.observation_array
        )
    return report.model_copy(update=update)


def _acknowledgement(acknowledgement: Acknowledgement, vehicle_id: int) -> Post:
    status = acknowledgement.status
    body = {"status": status}
    if acknowledgement.message is not None:
        body["message"] = acknowledgement.message[:_MAX_MESSAGE]
    return Post(
        method="POST",
        path=f"{_WORK}{acknowledgement.work_id}/ack",
        body=body,
        vehicle_id=vehicle_id,
        lane=_MISSION_LANE,  # Also of what is done at once: its acceptance comes first
        urgency=Urgency.REPORT,
        needs_registration=False,
        accepted_work_id=acknowledgement.work_id if status == "accepted" else None,
    )


def _vehicle_update(update: VehicleUpdate, recorded_at: datetime) -> Post:
    return Post(
        method="PUT",
        path=f"/vehicles/{update.vehicle_id}",
        body=update.body | {"recorded_at": format_time(recorded_at)},
        vehicle_id=update.vehicle_id,
        lane=VEHICLE_LANE,
        urgency=Urgency.REGISTRATION,
        needs_registration=False,
        replaces=True,
    )
