"""The journal: the recovery records of all vehicles, one row per vehicle in the broker's database.

A row is replaced as a whole: a crash leaves the old record or the new one. Its bytes are a line
with version and checksum, then JSON:

    farm-journal 1 <SHA-256 of the rest, hexadecimal>
    {"system": 1, "uid": "", ...}

A row that is not a valid record of this version is set aside and logged.

A thread writes, so that the loop never waits for the disk. Only the newest record of each vehicle
is written. A refusal of the disk is logged once, and the write is retried every five seconds. The
thread only waits: `write_due` is what it does between. A simulation calls it without the thread.

JournalError  a record that cannot be encoded or decoded
"""

import hashlib
import logging
import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Annotated, Any, Final

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
)

from afarcloud.enumerations import EventType
from mavlink_broker.database import Database
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import Items, OverriddenParameter, OverriddenPlan
from mavlink_broker.microservices.mission_protocol import FENCE, MAX_ITEMS, RALLY
from mavlink_broker.planning.situation import Pose
from mavlink_broker.supervision import SupervisedThread, reason_of
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecordUpdate,
    RecoveryRecord,
    VehicleIdentity,
)

VERSION: Final = 1
MAX_BYTES: Final = 4_000_000
_MARK: Final = "farm-journal"
_ALL: Final = "SELECT rowid, system, uid, CAST(data AS BLOB) FROM records"
_LOG = logging.getLogger(__name__)
RETRY_AFTER_S: Final = 5.0
STOP_TIMEOUT_S: Final = 5.0
"""How long an ending program waits for a slow disk."""


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
    """Fields have the names of the record's types; an alias is the name in JSON."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, from_attributes=True)


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
    latitude_deg: _Degrees = Field(alias="latitude")
    longitude_deg: _Degrees = Field(alias="longitude")
    altitude_m: _Number = Field(alias="altitude")
    heading_deg: _Number = Field(alias="heading")


class _Return(_Row):
    mission: _Text
    reason: _Text
    noted_s: _Number | None = Field(default=None, alias="noted")


def _check_kind(number: int) -> int:
    """Refuse an event that ends no mission; raises ValueError."""
    if not EventType(number).ends_mission:
        raise ValueError("ends no mission")
    return number


class _Abort(_Row):
    work_id: _Count = Field(alias="work")
    identity: _Text | None = None
    event_type: Annotated[int, AfterValidator(_check_kind)] = Field(alias="kind")
    point: _Pose | None = None
    noted_s: _Number | None = Field(default=None, alias="noted")


class _Live(_Row):
    name: _Text
    is_accepted: bool = Field(alias="is_agreed")
    began_s: _Number | None = Field(alias="began")
    accepted_s: _Number | None = Field(alias="going")
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
    pending_return: _Return | None = Field(default=None, alias="homeward")
    abort: _Abort | None = None
    live: _Live | None = None
    segment: _Text | None = Field(default=None, alias="started")
    segment_s: _Number | None = Field(default=None, alias="started_s")
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


_TYPES: Final[Mapping[type[Any], Callable[..., Any]]] = {
    _Value: OverriddenParameter,
    _Pose: Pose,
    _Return: PendingReturn,
    _Abort: PendingAbort,
    _Live: LiveCommandProgress,
}
"""The type of a record that a row stores, with the same fields."""


def encode_record(identity: VehicleIdentity, record: RecoveryRecord) -> bytes:
    """Encode a record.

    Raises:
        JournalError: if it could not be decoded again.
    """
    known = {field.name: getattr(record, field.name) for field in fields(record)}
    try:
        plans = {kind: _plan(plan) for kind, plan in known.pop("plans").items()}
        known |= identity._asdict() | {"fence": plans.get(FENCE), "rally": plans.get(RALLY)}
        document = _Document.model_validate(known, by_name=True, by_alias=False)
    except ValidationError as error:
        raise JournalError(_first(error)) from error
    body = document.model_dump_json(exclude_defaults=True, by_alias=True).encode()
    head = f"{_MARK} {VERSION} {hashlib.sha256(body).hexdigest()}\n".encode()
    if len(head) + len(body) > MAX_BYTES:
        raise JournalError(f"it is larger than {MAX_BYTES} bytes")
    return head + body


def decode_record(data: bytes) -> tuple[VehicleIdentity, RecoveryRecord]:
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
        known = dict(_Document.model_validate_json(body))
    except ValidationError as error:
        raise JournalError(_first(error)) from error
    identity = VehicleIdentity(known.pop("system"), known.pop("uid"))
    rows = {FENCE: known.pop("fence"), RALLY: known.pop("rally")}
    plans = {kind: _read_plan(row) for kind, row in rows.items() if row is not None}
    record = RecoveryRecord(plans=plans, **{name: _read(row) for name, row in known.items()})
    return identity, record


def _read(row: Any) -> Any:
    """Give what a row stores."""
    if isinstance(row, dict):
        return {name: _read(one) for name, one in row.items()}
    kind = _TYPES.get(type(row))
    return row if kind is None else kind(**{name: _read(one) for name, one in row})


def _plan(plan: OverriddenPlan) -> _Plan:
    placed = None if plan.placed is None else _rows(plan.placed)
    return _Plan(before=_rows(plan.before), placed=placed)


def _read_plan(row: _Plan) -> OverriddenPlan:
    placed = None if row.placed is None else tuple(map(_read_item, row.placed))
    return OverriddenPlan(tuple(map(_read_item, row.before)), placed)


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


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _float(value: float | None) -> float:
    return math.nan if value is None else value


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc'])) or 'JSON'}: {first['msg']}"


class JournalTable:
    """The recovery records of one broker."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self.folder = database.folder

    def read_all(self) -> dict[VehicleIdentity, RecoveryRecord]:
        """Read every record, also from a disk that takes none; invalid ones are set aside."""
        try:
            rows = self._database.read(_ALL)
        except OSError as error:
            _LOG.warning("the journal cannot be read: %s: %s", self.folder, error.strerror)
            return {}
        records = {}
        for row_id, system, uid, data in rows:
            identity = VehicleIdentity(system, uid)
            try:
                records[identity] = _record_of(identity, data)
            except JournalError as error:
                self._database.set_aside("records", row_id, f"{identity}: {error}")
        return records

    def write(self, identity: VehicleIdentity, record: RecoveryRecord) -> None:
        """Replace the record of a vehicle; an empty one is removed.

        Raises:
            OSError: if the disk refuses; the old record stays.
            JournalError: if it cannot be encoded; the old record stays.
        """
        data = None if record == EMPTY_RECORD else encode_record(identity, record)
        with self._database.change() as rows:
            if data is None:
                rows.execute("DELETE FROM records WHERE system = ? AND uid = ?", identity)
            else:
                rows.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", (*identity, data))


def _record_of(identity: VehicleIdentity, data: bytes) -> RecoveryRecord:
    found, record = decode_record(data)
    if found != identity:
        raise JournalError(f"it is the record of {found}")
    return record


class JournalWriter:
    """The recovery records of one broker, read once, and a thread that writes them, if started."""

    def __init__(self, journal: JournalTable, wake: Callable[[], None]) -> None:
        """Read the records of an earlier run; `wake` ends the loop's sleep."""
        self._journal = journal
        self._wake = wake
        self._known: dict[VehicleIdentity, RecoveryRecord] = journal.read_all()
        self._changed = threading.Condition()
        self._due: dict[VehicleIdentity, RecordUpdate] = {}
        self._refused: dict[VehicleIdentity, RecordUpdate] = {}
        self._settled: list[tuple[VehicleIdentity, int]] = []
        self._is_ending = False
        self._is_refusal_logged = False
        self._stopping = threading.Event()
        self._thread = SupervisedThread("journal", self._run, self._stopping)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def recall(self, identity: VehicleIdentity) -> RecoveryRecord:
        """Give the record of a vehicle."""
        return self._known.get(identity, EMPTY_RECORD)

    def put(self, update: RecordUpdate) -> None:
        """Queue a record to be written; never waits for the disk."""
        self._known[update.identity] = update.record
        with self._changed:
            self._due[update.identity] = update
            self._changed.notify()

    def take_settled(self) -> list[tuple[VehicleIdentity, int]]:
        """Give the updates that were written or refused since the last call."""
        if not self._settled:
            return []
        with self._changed:
            settled, self._settled = self._settled, []
        return settled

    def close(self) -> None:
        """Write the records that wait, if the disk takes them, and end."""
        with self._changed:
            self._is_ending = True
            self._stopping.set()
            self._changed.notify()
        self._thread.join(STOP_TIMEOUT_S)

    def write_due(self) -> bool:
        """Write the records that wait; gives whether the disk has taken all that there are."""
        with self._changed:
            due, self._due = {**self._refused, **self._due}, {}
        for update in due.values():
            self._write(update)
        return not self._refused

    def _run(self) -> None:
        while True:
            with self._changed:
                timeout_s = RETRY_AFTER_S if self._refused else None
                self._changed.wait_for(lambda: self._due or self._is_ending, timeout_s)
                is_ending = self._is_ending
            self.write_due()
            if is_ending and not self._due:
                return

    def _write(self, update: RecordUpdate) -> None:
        try:
            self._journal.write(update.identity, update.record)
        except (OSError, JournalError) as error:
            self._refuse(update, getattr(error, "strerror", None) or str(error))
        except Exception as error:  # noqa: BLE001  # the boundary of one record, logged
            _LOG.exception("the record of %s", update.identity)
            self._refuse(update, reason_of(error))
        else:
            self._refused.pop(update.identity, None)
            if self._is_refusal_logged and not self._refused:
                self._is_refusal_logged = False
                _LOG.warning("%s: the broker's journal can be written again", self._journal.folder)
        with self._changed:
            self._settled.append((update.identity, update.number))
        self._wake()

    def _refuse(self, update: RecordUpdate, reason: str) -> None:
        self._refused[update.identity] = update
        if not self._is_refusal_logged:
            self._is_refusal_logged = True
            _LOG.warning(
                "no journal is kept in %s: %s; make room, or make it writable: a broker that is "
                "killed now forgets accepted aborts until the edge server repeats them, and what "
                "it has to restore on the vehicles",
                self._journal.folder,
                reason,
            )
