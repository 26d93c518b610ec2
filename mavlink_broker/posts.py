"""The edge server's door as paths and bodies, in one direction: what the broker tells.

Together with `edge_client` the only place that knows the edge server's URLs.
"""

from collections.abc import Mapping
from datetime import datetime
from typing import Final

from afarcloud import wire
from afarcloud.numbers import format_time
from afarcloud.state import Alarm, Battery, MissionReport, Pose, StateVector
from mavlink_broker.effects import Acknowledgement, ForEdge, Report, VehicleUpdate
from mavlink_broker.send_queue import Post, Urgency

_KINDS: Final[Mapping[type[Report], tuple[wire.Kind, Urgency]]] = {
    Alarm: (wire.Kind.ALARM, Urgency.ALARM),
    Pose: (wire.Kind.POSE, Urgency.RESULT),
    Battery: (wire.Kind.BATTERY, Urgency.RESULT),
    StateVector: (wire.Kind.STATE_VECTOR, Urgency.TELEMETRY),
    MissionReport: (wire.Kind.MISSION_REPORT, Urgency.REPORT),
}
_MISSION_LANE: Final = wire.Kind.MISSION_REPORT.value


def post_for(word: ForEdge, *, vehicle_id: int, recorded_at: datetime, key: str) -> Post:
    """Make the request that tells one word; `key` is its idempotency key for good."""
    match word:
        case Acknowledgement():
            return _acknowledgement(word, vehicle_id)
        case VehicleUpdate():
            return _update(word, recorded_at)
        case _:
            return _report(word, recorded_at, key)


def _report(report: Report, recorded_at: datetime, key: str) -> Post:
    kind, urgency = _KINDS[type(report)]
    stamped = report.model_copy(update={"recorded_at": recorded_at})
    return Post(
        method="POST",
        path=f"/{kind.value}/",
        body=wire.write(stamped),
        vehicle_id=report.vehicle_id,
        lane=kind.value,
        urgency=urgency,
        idempotency_key=key,
        may_be_dropped=kind is wire.Kind.STATE_VECTOR,
    )


def _acknowledgement(word: Acknowledgement, vehicle_id: int) -> Post:
    body = {"status": word.status}
    if word.message is not None:
        body["message"] = word.message
    return Post(
        method="POST",
        path=f"/broker/commands/{word.work_id}/ack",
        body=body,
        vehicle_id=vehicle_id,
        lane=_MISSION_LANE if word.status != "done" else "done",
        urgency=Urgency.REPORT,
        needs_registration=False,
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
