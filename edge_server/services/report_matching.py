"""Which mission a report is about, and whether it may still be said of it. Pure.

A `mission_id` may be flown again, so the number alone does not say which flight is meant. A report
names its piece of work (`work_id`, `plan_id`), and is then about that one and no other. Without
these it is about the mission that the broker has accepted; a mission that only waits in the queue
is never moved by a number.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from afarcloud.enumerations import Status
from afarcloud.faults import Fault, InvalidError
from afarcloud.state import MissionReport
from afarcloud.wire import write
from edge_server.services.errors import ConflictError
from edge_server.store.work import ACCEPTED, CLOSED, CommandProgress, Work

_STATUS = "mission_status_id"


def find(missions: Sequence[Work], report: MissionReport) -> Work | None:
    """Find the mission that a report is about among those of its vehicle and `mission_id`.

    None means that no such mission is known here, as after the loss of a database.

    Raises:
        ConflictError: if it was cancelled or replaced, or no broker has accepted it.
    """
    if report.work_id is not None or report.plan_id is not None:
        return _named(missions, report)
    ended = [item for item in missions if item.state == CLOSED]
    repeated = next((item for item in ended if _is_repetition(report, item)), None)
    if repeated is not None:
        return repeated
    for found in (
        [item for item in missions if item.state == ACCEPTED],
        ended,
    ):
        if found:
            return found[-1]
    if missions:
        raise _conflict(
            f"mission {report.mission_id} of vehicle {report.vehicle_id} waits in the queue: "
            "no broker has accepted it",
            "mission_id",
            "is the id of a mission that is not accepted",
        )
    return None


def check(mission: Work, commands: Mapping[int, CommandProgress], report: MissionReport) -> None:
    """Hold a report against what is known of its mission, by `command_id`.

    Raises:
        InvalidError: if it names a command that the mission does not have.
        ConflictError: if it contradicts a terminal status, or the mission was ended here.
    """
    unknown = [
        Fault(f"{_path(index)}.command_id", f"mission {report.mission_id} has no such command")
        for index, one in enumerate(report.command_report_array)
        if one.command_id not in commands
    ]
    if unknown:
        raise InvalidError(tuple(unknown))
    has_ended = mission.state == CLOSED
    status = Status(mission.status_id or Status.NOT_STARTED)
    if has_ended and mission.report is None:
        raise _conflict(
            f"mission {report.mission_id} was ended here: {mission.message}", _STATUS, "has ended"
        )
    if has_ended and report.mission_status_id != status:
        raise _conflict(
            f"mission {report.mission_id} is {status.name}, for good",
            _STATUS,
            f"contradicts {status.name}",
        )
    for index, one in enumerate(report.command_report_array):
        known = Status(commands[one.command_id].status_id)
        if known.is_terminal and _contradicts(one.command_status_id, known, has_ended=has_ended):
            raise _conflict(
                f"command {one.command_id} of mission {report.mission_id} is {known.name}, "
                "for good",
                f"{_path(index)}.command_status_id",
                f"contradicts {known.name}",
            )


def _contradicts(said: Status, known: Status, *, has_ended: bool) -> bool:
    """Whether a status speaks against a terminal one.

    The end of a mission ends the commands that nobody reported as ended: the report that ended it
    may say of these that they are open, and may be repeated.
    """
    return said != known and (said.is_terminal or not has_ended)


def _named(missions: Sequence[Work], report: MissionReport) -> Work | None:
    of_plan = [item for item in missions if report.plan_id in {None, item.plan_id}]
    found = [item for item in of_plan if report.work_id in {None, item.id}]
    if found:
        return found[-1]
    if report.plan_id is not None and of_plan:
        raise _conflict(
            f"work {report.work_id} is no longer here: the mission was cancelled or replaced",
            "work_id",
            "was cancelled or replaced",
        )
    return None


def _is_repetition(report: MissionReport, mission: Work) -> bool:
    """Whether an ended mission has been told this very report; one without a mark may be new."""
    has_mark = report.session_id is not None or report.recorded_at is not None
    said: dict[str, Any] = write(report)
    return has_mark and mission.report == said


def _path(index: int) -> str:
    return f"command_report_array.{index}"


def _conflict(message: str, path: str, fault: str) -> ConflictError:
    return ConflictError(message, (Fault(path, fault),))
