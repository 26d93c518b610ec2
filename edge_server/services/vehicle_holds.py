"""Holds: after a mission that a fault ended in flight, the queue of its vehicle waits for a person.

What has failed may fail again at the next take-off. A hold is placed in the transaction that keeps
the report or the alarm; until an operator releases the vehicle no mission of it is handed out, and
none is accepted. A mission that failed before it left the ground holds nothing.
"""

from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import Connection

from afarcloud.commands import FLYING
from afarcloud.enumerations import Status
from afarcloud.state import Alarm, MissionReport
from edge_server.services import audit, vehicles
from edge_server.services.attempts import repeatable
from edge_server.services.context import Context
from edge_server.services.errors import ConflictError
from edge_server.services.plan_view import explain
from edge_server.services.progress import Change
from edge_server.store import vehicle_holds, work
from edge_server.store.locks import WORK, of_vehicle
from edge_server.store.vehicle_holds import VehicleHold
from edge_server.store.work import CommandProgress, Work

_BEGUN: Final = frozenset({Status.RUNNING, Status.FINISHED})


def after_report(
    connection: Connection, report: MissionReport, change: Change | None, now: float
) -> None:
    """Hold a vehicle whose mission this report has ended by a fault in flight."""
    if change is None or not change.ended or report.mission_status_id != Status.FAILED:
        return
    statuses = {number: known.status_id for number, known in change.commands.items()}
    finished = {
        one.command_id: int(Status.FINISHED)
        for one in report.command_report_array
        if one.command_status_id == Status.FINISHED
    }
    if has_flown(change.mission, {**statuses, **finished}):
        reason = report.message or "the mission failed in flight"
        _place(connection, change.mission, reason, now)


def after_alarm(connection: Connection, alarm: Alarm, now: float) -> None:
    """Hold a vehicle that raises an alarm on the mission that it flies."""
    if alarm.mission_id is None:
        return
    for mission in work.missions_of(connection, alarm.vehicle_id, alarm.mission_id):
        if mission.state == work.ACCEPTED and has_flown(mission, _statuses(connection, mission)):
            name = f"alarm {int(alarm.alarm_type_id)}/{alarm.alarm_code_id}"
            reason = f"{name}: {alarm.message}" if alarm.message else name
            _place(connection, mission, reason, now)


def has_flown(mission: Work, statuses: Mapping[int, int]) -> bool:
    """Whether a mission has begun to move its vehicle, by the statuses of its commands."""
    commands = (mission.body or {}).get("command_array", [])
    return any(
        entry["command_type_id"] in FLYING and statuses.get(entry["command_id"]) in _BEGUN
        for entry in commands
    )


def check_free(connection: Connection, item: Work) -> None:
    """Let a mission pass whose vehicle is not held; raises ConflictError."""
    if item.vehicle_id is None:
        return
    hold = vehicle_holds.get(connection, item.vehicle_id)
    if hold is not None:
        raise ConflictError(explain(hold))


@repeatable
def release(context: Context, vehicle_id: int, reason: str) -> dict[str, Any]:
    """Let a held vehicle fly again; one that is not held stays as it is.

    Raises:
        NotFoundError: if the vehicle is not registered.
    """
    with context.database.write(WORK, of_vehicle(vehicle_id)) as connection:
        vehicles.shown(connection, vehicle_id)
        if vehicle_holds.get(connection, vehicle_id) is None:
            audit.nothing_new()
        else:
            audit.about(f"vehicles/{vehicle_id}: {reason}")
            vehicle_holds.remove(connection, vehicle_id)
            _queue_anew(connection, vehicle_id)
        shown = vehicles.shown(connection, vehicle_id)
    context.bell.ring()
    return shown


def _statuses(connection: Connection, mission: Work) -> dict[int, int]:
    known: Mapping[int, CommandProgress] = work.commands(connection, mission.id)
    return {number: one.status_id for number, one in known.items()}


def _place(connection: Connection, mission: Work, reason: str, now: float) -> None:
    """Hold a vehicle; a mission behind that one which has not begun waits in the queue again."""
    if mission.vehicle_id is None:
        return
    hold = VehicleHold(mission.vehicle_id, reason, now, mission.mission_id, mission.plan_id)
    vehicle_holds.place(connection, hold)
    for item in work.unfinished(connection, vehicle_id=mission.vehicle_id):
        is_behind = item.kind == work.MISSION and item.id > mission.id
        if is_behind and item.state == work.ACCEPTED and item.report is None:
            work.change(connection, item.id, state=work.QUEUED)


def _queue_anew(connection: Connection, vehicle_id: int) -> None:
    """Give the missions that wait new places in the feed: the broker's cursor is past the old."""
    for item in work.unfinished(connection, vehicle_id=vehicle_id):
        if item.kind == work.MISSION and item.state == work.QUEUED:
            work.queue_anew(connection, item)
