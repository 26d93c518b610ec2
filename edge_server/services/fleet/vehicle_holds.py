"""Holds: after a fault has ended a mission in flight, its vehicle's queue waits for an operator.

The same fault may occur again at the next take-off. Two facts are stored of each mission: that it
has flown, and the fault that ended it or will end it. Records arrive in any order; the transaction
that stores the second of the two facts holds the vehicle, once for each fault. Until an operator
releases it, none of its missions is published or accepted. A mission that failed before take-off
holds nothing.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from sqlalchemy import Connection

from afarcloud.commands import FLYING
from afarcloud.enumerations import Status
from afarcloud.state import Alarm, MissionReport, StateVector
from edge_server.services import audit
from edge_server.services.context import Context
from edge_server.services.errors import ConflictError
from edge_server.services.fleet import progress, vehicles
from edge_server.services.fleet.progress import Change
from edge_server.services.retries import retry_on_conflict
from edge_server.store.connection.locks import WORK, of_vehicle
from edge_server.store.rows import vehicle_holds, work, work_removal
from edge_server.store.rows.vehicle_holds import VehicleHold
from edge_server.store.rows.work import PossibleFlight, Work

AIRBORNE_M: Final = 2.0
"""Height above home from which a vehicle flies; below, it may be the drift of a barometer."""


def after_report(
    connection: Connection, report: MissionReport, change: Change | None, now: float
) -> None:
    """Note what an accepted report shows: whether its mission has flown, and whether it failed."""
    if change is None:
        return
    is_failure = change.ended and report.mission_status_id == Status.FAILED
    known = {number: one.status_id for number, one in change.commands.items()}
    _note(
        connection,
        change.mission,
        now,
        flown=_shows_flight(change.mission, report, known),
        fault=(report.message or "the mission failed in flight") if is_failure else None,
    )


def after_refused_report(connection: Connection, report: MissionReport, now: float) -> None:
    """Note what a report that arrived too late shows: whether its mission has flown."""
    try:
        mission = progress.find(connection, report)
    except ConflictError:
        return
    if mission is not None and mission.state != work.QUEUED:
        _note(connection, mission, now, flown=_shows_flight(mission, report, {}))


def after_alarm(connection: Connection, alarm: Alarm, now: float) -> None:
    """Note the fault of an alarm for the mission that it names, under way or ended."""
    if alarm.mission_id is None:
        return
    named = work.missions_of(connection, alarm.vehicle_id, alarm.mission_id)
    under_way = [item for item in named if item.state == work.ACCEPTED]
    ended = [item for item in named if item.state == work.CLOSED and not item.held]
    for mission in (under_way or ended)[-1:]:
        name = f"alarm {int(alarm.alarm_type_id)}/{alarm.alarm_code_id}"
        reason = f"{name}: {alarm.message}" if alarm.message else name
        _note(connection, mission, now, fault=reason)


def is_in_the_air(state: StateVector) -> bool:
    """Whether a vehicle flies, by its height above home."""
    return state.altitude >= AIRBORNE_M


def new_flights(
    missions: Iterable[PossibleFlight], states: Iterable[StateVector], now: float
) -> frozenset[int]:
    """Return vehicles that these states show in flight on a mission not known to have flown."""
    of_vehicle: dict[int, list[PossibleFlight]] = {}
    for mission in missions:
        of_vehicle.setdefault(mission.vehicle_id, []).append(mission)
    return frozenset(
        state.vehicle_id
        for state in states
        if any(_was_under_way(one, state, now) for one in of_vehicle.get(state.vehicle_id, ()))
    )


def after_state_vector(connection: Connection, state: StateVector, now: float) -> None:
    """Note that the mission that was under way when a state in flight was measured has flown."""
    if not is_in_the_air(state):
        return
    for flight in work.not_flown(connection, vehicle_id=state.vehicle_id):
        mission = work.get(connection, flight.id) if _was_under_way(flight, state, now) else None
        if mission is not None:
            _note(connection, mission, now, flown=True)


def _was_under_way(mission: PossibleFlight, state: StateVector, now: float) -> bool:
    """Whether a state was measured between the acceptance of a mission and its end."""
    if mission.vehicle_id != state.vehicle_id:
        return False
    measured_at = now if state.recorded_at is None else state.recorded_at.timestamp()
    return mission.accepted_at <= measured_at and not (
        mission.ended_at is not None and mission.ended_at < measured_at
    )


def note_fault(connection: Connection, mission: Work, reason: str, now: float) -> None:
    """Note the fault that ends a mission."""
    _note(connection, mission, now, fault=reason)


def _shows_flight(mission: Work, report: MissionReport, known: Mapping[int, int]) -> bool:
    """Whether a command that moves the vehicle, or a later one, has begun by these statuses."""
    begun = {number for number, status in known.items() if Status(status).has_begun}
    begun |= {
        one.command_id for one in report.command_report_array if one.command_status_id.has_begun
    }
    moves = False
    for entry in (mission.body or {}).get("command_array", []):
        moves = moves or entry["command_type_id"] in FLYING
        if moves and entry["command_id"] in begun:
            return True
    return False


def _note(
    connection: Connection,
    mission: Work,
    now: float,
    *,
    flown: bool = False,
    fault: str | None = None,
) -> None:
    """Store new facts of a mission; hold its vehicle if it has flown and has a fault."""
    has_flown, reason = mission.flown or flown, mission.fault or fault
    if (has_flown, reason) == (mission.flown, mission.fault):
        return
    work.change(connection, mission.id, flown=has_flown, fault=reason)
    if has_flown and reason is not None:
        _hold(connection, mission, reason, now)


def check_free(connection: Connection, item: Work) -> None:
    """Check that a mission's vehicle is not held; raises ConflictError."""
    if item.vehicle_id is not None:
        vehicles.check_not_held(connection, item.vehicle_id)


@retry_on_conflict
def release(context: Context, vehicle_id: int, reason: str) -> dict[str, Any]:
    """Release a held vehicle; one that is not held stays as it is.

    Raises:
        NotFoundError: if the vehicle is not registered.
    """
    with context.database.write(WORK, of_vehicle(vehicle_id)) as connection:
        now = context.clock()
        vehicles.shown(context, connection, vehicle_id, now)
        if vehicle_holds.get(connection, vehicle_id) is None:
            audit.changes_nothing()
        else:
            audit.about(f"vehicles/{vehicle_id}: {reason}")
            vehicle_holds.remove(connection, vehicle_id)
            _clear_faults(connection, vehicle_id)
            _queue_anew(connection, vehicle_id, now)
        shown = vehicles.shown(context, connection, vehicle_id, now)
    context.work_signal.notify()
    return shown


def _hold(connection: Connection, mission: Work, reason: str, now: float) -> None:
    """Hold a vehicle; an accepted mission behind that one returns to the queue if it has not begun.

    A mission that was accepted after that one had ended stays with its broker, which may be about
    to fly it: the fault of an earlier mission that becomes known late does not concern it.
    """
    if mission.vehicle_id is None:
        return
    hold = VehicleHold(mission.vehicle_id, reason, now, mission.mission_id, mission.plan_id)
    vehicle_holds.place(connection, hold)
    for item in work.unfinished(connection, vehicle_id=mission.vehicle_id):
        is_behind = item.kind == work.MISSION and item.id > mission.id
        has_begun = item.report is not None or item.flown
        if (
            is_behind
            and item.state == work.ACCEPTED
            and not (has_begun or _came_later(item, mission))
        ):
            work.change(connection, item.id, state=work.QUEUED, accepted_at=None)


def _came_later(item: Work, mission: Work) -> bool:
    """Whether a mission was accepted after another one had ended."""
    if item.accepted_at is None or mission.ended_at is None:
        return False
    return item.accepted_at >= mission.ended_at


def _clear_faults(connection: Connection, vehicle_id: int) -> None:
    """Clear known faults, so that the next fault of a mission under way holds its vehicle again."""
    for item in work.unfinished(connection, vehicle_id=vehicle_id):
        if item.kind == work.MISSION and item.fault is not None:
            work.change(connection, item.id, fault=None)


def _queue_anew(connection: Connection, vehicle_id: int, now: float) -> None:
    """Queue waiting missions as new work: the broker's cursor is past their old ids."""
    for item in work.unfinished(connection, vehicle_id=vehicle_id):
        if item.kind == work.MISSION and item.state == work.QUEUED:
            work_removal.queue_anew(connection, item, now)
