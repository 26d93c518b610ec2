"""The edge server's JSON: the work that it assigns, and the posts that it takes.

Each piece of work is parsed once. The edge server may assign the same work again: after a restart
on either side the broker gets all unfinished work anew. A post has a path, a body, a lane and an
idempotency key.

WorkError  work that cannot be parsed, with its number if it has one
"""

import hashlib
import re
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, Literal, TypeAlias

from pydantic import AwareDatetime, BaseModel, StrictInt, ValidationError

from afarcloud import wire
from afarcloud.enumerations import EventType
from afarcloud.numbers import format_time
from afarcloud.plan import Event, Geofence, Mission, RallyPoint
from afarcloud.route import Spot
from afarcloud.state import (
    MESSAGE_LENGTH,
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

_ULID: Final = re.compile(r"[0-7][0-9A-HJKMNP-TV-Z]{25}")
MAX_KNOWN_WORK: Final = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class _AnsweredWork:
    """Work that is accepted, refused or done."""

    work_id: int
    was_accepted: bool = False  # By an earlier run of the broker, which did not complete it
    expires_at: float | None = None  # [s] On the broker's clock
    identity: str | None = None  # That the edge server gives it, repeated in each answer

    def answer(self, status: str, message: str | None = None) -> Acknowledgement:
        """Answer this work, and none that has its number with another edge server."""
        return Acknowledgement(self.work_id, status, message, self.identity)


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionWork(_AnsweredWork):
    """A mission to fly; `report` is the last one that the edge server has of it."""

    plan_id: str
    vehicle_id: int
    mission: Mission
    geofence: Geofence | None = None  # Of its plan
    rally_points: tuple[RallyPoint, ...] = ()  # Of its plan
    report: MissionReport | None = None
    reported_at: float | None = None  # [s] Time of that report, on the broker's clock

    @property
    def key(self) -> tuple[int, str, int]:
        """Its identity; the number alone starts again with a new edge server."""
        return self.work_id, self.plan_id, self.mission.mission_id

    @property
    def plan_ulid(self) -> str | None:
        """The plan's id, if it is a ULID, as a report requires."""
        return self.plan_id if _ULID.fullmatch(self.plan_id) else None

    @property
    def rally_spots(self) -> tuple[Spot, ...]:
        """Positions that the vehicle may return to besides home."""
        return tuple(Spot(p.latitude, p.longitude, p.altitude) for p in self.rally_points)

    @property
    def name(self) -> str:
        """The identity as text, without the mission's number."""
        return f"{self.work_id}/{self.plan_id}"


@dataclass(frozen=True, slots=True, kw_only=True)
class StateVectorWork:
    """A request for a fresh state vector of one vehicle, or of all."""

    work_id: int
    vehicle_id: int | None
    expires_at: float | None = None  # [s] On the broker's clock


RESUMED_WITHIN_S: Final = 600.0
"""An event that an earlier run has accepted is carried out until so long after its expiry; later
only if the journal contains it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventWork(_AnsweredWork):
    """An event that interrupts a flight; it is assigned again until it has been answered."""

    event: Event

    @property
    def vehicle_id(self) -> int:
        """The vehicle that it concerns."""
        return self.event.vehicle_id

    def is_same_as(self, other: "EventWork") -> bool:
        """Whether it is the same event; one from the journal has no identity, only its number."""
        unknown = self.identity is None or other.identity is None
        return self.work_id == other.work_id and (unknown or self.identity == other.identity)

    @property
    def is_abort(self) -> bool:
        """Whether it ends a mission."""
        return self.event.event_type_id.ends_mission

    @property
    def aborts_now(self) -> bool:
        """Whether it ends a mission without waiting for the running command."""
        return self.event.event_type_id in {EventType.ABORT_MISSION, EventType.RETURN_HOME}

    def is_too_old(self, now: float) -> bool:
        """Whether an earlier run has accepted it so long ago that it is about another flight."""
        is_late = self.expires_at is not None and now >= self.expires_at + RESUMED_WITHIN_S
        return self.was_accepted and is_late

    def is_expired(self, now: float) -> bool:
        """Whether it is not accepted any more; what an earlier run has accepted never expires."""
        is_late = self.expires_at is not None and now >= self.expires_at
        return is_late and not self.was_accepted


@dataclass(frozen=True, slots=True)
class AcceptanceResult:
    """The edge server's answer to a mission that the broker has accepted.

    A mission whose acceptance is not confirmed must not be flown: it was cancelled, has expired or
    has ended, or the acceptance has failed.
    """

    work_id: int
    is_confirmed: bool
    reason: str = ""  # Why it must not be flown, as the edge server states it
    has_failed: bool = False  # The edge server still waits for the mission: it must be reported


Work: TypeAlias = MissionWork | StateVectorWork | EventWork


class WorkError(Exception):
    """Work that cannot be parsed."""

    def __init__(self, work_id: int | None, reason: str) -> None:
        super().__init__(reason)
        self.work_id = work_id


class _RawWork(BaseModel):
    """The common fields of work; unknown fields are ignored."""

    id: StrictInt
    identity: str | None = None  # None: an older edge server
    expires_at: AwareDatetime | None = None
    edge_time: AwareDatetime | None = None  # At the receipt; None: the broker's clock counts

    def deadline(self, now: float, utc: datetime) -> float | None:
        """Give the time of expiry on the program's clock [s]."""
        if self.expires_at is None:
            return None
        return now + (self.expires_at - (self.edge_time or utc)).total_seconds()


class _RawMission(_RawWork):
    plan_id: str | None = None
    state: Literal["queued", "accepted"] = "queued"
    mission: Mission
    geofence: Geofence | None = None
    rally_points: tuple[RallyPoint, ...] = ()
    report: dict[str, Any] | None = None


class _RawStateVector(_RawWork):
    vehicle_id: StrictInt | None = None
    sequence_number: StrictInt | None = None


class _RawEvent(_RawWork):
    state: Literal["queued", "accepted"] = "queued"
    event: Event


class Inbox:
    """Recognises work that was taken before."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[Any, ...], None] = OrderedDict()

    def read(self, raw: Mapping[str, Any], now: float, utc: datetime) -> Work | None:
        """Parse work; None if it was taken before.

        Raises:
            WorkError: if it cannot be parsed.
        """
        number = raw.get("id")
        work_id = number if isinstance(number, int) and not isinstance(number, bool) else None
        try:
            work, key = _read(raw, now, utc)
        except ValidationError as error:
            first = error.errors()[0]
            path = ".".join(str(step) for step in first["loc"])
            raise WorkError(work_id, f"work cannot be read: {path}: {first['msg']}") from error
        if work is None:
            raise WorkError(work_id, f"work of kind {raw.get('kind')} is not supported")
        return work if self._is_new(key) else None

    def _is_new(self, key: tuple[Any, ...]) -> bool:
        if key in self._known:
            return False
        self._known[key] = None
        if len(self._known) > MAX_KNOWN_WORK:
            self._known.popitem(last=False)
        return True


def _read(raw: Mapping[str, Any], now: float, utc: datetime) -> tuple[Work | None, tuple[Any, ...]]:
    """Give the work and its identity."""
    match raw.get("kind"):
        case "mission":
            mission = _mission(_RawMission.model_validate(raw), now, utc)
            return mission, mission.key
        case "latest_state_vector":
            request = _RawStateVector.model_validate(raw)
            work = StateVectorWork(
                work_id=request.id,
                vehicle_id=request.vehicle_id,
                expires_at=request.deadline(now, utc),
            )
            return work, (request.id, "latest_state_vector", request.sequence_number)
        case "event":
            event = _RawEvent.model_validate(raw)
            event_work = EventWork(
                work_id=event.id,
                event=event.event,
                was_accepted=event.state == "accepted",
                expires_at=event.deadline(now, utc),
                identity=event.identity,
            )
            return event_work, (event.id, "event", repr(event.event), event.identity)
        case _:
            return None, ()


def _mission(raw: _RawMission, now: float, utc: datetime) -> MissionWork:
    report = None if raw.report is None else _report(raw.report)
    reported_at = None if report is None else report.recorded_at
    return MissionWork(
        work_id=raw.id,
        plan_id=str(raw.plan_id),
        vehicle_id=raw.mission.vehicle_id,
        mission=raw.mission,
        geofence=raw.geofence,
        rally_points=raw.rally_points,
        was_accepted=raw.state == "accepted",
        report=report,
        reported_at=None if reported_at is None else now + (reported_at - utc).total_seconds(),
        expires_at=raw.deadline(now, utc),
        identity=raw.identity,
    )


def _report(raw: Mapping[str, Any]) -> MissionReport:
    """Parse the last report; fields that the edge server has added are ignored."""
    known = {name: value for name, value in raw.items() if name in MissionReport.model_fields}
    return MissionReport.model_validate(known)


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
"""Of a key's 64 characters; before it are the name of the kind and a dash."""


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
            return _report_body(message, recorded_at, key)


def is_acknowledgement(post: Post) -> bool:
    """Whether a post answers work, rather than reports on a vehicle."""
    return post.path.startswith(_WORK)


def _report_body(report: Report, recorded_at: datetime, key: str) -> Post:
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
    that is killed in between has either sent it, or has the command to finish again. While the edge
    server has no space for it, it waits in the spool and the report goes first.
    """
    kind, _ = _KINDS[type(result.report)]
    digest = hashlib.sha256(result.of.encode()).hexdigest()[:_HASH_LENGTH]
    post = _report_body(result.report, recorded_at, f"{kind.value}-{digest}")
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
        body["message"] = acknowledgement.message[:MESSAGE_LENGTH]
    if acknowledgement.identity is not None:
        body["identity"] = acknowledgement.identity
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
