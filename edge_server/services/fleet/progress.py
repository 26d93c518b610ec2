"""How mission reports change the status of missions and commands.

A status only advances: NOT_STARTED, RUNNING, then one terminal status, which is final. A repeated
report changes nothing, and one that contradicts a terminal status is refused (`report_matching`).
When a mission ends, its commands without a terminal status become ABORTED.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from sqlalchemy import Connection

from afarcloud.enumerations import Status
from afarcloud.state import CommandReport, MissionReport
from afarcloud.wire import write
from edge_server.services.fleet import report_matching
from edge_server.services.fleet.report_matching import Known
from edge_server.services.fleet.vehicles import check_not_held
from edge_server.store.rows import plans, work, work_removal
from edge_server.store.rows.work import CommandProgress, Work


class Change(NamedTuple):
    """What a report has changed."""

    mission: Work  # As it was before
    commands: Mapping[int, CommandProgress]  # As they were before
    ended: bool  # By this report
    is_repetition: bool  # Of its end


def advances(current: int, reported: int) -> bool:
    """Whether a reported status replaces the current one."""
    return not Status(current).is_terminal and reported > current


def advance_commands(
    current: Mapping[int, CommandProgress], reports: Iterable[CommandReport]
) -> dict[int, CommandProgress]:
    """Return the commands that a report changes, without unknown command_ids."""
    changed = {}
    for report in reports:
        known = current.get(report.command_id)
        if known is None:
            continue
        status = known.status_id
        if advances(status, report.command_status_id):
            status = int(report.command_status_id)
        elif status != report.command_status_id or report.message in {None, known.message}:
            continue
        changed[report.command_id] = CommandProgress(
            report.command_id, status, report.message or known.message
        )
    return changed


def abort_the_rest(
    current: Mapping[int, CommandProgress], message: str | None
) -> dict[int, CommandProgress]:
    """Return the commands without a terminal status, as ABORTED."""
    return {
        identifier: CommandProgress(identifier, Status.ABORTED, known.message or message)
        for identifier, known in current.items()
        if not Status(known.status_id).is_terminal
    }


def apply(connection: Connection, report: MissionReport, now: float) -> Change | None:
    """Change the mission that a report is about; None if no such mission is known here.

    Raises:
        InvalidError: if it names a command that the mission does not have.
        ConflictError: if it contradicts the mission's state; nothing has changed.
    """
    mission = find(connection, report)
    if mission is None:
        return None
    current = work.commands(connection, mission.id)
    _check_free(connection, mission, report)
    report_matching.check(mission, current, report)
    was_open = mission.state != work.CLOSED
    if was_open:
        _move(connection, mission, current, report, now)
    return Change(
        mission,
        current,
        ended=was_open and report.mission_status_id.is_terminal,
        is_repetition=not was_open,
    )


def find(connection: Connection, report: MissionReport) -> Work | None:
    """Find the mission that a report is about; raises as `report_matching.find`."""
    return report_matching.find(_known(connection, report), report)


def _known(connection: Connection, report: MissionReport) -> Known:
    """Read the work that a report names, as far as it is needed to match the report."""
    if report.work_id is not None:
        named = work.get(connection, report.work_id)
        if named is not None:
            return Known(work=named)
    plan = None if report.plan_id is None else plans.find(connection, report.plan_id)
    of_plan = [] if plan is None else work.of_plan(connection, plan.id)
    if of_plan:  # Otherwise the missions of the plan are lost
        return Known(of_plan=of_plan)
    missions = work.missions_of(connection, report.vehicle_id, report.mission_id)
    if missions:
        return Known(missions)
    names = {
        "work_id": report.work_id,
        "plan_id": report.plan_id,
        "mission_id": report.mission_id,
    }
    withdrawn = (
        field
        for field, value in names.items()
        if value is not None
        and work_removal.is_withdrawn(connection, report.vehicle_id, field, value)
    )
    is_of_others = work.has_number(connection, report.mission_id)
    return Known(withdrawn=next(withdrawn, None), is_of_others=is_of_others)


def _check_free(connection: Connection, mission: Work, report: MissionReport) -> None:
    """Check that a report does not begin a queued mission of a held vehicle; it may refuse one.

    Raises:
        ConflictError: if it does, with the reason why the vehicle is held.
    """
    if mission.state == work.QUEUED and report.mission_status_id != Status.FAILED:
        check_not_held(connection, report.vehicle_id)


def _move(
    connection: Connection,
    mission: Work,
    current: Mapping[int, CommandProgress],
    report: MissionReport,
    now: float,
) -> None:
    changed = advance_commands(current, report.command_report_array)
    status = int(mission.status_id or Status.NOT_STARTED)
    if advances(status, report.mission_status_id):
        status = int(report.mission_status_id)
    ended = Status(status).is_terminal
    if ended:
        changed |= abort_the_rest({**current, **changed}, None)
    work.change_commands(connection, mission.id, list(changed.values()))
    work.change(
        connection,
        mission.id,
        state=work.CLOSED if ended else work.ACCEPTED,
        status_id=status,
        message=report.message or mission.message,
        report=write(report),
        accepted_at=mission.accepted_at or now,
        ended_at=now if ended else None,
    )


def close(connection: Connection, mission: Work, status: Status, message: str, now: float) -> None:
    """End a mission that was never flown: refused by the broker, or expired."""
    current = work.commands(connection, mission.id)
    work.change_commands(connection, mission.id, list(abort_the_rest(current, message).values()))
    work.change(
        connection,
        mission.id,
        state=work.CLOSED,
        status_id=int(status),
        message=message,
        ended_at=now,
    )
