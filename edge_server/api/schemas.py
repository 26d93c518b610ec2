"""Types of answers, from which the OpenAPI document is made.

Services build the answers; these types describe them and check nothing. An answer may gain members:
a client ignores those that it does not know.
"""

from datetime import datetime
from typing import Annotated, Any, Final, Literal, Union

from pydantic import BaseModel, ConfigDict, RootModel, conlist, create_model
from pydantic import Field as Member

from afarcloud.enumerations import Status
from afarcloud.plan import Event, Plan
from afarcloud.state import (
    Alarm,
    Battery,
    Image,
    MissionReport,
    ObservationList,
    Pose,
    StateVector,
)
from afarcloud.wire import MODELS, TELEMETRY, Kind
from edge_server.outbox import gaps
from edge_server.services.fleet.event_states import State
from edge_server.services.fleet.vehicles import VehicleState
from edge_server.store.rows.keys import Role, Scope

Id = Annotated[int, Member(ge=1)]
WorkItemState = Literal["queued", "accepted", "closed"]
KINDS_OF_DEAD_LETTERS: Final = (*(kind.value for kind in TELEMETRY), gaps.KIND)
_KEY: Final = r"^[!-~]{1,64}$"


def optional(**limits: Any) -> Any:
    """A member that may be absent, and is never null."""
    return Member(default_factory=lambda: None, **limits)


class Answer(BaseModel):
    """Base of the types; built when the document is first asked for, to save memory."""

    model_config = ConfigDict(extra="ignore", defer_build=True)


class ErrorCode(Answer):
    """An error code of AFarCloud, for one field."""

    code: int
    name: str
    path: str


class LastChange(Answer):
    """Who changed a plan or a field last, and by which operation, such as `plans.put`."""

    by: str
    at: datetime
    action: str


class Error(Answer):
    """What is wrong, with each faulty field by its path."""

    message: str
    detail: dict[str, dict[str, list[str]]]
    errors: list[ErrorCode] = optional()
    changed: LastChange = optional()
    request_id: str = optional()


class Record(Answer):
    """Receipt of a report."""

    id: Id
    message_id: str
    received_at: datetime


def _stored(kind: Kind) -> type[BaseModel]:
    """A report with its receipt; lists of images leave `frame` out."""
    model = MODELS[kind]
    members: dict[str, Any] = {}
    if "frame" in model.model_fields:
        members["frame"] = (model.model_fields["frame"].rebuild_annotation(), optional())
    name = f"Stored{model.__name__}"
    return create_model(name, __base__=(model, Record), __doc__=model.__doc__, **members)


STORED_REPORTS: Final = {kind: _stored(kind) for kind in TELEMETRY}


class PlanWarning(Answer):
    """Something in a plan that is allowed and may be a mistake."""

    path: str = optional()
    message: str = optional()


class CommandState(Answer):
    """Live status of a command."""

    command_id: int
    command_status_id: Status
    command_status_name: str
    message: str = optional()


class MissionState(Answer):
    """Live status of a mission and of its commands."""

    mission_id: int
    vehicle_id: int
    dispatch_state: Literal["held", "queued", "accepted", "closed"]
    waiting: str = optional(description="Why the broker has not received it yet.")
    mission_status_id: Status
    mission_status_name: str = optional()
    message: str = optional()
    command_array: list[CommandState] = optional()


class StoredPlan(Plan, Answer):
    """A plan with the live status of its missions."""

    id: Id
    plan_id: str
    received_at: datetime
    expires_at: datetime
    plan_status_id: Status
    plan_status_name: str
    missions: list[MissionState]  # type: ignore[assignment]  # not as they are received
    warnings: list[PlanWarning]


class StoredEvent(Event, Answer):
    """An event with its live state."""

    id: Id
    event_type_name: str
    received_at: datetime
    expires_at: datetime
    state: State


class Hold(Answer):
    """Why a vehicle's missions wait for an operator."""

    reason: str
    since: datetime
    mission_id: int | None
    plan_id: str | None


class Vehicle(VehicleState, Answer):
    """A vehicle as its broker reported it last; `held` is null unless its missions wait.

    `brokers` are those that are connected: the first serves the vehicle, another one gets no work.
    """

    vehicle_id: Id
    held: Hold | None
    brokers: list[str]
    registered_at: datetime
    updated_at: datetime


class Receipt(Answer):
    """Outcome for one report: its receipt or its error."""

    status: Literal[201, 403, 409, 422, 507]


class Receipts(Answer):
    """Outcomes, in the order of the reports."""

    records: list[Receipt]


def _envelope(kind: Kind) -> type[BaseModel]:
    members: dict[str, Any] = {
        kind.value: (MODELS[kind], ...),
        "idempotency_key": (str, optional(pattern=_KEY)),
    }
    closed = ConfigDict(extra="forbid", defer_build=True)
    return create_model(f"{MODELS[kind].__name__}Envelope", __config__=closed, **members)


_AnyOther = Annotated[Any, Member(description="Anything else: it spoils nothing but its entry.")]
_ENVELOPES: Final = tuple(_envelope(kind) for kind in TELEMETRY)
_OneReport: Any = Union[(*_ENVELOPES, _AnyOther)]
MOST_RECORDS: Final = 500
"""Reports of one request."""
Reports: Final = create_model(
    "Reports",
    __config__=ConfigDict(extra="forbid", defer_build=True),
    __doc__=f"Up to {MOST_RECORDS} reports, each in its envelope.",
    records=(conlist(_OneReport, min_length=1, max_length=MOST_RECORDS), ...),
)


class AnyReport(
    RootModel[Pose | Battery | Image | ObservationList | StateVector | MissionReport | Alarm]
):
    """A report of any kind."""


class DeadLetter(Answer):
    """A report that the cloud has rejected."""

    id: Id
    kind: Annotated[str, Member(json_schema_extra={"enum": [*KINDS_OF_DEAD_LETTERS]})]
    vehicle_id: Id
    attempts: Annotated[int, Member(ge=0)]
    reason: str
    rejected_at: datetime | None
    report: Record


class Retried(Answer):
    """How many dead letters are sent again."""

    retried: Annotated[int, Member(ge=0)]


class AccessKey(Answer):
    """An access key without its secret."""

    prefix: str
    name: str
    role: Role
    scopes: list[Scope]
    vehicle_ids: list[Id] | None
    state: Literal["active", "expired", "revoked"]
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None


class NewAccessKey(AccessKey):
    """An access key with its secret, which is shown once."""

    key: str


class PresentSession(Answer):
    """Who the caller is; `csrf_token` is null for a key."""

    name: str
    role: Role
    csrf_token: str | None
    expires_at: datetime | None


class Account(Answer):
    """An account of a person, without its password."""

    name: str
    role: Role
    has_password: bool
    disabled: bool
    created_at: datetime
    last_sign_in_at: datetime | None


class Session(Answer):
    """A browser in which a person is signed in."""

    id: str
    name: str
    address: str
    created_at: datetime
    expires_at: datetime


class SignInLink(Answer):
    """A link that signs in once; `path` is relative to this server."""

    link: str
    path: str


class Work(Answer):
    """Work for the broker; `cursor` is the `after` of the next request."""

    cursor: Annotated[int, Member(ge=0)]
    commands: list[dict[str, Any]]
    time: datetime


class WorkState(Answer):
    """State of a work item after its acknowledgement."""

    id: Id
    state: WorkItemState


class StateVectorRequest(Answer):
    """A request for a fresh state vector."""

    id: Id
    expires_at: datetime


class Video(Answer):
    """The live picture of a vehicle; `reason` says why its camera cannot be shown."""

    vehicle_id: Id
    url: str
    state: Literal["idle", "connecting", "showing", "failed"]
    reason: str | None


class FarmMap(Answer):
    """A file of the maps folder; `bounds` are west, south, east and north [deg].

    `corners` are latitude and longitude from the north-west on clockwise, of a GeoTIFF.

    One that cannot be shown has a `fault`, and null for everything but its name.
    """

    name: str
    kind: Literal["vector_tiles", "raster_tiles", "picture", "vegetation_index"] | None
    url: str | None
    bounds: list[float] | None
    corners: list[list[float]] | None
    minimum_zoom: int | None
    maximum_zoom: int | None
    fault: str | None


class StoreUse(Answer):
    """Bytes that a store uses, and may use."""

    used_bytes: Annotated[int, Member(ge=0)]
    budget_bytes: Annotated[int, Member(ge=0)]


class ArchiveUse(StoreUse):
    """The flight archive; `days` is how long a flight is kept.

    `lost_reports` were stored and sent, and could not be archived.
    """

    days: float
    flights: Annotated[int, Member(ge=0)]
    is_working: bool
    lost_reports: Annotated[int, Member(ge=0)]


class DiskUse(Answer):
    """The disk of the state folder."""

    free_bytes: Annotated[int, Member(ge=0)]
    total_bytes: Annotated[int, Member(ge=0)]


class Storage(Answer):
    """The program's version, and what its stores, budgets and disk hold."""

    version: str
    database: Literal["sqlite", "postgresql"]
    records: StoreUse
    pictures: StoreUse
    archive: ArchiveUse
    disk: DiskUse


class Backup(Answer):
    """A copy of the database on the edge server's disk."""

    name: str
    path: str
    size_bytes: int
    made_at: datetime


class Backups(Answer):
    """The folder of the backups; `fault` says why this database has none."""

    folder: str
    kept: int
    fault: str | None
    backups: list[Backup]


class Health(Answer):
    """State of the server, of its database and, in `/readyz`, of its relay."""

    status: str
    database: str
    uplink: Literal["stopped", "open", "blocked", "paused", "stalled"] = optional()
    relay_deaths: Annotated[int, Member(ge=0)] = optional()


class OpenApi(Answer):
    """This document."""
