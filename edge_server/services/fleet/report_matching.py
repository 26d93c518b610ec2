"""Which mission a report is about, and whether the mission's state accepts it; pure.

A `mission_id` may be flown again, so it alone does not identify a flight. A report names its piece
of work (`work_id`, `plan_id`), and every number in it has to fit that work. Without these it is
about the mission that the broker has accepted. A report on work that is known to be cancelled,
replaced, not accepted or another vehicle's is refused; on a queued mission a broker may only
report, by its `work_id`, that it refuses it.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from afarcloud.enumerations import Status
from afarcloud.faults import Fault, InvalidError
from afarcloud.state import MissionReport
from afarcloud.wire import write
from edge_server.services.errors import ConflictError
from edge_server.store.rows.work import ACCEPTED, CLOSED, MISSION, QUEUED, CommandProgress, Work

_STATUS = "mission_status_id"
_GONE = "was cancelled or replaced"


class Known(NamedTuple):
    """The stored work that a report may name."""

    missions: Sequence[Work] = ()
    """Of its vehicle and `mission_id`, oldest first, drafts among them."""
    work: Work | None = None
    """Of its `work_id`."""
    of_plan: Sequence[Work] = ()
    """Of its `plan_id`."""
    withdrawn: str | None = None
    """Field of the report that names a cancelled or replaced mission, if it names no other."""
    is_of_others: bool = False
    """Whether other vehicles have, or had, a mission of its `mission_id`."""


def find(known: Known, report: MissionReport) -> Work | None:
    """Find the mission that a report is about.

    None means that none of the named work is known here, as after the loss of a database.

    Raises:
        ConflictError: if its numbers do not fit together, or the work was cancelled or replaced.
    """
    if known.work is not None:
        return _of_work(known.work, report)
    if known.of_plan:
        return _of_plan(known.of_plan, report)
    has_names = report.work_id is not None or report.plan_id is not None
    mission = f"mission {report.mission_id} of vehicle {report.vehicle_id}"
    if known.missions and has_names:
        raise _conflict(
            f"{mission} is here, but neither of plan {report.plan_id} nor as work {report.work_id}",
            "work_id" if report.plan_id is None else "plan_id",
            f"is not that of {mission}",
        )
    if known.missions:
        return _of_number(known.missions, report)
    if known.withdrawn is not None:
        raise _conflict(f"{mission} {_GONE}", known.withdrawn, _GONE)
    if known.is_of_others and not has_names:
        raise _conflict(f"there is no {mission}", "vehicle_id", "is not that of the mission")
    return None


def _of_work(item: Work, report: MissionReport) -> Work:
    given_and_known = {
        "vehicle_id": (report.vehicle_id, item.vehicle_id),
        "mission_id": (report.mission_id, item.mission_id),
        "plan_id": (report.plan_id or item.plan_id, item.plan_id),
    }
    wrong = [name for name, (given, known) in given_and_known.items() if given != known]
    if item.kind != MISSION:
        raise _conflict(f"work {item.id} is no mission", "work_id", "is not that of a mission")
    if wrong:
        raise ConflictError(
            f"work {item.id} is mission {item.mission_id} of vehicle {item.vehicle_id}",
            tuple(Fault(name, f"is not that of work {item.id}") for name in wrong),
        )
    return item


def _of_plan(missions: Sequence[Work], report: MissionReport) -> Work:
    if report.work_id is not None:
        raise _conflict(
            f"work {report.work_id} is no longer of plan {report.plan_id}", "work_id", _GONE
        )
    for item in missions:
        if (item.vehicle_id, item.mission_id) == (report.vehicle_id, report.mission_id):
            return item
    has_number = any(item.mission_id == report.mission_id for item in missions)
    raise _conflict(
        f"plan {report.plan_id} has no mission {report.mission_id} of vehicle {report.vehicle_id}",
        "vehicle_id" if has_number else "mission_id",
        "is not that of a mission of the plan",
    )


def _of_number(missions: Sequence[Work], report: MissionReport) -> Work:
    ended = [item for item in missions if item.state == CLOSED]
    repeated = [item for item in ended if _is_repetition(report, item)]
    accepted = [item for item in missions if item.state == ACCEPTED]
    for found in (repeated, accepted, ended):
        if found:
            return found[-1]
    return missions[-1]


def check(mission: Work, commands: Mapping[int, CommandProgress], report: MissionReport) -> None:
    """Check a report against the state of its mission; `commands` are by `command_id`.

    Raises:
        InvalidError: if it names a command that the mission does not have.
        ConflictError: if no broker has accepted the mission, it was ended here, or the report
            contradicts a terminal status.
    """
    _check_accepted(mission, report)
    unknown = [
        Fault(f"{_path(index)}.command_id", f"mission {report.mission_id} has no such command")
        for index, one in enumerate(report.command_report_array)
        if one.command_id not in commands
    ]
    if unknown:
        raise InvalidError(tuple(unknown))
    has_ended = mission.state == CLOSED
    status = Status(mission.status_id or Status.NOT_STARTED)
    if has_ended and not _was_ended_by_report(mission):
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


def _contradicts(reported: Status, known: Status, *, has_ended: bool) -> bool:
    """Whether a reported status contradicts a terminal one.

    The end of a mission ends its remaining commands: the report that ended it may report these as
    open, and may be repeated.
    """
    return reported != known and (reported.is_terminal or not has_ended)


def _check_accepted(mission: Work, report: MissionReport) -> None:
    """Check that the mission is accepted, or that the report refuses a queued one."""
    if mission.state != QUEUED:
        return
    field = "mission_id" if report.plan_id is None else "plan_id"
    field = field if report.work_id is None else "work_id"
    name = f"mission {mission.mission_id} of vehicle {mission.vehicle_id}"
    if mission.held:
        raise _conflict(f"{name} is of a plan that has not been dispatched", field, "is of a draft")
    begins = any(one.command_status_id.has_begun for one in report.command_report_array)
    if field == "work_id" and report.mission_status_id == Status.FAILED and not begins:
        return
    raise _conflict(
        f"{name} waits in the queue: no broker has accepted it",
        field,
        "is that of a mission that is not accepted",
    )


def _was_ended_by_report(mission: Work) -> bool:
    return mission.report is not None and Status(mission.report[_STATUS]).is_terminal


def _is_repetition(report: MissionReport, mission: Work) -> bool:
    """Whether this report has ended the mission; without session or time it may be a new one."""
    has_mark = report.session_id is not None or report.recorded_at is not None
    document: dict[str, Any] = write(report)
    return has_mark and mission.report == document


def _path(index: int) -> str:
    return f"command_report_array.{index}"


def _conflict(message: str, path: str, fault: str) -> ConflictError:
    return ConflictError(message, (Fault(path, fault),))
