"""How the journal stores the recovery record of a vehicle.

A record is a line with version and checksum, then JSON; only a whole one of this version counts.

    farm-journal 1 <SHA-256 of the rest, hexadecimal>
    {"system": 1, "uid": "", ...}

JournalError  a record that cannot be encoded or decoded
"""

import hashlib
import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
)

from afarcloud.enumerations import EventType
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import Items, OverriddenParameter, OverriddenPlan
from mavlink_broker.microservices.mission_protocol import FENCE, MAX_ITEMS, RALLY
from mavlink_broker.planning.situation import Pose
from mavlink_broker.vehicle.recovery_state import (
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecoveryRecord,
    VehicleIdentity,
)

VERSION: Final = 1
MAX_BYTES: Final = 4_000_000
_MARK: Final = "farm-journal"

A = TypeVar("A")
B = TypeVar("B")

_Name = Annotated[str, StringConstraints(pattern=r"^[\x21-\x7e]{1,16}$")]
_Text = Annotated[str, StringConstraints(max_length=4000)]
_Degrees = Annotated[float, Field(ge=-214.0, le=214.0, allow_inf_nan=False)]
"""The range of an integer of a mission item; a vehicle's own items are not limited further."""
_Number = Annotated[float, Field(allow_inf_nan=False)]
_Single = Annotated[float, Field(ge=-3.5e38, le=3.5e38, allow_inf_nan=False)] | None
"""A float of a message; None means NaN."""
_Count = Annotated[int, Field(ge=0, lt=2**31)]


class JournalError(Exception):
    """A record that cannot be encoded or decoded."""


class _Row(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class _Item(_Row):
    command: Annotated[int, Field(ge=0, lt=2**16)]
    frame: Annotated[int, Field(ge=0, lt=2**8)]
    parameters: tuple[_Single, _Single, _Single, _Single]
    latitude: _Degrees
    longitude: _Degrees
    altitude: _Single
    fifth: Annotated[int, Field(ge=-(2**31), lt=2**31)] = 0


class _Plan(_Row):
    before: tuple[_Item, ...]
    placed: tuple[_Item, ...] | None


class _Value(_Row):
    before: _Number
    placed: Annotated[tuple[_Number, ...], Field(max_length=64)]


class _Pose(_Row):
    latitude: _Degrees
    longitude: _Degrees
    altitude: _Number
    heading: _Number


class _Return(_Row):
    mission: _Text
    reason: _Text
    noted: _Number | None = None


def _check_kind(number: int) -> int:
    """Refuse an event that ends no mission; raises ValueError."""
    if not EventType(number).ends_mission:
        raise ValueError("ends no mission")
    return number


class _Abort(_Row):
    work: _Count
    identity: _Text | None = None
    kind: Annotated[int, AfterValidator(_check_kind)]  # `event_type_id`
    point: _Pose | None = None
    noted: _Number | None = None


class _Live(_Row):
    name: _Text
    is_agreed: bool
    began: _Number | None
    going: _Number | None
    start: _Pose | None
    start_s: _Number | None = None
    steps: _Count
    was_left: bool = False


class _Document(_Row):
    system: Annotated[int, Field(ge=1, le=255)]
    uid: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{0,36}$")]
    fence: _Plan | None = None
    rally: _Plan | None = None
    values: dict[_Name, _Value] = {}
    borrowed: dict[_Name, _Value] = {}
    hover: _Pose | None = None
    hover_mode: _Text | None = None
    descent: _Text | None = None
    descent_s: _Number | None = None
    homeward: _Return | None = None
    abort: _Abort | None = None
    live: _Live | None = None
    started: _Text | None = None
    started_s: _Number | None = None
    has_flown: bool = False
    paused: _Text | None = None
    is_tracking: bool = False
    has_camera: bool = False
    healthy: tuple[_Text, ...] = ()
    armed_s: _Number | None = None
    arming_s: _Number | None = None
    foreign_order: tuple[_Count, _Count] | None = None
    is_disarmed_by_others: bool = False
    taken_mode: _Text | None = None
    shows_manual: bool = False


_AS_NOTED: Final = (
    "hover_mode",
    "descent",
    "descent_s",
    "has_flown",
    "paused",
    "is_tracking",
    "has_camera",
    "healthy",
    "armed_s",
    "arming_s",
    "foreign_order",
    "is_disarmed_by_others",
    "taken_mode",
    "shows_manual",
)
"""Fields of a record that have the same name and value in its document."""


def _as_noted(source: object) -> dict[str, Any]:
    return {name: getattr(source, name) for name in _AS_NOTED}


def encode(identity: VehicleIdentity, record: RecoveryRecord) -> bytes:
    """Encode a record.

    Raises:
        JournalError: if it could not be decoded again.
    """
    try:
        document = _Document(
            system=identity.system,
            uid=identity.uid,
            fence=_if_any(_plan, record.plans.get(FENCE)),
            rally=_if_any(_plan, record.plans.get(RALLY)),
            values=_values(record.values),
            borrowed=_values(record.borrowed),
            hover=_if_any(_pose, record.hover),
            homeward=_if_any(_return, record.pending_return),
            abort=_if_any(_abort, record.abort),
            live=_if_any(_live, record.live),
            started=record.segment,
            started_s=record.segment_s,
            **_as_noted(record),
        )
    except ValidationError as error:
        raise JournalError(_first(error)) from error
    body = document.model_dump_json(exclude_defaults=True).encode()
    head = f"{_MARK} {VERSION} {hashlib.sha256(body).hexdigest()}\n".encode()
    if len(head) + len(body) > MAX_BYTES:
        raise JournalError(f"it is larger than {MAX_BYTES} bytes")
    return head + body


def decode(data: bytes) -> tuple[VehicleIdentity, RecoveryRecord]:
    """Decode a record.

    Raises:
        JournalError: if the bytes are not a valid record.
    """
    head, _, body = data.partition(b"\n")
    words = head.split(b" ")
    if len(words) != 3 or words[0] != _MARK.encode():
        raise JournalError("it does not begin like a recovery record")
    if words[1] != str(VERSION).encode():
        raise JournalError(f"its version is {words[1][:20]!r}, not {VERSION}")
    if words[2] != hashlib.sha256(body).hexdigest().encode():
        raise JournalError("its checksum is wrong: it is incomplete or was changed")
    try:
        document = _Document.model_validate_json(body)
    except ValidationError as error:
        raise JournalError(_first(error)) from error
    return VehicleIdentity(document.system, document.uid), _record(document)


def _record(document: _Document) -> RecoveryRecord:
    rows = {FENCE: document.fence, RALLY: document.rally}
    return RecoveryRecord(
        plans={kind: _read_plan(row) for kind, row in rows.items() if row is not None},
        values=_read_values(document.values),
        borrowed=_read_values(document.borrowed),
        hover=_if_any(_read_pose, document.hover),
        pending_return=_if_any(_read_return, document.homeward),
        abort=_if_any(_read_abort, document.abort),
        live=_if_any(_read_live, document.live),
        segment=document.started,
        segment_s=document.started_s,
        **_as_noted(document),
    )


def _if_any(change: Callable[[A], B], value: A | None) -> B | None:
    return None if value is None else change(value)


def _plan(plan: OverriddenPlan) -> _Plan:
    return _Plan(before=_rows(plan.before), placed=_if_any(_rows, plan.placed))


def _read_plan(row: _Plan) -> OverriddenPlan:
    return OverriddenPlan(_read_items(row.before), _if_any(_read_items, row.placed))


def _rows(items: Items) -> tuple[_Item, ...]:
    if len(items) > MAX_ITEMS:
        raise JournalError(f"a fence of {len(items)} items is too large for it")
    return tuple(map(_item, items))


def _item(item: MissionItem) -> _Item:
    one, two, three, four = map(_finite, item.parameters)
    return _Item(
        command=int(item.command),
        frame=int(item.frame),
        parameters=(one, two, three, four),
        latitude=item.latitude_deg,
        longitude=item.longitude_deg,
        altitude=_finite(item.altitude_m),
        fifth=item.fifth,
    )


def _read_item(row: _Item) -> MissionItem:
    one, two, three, four = map(_float, row.parameters)
    return MissionItem(
        command=row.command,
        frame=row.frame,
        parameters=(one, two, three, four),
        latitude_deg=row.latitude,
        longitude_deg=row.longitude,
        altitude_m=_float(row.altitude),
        fifth=row.fifth,
    )


def _read_items(rows: tuple[_Item, ...]) -> Items:
    return tuple(map(_read_item, rows))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _float(value: float | None) -> float:
    return math.nan if value is None else value


def _values(values: Mapping[str, OverriddenParameter]) -> dict[str, _Value]:
    return {name: _Value(before=one.before, placed=one.placed) for name, one in values.items()}


def _read_values(rows: Mapping[str, _Value]) -> dict[str, OverriddenParameter]:
    return {name: OverriddenParameter(row.before, row.placed) for name, row in rows.items()}


def _pose(pose: Pose) -> _Pose:
    latitude, longitude, altitude, heading = pose
    return _Pose(latitude=latitude, longitude=longitude, altitude=altitude, heading=heading)


def _read_pose(row: _Pose) -> Pose:
    return Pose(row.latitude, row.longitude, row.altitude, row.heading)


def _return(pending: PendingReturn) -> _Return:
    return _Return(mission=pending.mission, reason=pending.reason, noted=pending.noted_s)


def _read_return(row: _Return) -> PendingReturn:
    return PendingReturn(mission=row.mission, reason=row.reason, noted_s=row.noted)


def _abort(abort: PendingAbort) -> _Abort:
    return _Abort(
        work=abort.work_id,
        identity=abort.identity,
        kind=abort.event_type,
        point=_if_any(_pose, abort.point),
        noted=abort.noted_s,
    )


def _read_abort(row: _Abort) -> PendingAbort:
    point = _if_any(_read_pose, row.point)
    return PendingAbort(
        work_id=row.work,
        identity=row.identity,
        event_type=row.kind,
        point=point,
        noted_s=row.noted,
    )


def _live(live: LiveCommandProgress) -> _Live:
    return _Live(
        name=live.name,
        is_agreed=live.is_accepted,
        began=live.began_s,
        going=live.accepted_s,
        start=_if_any(_pose, live.start),
        start_s=live.start_s,
        steps=live.steps,
        was_left=live.was_left,
    )


def _read_live(row: _Live) -> LiveCommandProgress:
    return LiveCommandProgress(
        name=row.name,
        is_accepted=row.is_agreed,
        began_s=row.began,
        accepted_s=row.going,
        start=_if_any(_read_pose, row.start),
        start_s=row.start_s,
        steps=row.steps,
        was_left=row.was_left,
    )


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc'])) or 'JSON'}: {first['msg']}"
