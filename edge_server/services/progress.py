"""How mission reports move missions and commands; pure but for `apply`.

A status only grows: NOT_STARTED, RUNNING, then one terminal status for good. A late or repeated
report changes nothing. When a mission ends, commands that nobody reported ended are ABORTED.
"""

from collections.abc import Iterable, Mapping

from sqlalchemy import Connection

from afarcloud.enumerations import Status
from afarcloud.state import CommandReport, MissionReport
from afarcloud.wire import write
from edge_server.store import work
from edge_server.store.work import CommandProgress, Work


def advances(current: int, reported: int) -> bool:
    """Whether a reported status takes the place of the current one."""
    return not Status(current).is_terminal and reported > current


def advance_commands(
    current: Mapping[int, CommandProgress], reports: Iterable[CommandReport]
) -> dict[int, CommandProgress]:
    """Give the commands that a report changes; unknown command_ids are passed over."""
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
    """Give the commands that are still open, as ABORTED."""
    return {
        identifier: CommandProgress(identifier, Status.ABORTED, known.message or message)
        for identifier, known in current.items()
        if not Status(known.status_id).is_terminal
    }


def apply(connection: Connection, report: MissionReport) -> bool:
    """Move the unfinished mission that a report is about; says whether one ended."""
    mission = _mission_of(connection, report)
    if mission is None or mission.status_id is None:
        return False
    current = work.commands(connection, mission.id)
    changed = advance_commands(current, report.command_report_array)
    status = mission.status_id
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
    )
    return ended


def close(connection: Connection, mission: Work, status: Status, message: str) -> None:
    """End a mission that was never flown: refused by the broker, or expired."""
    current = work.commands(connection, mission.id)
    work.change_commands(connection, mission.id, list(abort_the_rest(current, message).values()))
    work.change(connection, mission.id, state=work.CLOSED, status_id=int(status), message=message)


def _mission_of(connection: Connection, report: MissionReport) -> Work | None:
    open_work = work.unfinished(connection, vehicle_id=report.vehicle_id)
    matching = [item for item in open_work if item.mission_id == report.mission_id]
    return matching[-1] if matching else None
