"""What follows from a report besides keeping it: missions move, vehicles are held.

It happens in the transaction that keeps the report, under the locks that are asked for here.
"""

from collections.abc import Collection, Iterable

from sqlalchemy import Connection

from afarcloud.state import Alarm, MissionReport, Report, StateVector
from afarcloud.wire import Kind
from edge_server.services import once, progress, vehicle_holds
from edge_server.services.context import Context
from edge_server.services.progress import Change
from edge_server.store import work
from edge_server.store.idempotency import Answered
from edge_server.store.locks import WORK, Lock, of_stream
from edge_server.store.work import Work


def locks_of(report: Report, kind: Kind, flights: Collection[int]) -> tuple[Lock, ...]:
    """What a report needs: the end of its stream, and what it may move besides."""
    stream = of_stream(report.vehicle_id, kind.value)
    return (WORK, stream) if moves_work(report, flights) else (stream,)


def new_flights(context: Context, reports: Iterable[Report], now: float) -> frozenset[int]:
    """Vehicles whose state vectors among these show a flight that is not known so far.

    State vectors are many and hardly one is news, so this is looked at before the transaction. A
    mission that is accepted meanwhile is none that they were measured on.
    """
    in_the_air = [
        one for one in reports if isinstance(one, StateVector) and vehicle_holds.is_in_the_air(one)
    ]
    if not in_the_air:
        return frozenset()
    missions = context.not_flown.get(lambda: _read_not_flown(context, now))
    return vehicle_holds.new_flights(missions, in_the_air, now)


def _read_not_flown(context: Context, now: float) -> list[Work]:
    """Read the missions that a state vector may show to fly, however late it comes."""
    with context.database.read() as connection:
        return work.not_flown(connection, ended_since=now - once.KEPT_S)


def moves_work(report: Report, flights: Collection[int]) -> bool:
    """Whether a report may change a mission, or hold its vehicle."""
    if isinstance(report, StateVector):
        return report.vehicle_id in flights
    is_about_mission = isinstance(report, Alarm) and report.mission_id is not None
    return is_about_mission or isinstance(report, MissionReport)


def apply(
    connection: Connection, report: Report, now: float, flights: Collection[int]
) -> Change | None:
    """Do what follows from a report; gives what a mission report has been taken for.

    Raises:
        InvalidError, ConflictError: nothing being done.
    """
    if isinstance(report, MissionReport):
        change = progress.apply(connection, report, now)
        vehicle_holds.after_report(connection, report, change, now)
        return change
    if isinstance(report, Alarm):
        vehicle_holds.after_alarm(connection, report, now)
    elif isinstance(report, StateVector) and report.vehicle_id in flights:
        vehicle_holds.after_state_vector(connection, report, now)
    return None


def apply_refused(connection: Connection, report: Report, now: float) -> None:
    """Do what follows from a report even though it was refused."""
    if isinstance(report, MissionReport):
        vehicle_holds.after_refused_report(connection, report, now)


def end_of(mission: Work, kind: str, sha256: bytes) -> Answered | None:
    """Give what the report that ended a mission was answered, to a repetition of it."""
    if mission.end_record is None or mission.ended_at is None:
        return None
    return Answered(kind, sha256, mission.end_record, mission.end_message_id, mission.ended_at)
