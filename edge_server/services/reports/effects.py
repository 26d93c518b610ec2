"""The effects of a report besides storing it: it changes missions and holds vehicles.

They happen in the transaction that stores the report, under the locks of `locks_of`.
"""

from collections.abc import Collection, Iterable

from sqlalchemy import Connection

from afarcloud.state import Alarm, MissionReport, Report, StateVector
from afarcloud.wire import Kind
from edge_server.services import post_idempotency
from edge_server.services.context import Context
from edge_server.services.fleet import progress, vehicle_holds
from edge_server.services.fleet.progress import Change
from edge_server.store.connection.locks import WORK, Lock, of_stream
from edge_server.store.rows import work
from edge_server.store.rows.idempotency import Answered
from edge_server.store.rows.work import PossibleFlight, Work


def locks_of(report: Report, kind: Kind, flights: Collection[int]) -> tuple[Lock, ...]:
    """Return the locks of a report: the end of its stream, and work that it may change."""
    stream = of_stream(report.vehicle_id, kind.value)
    return (WORK, stream) if moves_work(report, flights) else (stream,)


def new_flights(context: Context, reports: Iterable[Report], now: float) -> frozenset[int]:
    """Return the vehicles whose state vectors among these show a flight that is not known yet.

    State vectors are many and few show something new, so this is checked before the transaction.
    They were not measured during a mission that is accepted in between.
    """
    in_the_air = [
        one for one in reports if isinstance(one, StateVector) and vehicle_holds.is_in_the_air(one)
    ]
    if not in_the_air:
        return frozenset()
    missions = context.not_flown.get(lambda: _read_not_flown(context, now))
    return vehicle_holds.new_flights(missions, in_the_air, now)


def _read_not_flown(context: Context, now: float) -> list[PossibleFlight]:
    """Read the missions that a state vector may show in flight, however late it arrives."""
    with context.database.read() as connection:
        return work.not_flown(connection, ended_since=now - post_idempotency.KEPT_S)


def moves_work(report: Report, flights: Collection[int]) -> bool:
    """Whether a report may change a mission, or hold its vehicle."""
    if isinstance(report, StateVector):
        return report.vehicle_id in flights
    is_about_mission = isinstance(report, Alarm) and report.mission_id is not None
    return is_about_mission or isinstance(report, MissionReport)


def apply(
    connection: Connection, report: Report, now: float, flights: Collection[int]
) -> Change | None:
    """Apply the effects of a report; returns the change that a mission report has made.

    Raises:
        InvalidError, ConflictError: as `progress.apply`; nothing has changed.
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
    """Apply the effects that a report has even if it is refused."""
    if isinstance(report, MissionReport):
        vehicle_holds.after_refused_report(connection, report, now)


def end_of(mission: Work, kind: str, sha256: bytes) -> Answered | None:
    """Return the answer to the report that ended a mission, for a repetition of it."""
    if mission.end_record is None or mission.ended_at is None:
        return None
    return Answered(kind, sha256, mission.end_record, mission.end_message_id, mission.ended_at)
