"""Correction of a stored report, whether it waits for the cloud or the cloud has rejected it.

The corrected report is a new message of the same record. Changed statuses have the effects of a
new report.
"""

from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import Connection
from ulid import ULID

from afarcloud.enumerations import Status
from afarcloud.faults import Fault
from afarcloud.state import MissionReport, Report
from afarcloud.wire import write
from edge_server.outbox import queue
from edge_server.services import records
from edge_server.services.errors import ConflictError
from edge_server.services.fleet import progress
from edge_server.services.reports import effects
from edge_server.store.connection.database import to_json
from edge_server.store.connection.locks import WORK, Lock
from edge_server.store.rows import telemetry, work
from edge_server.store.rows.telemetry import Record

_COMMANDS: Final = "command_report_array"
_FAULT: Final = ("mission_id", "alarm_type_id", "alarm_code_id")
"""Fields that identify the fault of an alarm; another `message` is the same fault."""
_MOST_BEHIND: Final = 100_000


def locks_of(report: Report) -> tuple[Lock, ...]:
    """Return the locks of a correction."""
    return (WORK,) if effects.moves_work(report, ()) else ()


def apply(connection: Connection, old: Record, report: Report, now: float) -> Record:
    """Replace the report of a stored record, queued or dead letter.

    Raises:
        InvalidError, ConflictError: if it is about another vehicle, mission or plan than before,
            or it does not fit its mission's state.
    """
    before = old.body()
    if isinstance(report, MissionReport) and report.plan_id is None:
        report = report.model_copy(update={"plan_id": before.get("plan_id")})
    body = records.for_cloud(write(report))
    _check_about_the_same(before, body)
    message_id = str(ULID())
    new = old._replace(message_id=message_id, payload=to_json({**body, "message_id": message_id}))
    telemetry.replace(connection, old.id, message_id=message_id, payload=new.payload)
    queue.requeue(connection, old.id)
    if isinstance(report, MissionReport):
        _apply_correction(connection, old, new, report, now)
    elif any(before.get(name) != body.get(name) for name in _FAULT):
        effects.apply(connection, report, now, ())
    return new


def _check_about_the_same(old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """Check that a correction is about the same objects; raises ConflictError."""
    wrong = [
        name
        for name in ("vehicle_id", "mission_id", "plan_id")
        if name in old and name in new and old[name] != new[name]
    ]
    if wrong:
        raise ConflictError(
            f"a report cannot change its {' and '.join(wrong)}",
            tuple(Fault(name, "cannot be changed") for name in wrong),
        )


def _apply_correction(
    connection: Connection, old: Record, new: Record, report: MissionReport, now: float
) -> None:
    """Apply the effects of changed statuses, as of a new report.

    Raises:
        InvalidError, ConflictError: if they do not fit the mission's state, a later report was
            accepted, another one has reported its end, or the cloud may have a later one.
    """
    work.note_new_end(connection, report.vehicle_id, report.mission_id, old.id, new.message_id)
    before, after = old.body(), new.body()
    if all(before[name] == after[name] for name in ("mission_status_id", _COMMANDS)):
        if report.work_id is not None or before.get("plan_id") != report.plan_id:
            progress.find(connection, report)  # It names more than before, which has to fit
        _check_before_later(connection, old, report)
        return
    change = effects.apply(connection, report, now, ())
    was = Status(before["mission_status_id"])
    if change is None and was.is_terminal:
        is_allowed = was == report.mission_status_id
    elif change is None:
        is_allowed = _is_last(connection, old, report.mission_id)
    elif change.is_repetition:
        is_allowed = change.mission.end_record in {old.id, None}
    else:
        is_allowed = _is_last(connection, old, report.mission_id)
    if not is_allowed:
        raise ConflictError(
            f"mission {report.mission_id} has a later report that contradicts this correction",
            (Fault("mission_status_id", "contradicts a later report"),),
        )
    _check_before_later(connection, old, report)
    if change is not None and change.ended:
        work.note_end(connection, change.mission.id, new.id, new.message_id)


def _check_before_later(connection: Connection, old: Record, report: MissionReport) -> None:
    """Check that the correction cannot reach the cloud behind a later report of the mission."""
    mission = progress.find(connection, report)
    is_behind_end = (
        mission is not None
        and mission.end_record not in {None, old.id}
        and telemetry.get(connection, old.kind, mission.end_record or 0) is None
    )
    if is_behind_end or queue.was_sent_after(connection, old.id, old.vehicle_id, report.mission_id):
        raise ConflictError(
            f"a later report of mission {report.mission_id} was sent to the cloud already",
            (Fault("mission_id", "has a later report that was sent"),),
        )


def _is_last(connection: Connection, record: Record, mission_id: int) -> bool:
    """Whether no later stored report is about a mission."""
    behind = telemetry.page(
        connection,
        record.kind,
        after_id=record.id,
        limit=_MOST_BEHIND,
        vehicle_id=record.vehicle_id,
        since_s=0.0,
    )
    return all(one.body()["mission_id"] != mission_id for one in behind)
