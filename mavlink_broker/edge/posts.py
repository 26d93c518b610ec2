"""The edge server's interface as paths and bodies, in one direction: what the broker sends.

Together with `client` the only place that knows the edge server's URLs.
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
from mavlink_broker.effects import Acknowledgement, ForEdge, Report, Result, VehicleUpdate

_KINDS: Final[Mapping[type[Report], tuple[wire.Kind, Urgency]]] = {
    Alarm: (wire.Kind.ALARM, Urgency.ALARM),
    Pose: (wire.Kind.POSE, Urgency.RESULT),
    ObservationList: (wire.Kind.OBSERVATION, Urgency.RESULT),
    Battery: (wire.Kind.BATTERY, Urgency.RESULT),
    Image: (wire.Kind.IMAGE, Urgency.PICTURE),
    StateVector: (wire.Kind.STATE_VECTOR, Urgency.TELEMETRY),
    MissionReport: (wire.Kind.MISSION_REPORT, Urgency.REPORT),
}
_MISSION_LANE: Final = wire.Kind.MISSION_REPORT.value
_WORK: Final = "/broker/commands/"
_MARK_LENGTH: Final = 48
"""Of a key's 64 characters; the kind's name and a dash stand before it."""
_MOST_MESSAGE: Final = 1000
"""Characters that the edge server takes of an acknowledgement's message."""


def post_for(word: ForEdge, *, vehicle_id: int, recorded_at: datetime, key: str) -> Post:
    """Make the request that tells one word; `key` is its idempotency key for good."""
    match word:
        case Acknowledgement():
            return _acknowledgement(word, vehicle_id)
        case VehicleUpdate():
            return _update(word, recorded_at)
        case Result():
            return _result(word, recorded_at)
        case _:
            return _report(word, recorded_at, key)


def is_acknowledgement(post: Post) -> bool:
    """Whether a post answers work, rather than reports on a vehicle."""
    return post.path.startswith(_WORK)


def _report(report: Report, recorded_at: datetime, key: str) -> Post:
    kind, urgency = _KINDS[type(report)]
    return Post(
        method="POST",
        path=f"/{kind.value}/",
        body=wire.write(_stamped(report, recorded_at)),
        vehicle_id=report.vehicle_id,
        lane=kind.value,
        urgency=urgency,
        idempotency_key=key,
        may_be_dropped=kind is wire.Kind.STATE_VECTOR,
    )


def _result(word: Result, recorded_at: datetime) -> Post:
    """Make a post that a restarted broker makes again under the same key.

    But for pictures it goes ahead of the mission's report that calls the command finished: a
    broker that is killed in between has either told it, or has the command to finish again.
    """
    kind, _ = _KINDS[type(word.report)]
    mark = hashlib.sha256(word.of.encode()).hexdigest()[:_MARK_LENGTH]
    post = _report(word.report, recorded_at, f"{kind.value}-{mark}")
    post.may_be_known = True
    if kind is not wire.Kind.IMAGE:
        post.lane, post.urgency = _MISSION_LANE, Urgency.REPORT
    return post


def _stamped(report: Report, recorded_at: datetime) -> Report:
    """Mark when it is told; what a vehicle without a clock has measured, it has measured now."""
    stamp: dict[str, object] = {"recorded_at": recorded_at}
    if isinstance(report, ObservationList):
        now_s = int(recorded_at.timestamp())
        stamp["observation_array"] = tuple(
            one if one.result_time else one.model_copy(update={"result_time": now_s})
            for one in report.observation_array
        )
    return report.model_copy(update=stamp)


def _acknowledgement(word: Acknowledgement, vehicle_id: int) -> Post:
    body = {"status": word.status}
    if word.message is not None:
        body["message"] = word.message[:_MOST_MESSAGE]
    return Post(
        method="POST",
        path=f"{_WORK}{word.work_id}/ack",
        body=body,
        vehicle_id=vehicle_id,
        lane=_MISSION_LANE if word.status != "done" else "done",
        urgency=Urgency.REPORT,
        needs_registration=False,
        accepts=word.work_id if word.status == "accepted" else None,
    )


def _update(word: VehicleUpdate, recorded_at: datetime) -> Post:
    return Post(
        method="PUT",
        path=f"/vehicles/{word.vehicle_id}",
        body=word.body | {"recorded_at": format_time(recorded_at)},
        vehicle_id=word.vehicle_id,
        lane="vehicle",
        urgency=Urgency.REGISTRATION,
        needs_registration=False,
        replaces=True,
    )
