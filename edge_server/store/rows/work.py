"""The broker's work as rows, and the status of each mission and command.

Statements of frequent requests are made once: SQLAlchemy takes four times as long to make one as to
execute it.
"""

import json
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from sqlalchemy import (
    Connection,
    and_,
    bindparam,
    func,
    insert,
    or_,
    select,
    text,
    update,
)

from afarcloud.enumerations import EventType, Status
from edge_server.store.connection.database import new_id, to_json
from edge_server.store.rows.tables import command, plan, vehicle_hold, withdrawn, work

MISSION = "mission"
STATE_VECTOR = "latest_state_vector"
EVENT = "event"
QUEUED = "queued"
ACCEPTED = "accepted"
CLOSED = "closed"
CLOCK_SLACK_S = 2.0
"""How far the clocks of edge servers that share a database may differ."""


class Work(NamedTuple):
    """One piece of work; the fields from `plan` on are None unless it is a mission."""

    id: int
    kind: str
    vehicle_id: int | None
    sequence_number: int
    state: str
    expires_at: float
    plan: int | None = None
    plan_id: str | None = None
    mission_id: int | None = None
    body: dict[str, Any] | None = None
    status_id: int | None = None
    message: str | None = None
    report: dict[str, Any] | None = None
    held: bool = False
    place: int = 0
    created_at: float = 0.0
    flown: bool = False
    fault: str | None = None
    accepted_at: float | None = None
    ended_at: float | None = None
    end_record: int | None = None
    end_message_id: str | None = None


class CommandProgress(NamedTuple):
    """Status of one command."""

    command_id: int
    status_id: int
    message: str | None


_ADD: Final = insert(work)
_ADD_COMMANDS: Final = insert(command)


def add_mission(
    connection: Connection,
    *,
    plan_row: int,
    body: dict[str, Any],
    now: float,
    expires_at: float,
    held: bool = False,
    place: int = 0,
) -> None:
    """Queue a mission and its commands, none started; a held mission is not published."""
    mission = {
        "kind": MISSION,
        "vehicle_id": body["vehicle_id"],
        "plan": plan_row,
        "mission_id": body["mission_id"],
        "sequence_number": body["sequence_number"],
        "body": to_json(body),
        "state": QUEUED,
        "status_id": 1,
        "created_at": now,
        "expires_at": expires_at,
        "held": held,
        "place": place,
    }
    row = new_id(connection.execute(_ADD, mission))
    connection.execute(
        _ADD_COMMANDS,
        [
            {"work": row, "command_id": item["command_id"], "status_id": 1}
            for item in body["command_array"]
        ],
    )


def add_request(
    connection: Connection,
    *,
    vehicle_id: int | None,
    sequence_number: int,
    now: float,
    expires_at: float,
) -> int:
    """Queue a request for a fresh state vector; returns its id."""
    result = connection.execute(
        insert(work).values(
            kind=STATE_VECTOR,
            vehicle_id=vehicle_id,
            sequence_number=sequence_number,
            state=QUEUED,
            created_at=now,
            expires_at=expires_at,
        )
    )
    return new_id(result)


def add_event(
    connection: Connection, *, body: dict[str, Any], now: float, expires_at: float
) -> int:
    """Queue an event; returns the id of the work."""
    event = {
        "kind": EVENT,
        "vehicle_id": body["vehicle_id"],
        "sequence_number": body["sequence_number"],
        "body": to_json(body),
        "state": QUEUED,
        "status_id": 1,
        "created_at": now,
        "expires_at": expires_at,
    }
    return new_id(connection.execute(_ADD, event))


_QUERY: Final = select(
    *(plan.c.plan_id if name == "plan_id" else work.c[name] for name in Work._fields)
).outerjoin(plan, work.c.plan == plan.c.id)
_GET: Final = _QUERY.where(work.c.id == bindparam("identifier"))


def get(connection: Connection, identifier: int) -> Work | None:
    """Find a piece of work."""
    row = connection.execute(_GET, {"identifier": identifier}).one_or_none()
    return _work(row) if row else None


_UNFINISHED: Final = (
    _QUERY.where(
        work.c.state.in_((QUEUED, ACCEPTED)),
        work.c.id > bindparam("after_id"),
        work.c.held.is_(False),
        work.c.kind != EVENT,
    )
    .order_by(work.c.id)
    .limit(bindparam("limit"))
)
_OF_VEHICLE: Final = work.c.vehicle_id == bindparam("vehicle_id")
_MAY_FLY: Final = or_(
    work.c.kind != MISSION,
    work.c.state == ACCEPTED,
    work.c.vehicle_id.not_in(select(vehicle_hold.c.vehicle_id)),
)
_UNFINISHED_BY: Final = {
    (False, False): _UNFINISHED,
    (True, False): _UNFINISHED.where(_OF_VEHICLE),
    (False, True): _UNFINISHED.where(_MAY_FLY),
    (True, True): _UNFINISHED.where(_OF_VEHICLE, _MAY_FLY),
}
"""By whether it is of one vehicle, and whether it may fly."""


def unfinished(
    connection: Connection,
    *,
    after_id: int = 0,
    vehicle_id: int | None = None,
    limit: int = 1000,
    may_fly: bool = False,
) -> list[Work]:
    """List queued and accepted missions and requests in order, of one vehicle or of all.

    Held missions are left out, and events have a list of their own (`live_events`). `may_fly`
    leaves out the missions that wait for the release of their vehicle.
    """
    values: dict[str, int] = {"after_id": after_id, "limit": limit}
    if vehicle_id is not None:
        values["vehicle_id"] = vehicle_id
    query = _UNFINISHED_BY[vehicle_id is not None, may_fly]
    return [_work(row) for row in connection.execute(query, values)]


_NAMED: Final = _QUERY.where(
    _OF_VEHICLE,
    work.c.mission_id == bindparam("mission_id"),
    work.c.kind == MISSION,
).order_by(work.c.id)


def missions_of(connection: Connection, vehicle_id: int, mission_id: int) -> list[Work]:
    """List a vehicle's missions of this number, ended and held ones too, oldest first."""
    values = {"vehicle_id": vehicle_id, "mission_id": mission_id}
    return [_work(row) for row in connection.execute(_NAMED, values)]


def recent_missions(connection: Connection, *, ended_since: float, limit: int) -> list[Work]:
    """List the missions that have not ended, and the others that ended since a time; newest last.

    If there are more than the limit, the oldest are left out.
    """
    query = _QUERY.where(
        work.c.kind == MISSION,
        or_(work.c.state.in_((QUEUED, ACCEPTED)), work.c.ended_at >= ended_since),
    )
    rows = connection.execute(query.order_by(work.c.id.desc()).limit(limit))
    return [_work(row) for row in rows][::-1]


class PossibleFlight(NamedTuple):
    """A mission that was accepted and is not known to have flown."""

    id: int
    vehicle_id: int
    accepted_at: float
    ended_at: float | None


def not_flown(
    connection: Connection, *, vehicle_id: int | None = None, ended_since: float | None = None
) -> list[PossibleFlight]:
    """List missions that were accepted and are not known to have flown, of one vehicle or of all.

    With `ended_since` missions that ended before it are left out. There may be hundreds, which are
    read while a vehicle flies: without their commands.
    """
    query = select(*(work.c[name] for name in PossibleFlight._fields))
    query = query.where(text("accepted_at IS NOT NULL AND NOT flown"))  # As in the index
    if vehicle_id is not None:
        query = query.where(work.c.vehicle_id == vehicle_id)
    if ended_since is not None:
        query = query.where(or_(work.c.ended_at.is_(None), work.c.ended_at >= ended_since))
    return [PossibleFlight(*row) for row in connection.execute(query.order_by(work.c.id))]


_LIVE_EVENTS: Final = _QUERY.where(
    work.c.kind == EVENT,
    or_(
        and_(
            work.c.state == QUEUED,
            work.c.expires_at > bindparam("now"),
            work.c.created_at <= bindparam("newest"),
        ),
        work.c.state == ACCEPTED,
    ),
    work.c.id > bindparam("after_id"),
).order_by(work.c.id)


def live_events(connection: Connection, now: float, *, after_id: int = 0) -> list[Work]:
    """List the events that may still be carried out, in order; an expired one is not begun.

    An accepted event is listed whatever the clock says of its receipt and of its expiry: only a
    broker can report how it has ended, and one that has read later work does not read it any more.
    """
    times = {"now": now, "newest": now + CLOCK_SLACK_S}
    rows = connection.execute(_LIVE_EVENTS, times | {"after_id": after_id})
    return [_work(row) for row in rows]


def note_mission(connection: Connection, event: Work, mission: Work) -> None:
    """Store which mission an event was about."""
    change(connection, event.id, mission_id=mission.mission_id)


def newest_event_about(connection: Connection, mission: Work) -> Work | None:
    """Find the last event that is done and was noted for a mission."""
    query = _QUERY.where(
        work.c.kind == EVENT,
        work.c.vehicle_id == mission.vehicle_id,
        work.c.mission_id == mission.mission_id,
        work.c.status_id == int(Status.FINISHED),
        work.c.id > mission.id,
    )
    row = connection.execute(query.order_by(work.c.id.desc()).limit(1)).one_or_none()
    return _work(row) if row else None


def has_answered_abort(connection: Connection, mission: Work) -> bool:
    """Whether the broker has carried out or refused an abort that came after an accepted mission.

    By their order instead of their times, since a clock may be set back in between. One that came
    before the mission was accepted has ended it.
    """
    query = _QUERY.where(
        work.c.kind == EVENT,
        work.c.vehicle_id == mission.vehicle_id,
        work.c.id > mission.id,
        work.c.status_id.in_((int(Status.FINISHED), int(Status.FAILED))),
    )
    return any(_is_abort(_work(row).body or {}) for row in connection.execute(query))


def _is_abort(event: dict[str, Any]) -> bool:
    return EventType(event["event_type_id"]).ends_mission


_OVERDUE: Final = _QUERY.where(
    work.c.state.in_((QUEUED, ACCEPTED)),
    work.c.expires_at <= bindparam("now"),
    or_(work.c.state == QUEUED, work.c.kind == STATE_VECTOR),
).order_by(work.c.id)


def overdue(connection: Connection, now: float) -> list[Work]:
    """List work that has expired: missions and events not accepted, and requests not answered."""
    return [_work(row) for row in connection.execute(_OVERDUE, {"now": now})]


_FROM_THE_FUTURE: Final = _QUERY.where(
    work.c.state.in_((QUEUED, ACCEPTED)),
    work.c.created_at > bindparam("newest"),
    or_(work.c.kind == EVENT, and_(work.c.kind == MISSION, work.c.state == QUEUED)),
).order_by(work.c.id)


def from_the_future(connection: Connection, now: float) -> list[Work]:
    """List queued missions and open events that were received after now: the clock was set back."""
    rows = connection.execute(_FROM_THE_FUTURE, {"newest": now + CLOCK_SLACK_S})
    return [_work(row) for row in rows]


def taken_mission_ids(connection: Connection, first: int, last: int) -> set[int]:
    """Return the mission_ids of a range that are taken, by ended and held missions too."""
    query = select(work.c.mission_id).where(
        work.c.kind == MISSION, work.c.mission_id.between(first, last)
    )
    return set(connection.execute(query).scalars())


def has_number(connection: Connection, mission_id: int) -> bool:
    """Whether a mission of this number is here or was withdrawn, whatever its vehicle."""
    if taken_mission_ids(connection, mission_id, mission_id):
        return True
    query = select(withdrawn.c.work_id).where(withdrawn.c.mission_id == mission_id)
    return connection.execute(query.limit(1)).first() is not None


_OF_PLAN: Final = _QUERY.where(work.c.plan == bindparam("plan_row")).order_by(
    work.c.place, work.c.id
)


def of_plan(connection: Connection, plan_row: int) -> list[Work]:
    """List the missions of a plan in the plan's order."""
    return [_work(row) for row in connection.execute(_OF_PLAN, {"plan_row": plan_row})]


_NEWEST: Final = select(func.max(work.c.id))


def newest_id(connection: Connection) -> int:
    """Return the id of the newest work, 0 if there is none."""
    return connection.execute(_NEWEST).scalar_one() or 0


_CHANGE: Final = update(work).where(work.c.id == bindparam("identifier"))


def change(connection: Connection, identifier: int, **columns: Any) -> None:
    """Change columns of a piece of work; a report is given as an object."""
    if columns.get("report") is not None:
        columns["report"] = to_json(columns["report"])
    connection.execute(_CHANGE, {"identifier": identifier, **columns})


def note_end(
    connection: Connection, identifier: int, record_id: int, message_id: str | None
) -> None:
    """Store which report has ended a mission."""
    change(connection, identifier, end_record=record_id, end_message_id=message_id)


def note_new_end(
    connection: Connection, vehicle_id: int, mission_id: int, record_id: int, message_id: str
) -> None:
    """Store the new message_id of a report if it is the one that has ended a mission."""
    of_mission = and_(work.c.vehicle_id == vehicle_id, work.c.mission_id == mission_id)
    connection.execute(
        update(work)
        .where(of_mission, work.c.end_record == record_id)
        .values(end_message_id=message_id)
    )


_COMMANDS: Final = select(command.c.command_id, command.c.status_id, command.c.message).where(
    command.c.work == bindparam("identifier")
)


def commands(connection: Connection, identifier: int) -> dict[int, CommandProgress]:
    """Return the progress of a mission's commands by command_id."""
    rows = connection.execute(_COMMANDS, {"identifier": identifier})
    return {row.command_id: CommandProgress(*row) for row in rows}


_CHANGE_COMMAND: Final = update(command).where(
    command.c.work == bindparam("identifier"), command.c.command_id == bindparam("number")
)


def change_commands(
    connection: Connection, identifier: int, progress: Sequence[CommandProgress]
) -> None:
    """Store the progress of some of a mission's commands."""
    for item in progress:
        changed = {"status_id": item.status_id, "message": item.message}
        which = {"identifier": identifier, "number": item.command_id}
        connection.execute(_CHANGE_COMMAND, which | changed)


def _work(row: Any) -> Work:
    fields = row._asdict()
    written = {name: json.loads(fields[name] or "null") for name in ("body", "report")}
    return Work(**fields | written)
