"""The broker's work: published in order, acknowledged, never after it has expired."""

import time
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Any, Final

from sqlalchemy import Connection

from afarcloud.annex import in_seconds
from afarcloud.enumerations import EventType, Profile, Status
from afarcloud.numbers import INT32_MAX
from afarcloud.plan import LatestStateVector, Mission
from afarcloud.wire import Kind, write
from edge_server.services import brokers, records
from edge_server.services.context import Context, show_time
from edge_server.services.errors import ConflictError, NotFoundError, TooMuchError
from edge_server.services.fleet import event_states, progress, vehicle_holds, work_identity
from edge_server.services.fleet.event_states import EVENT_STATES, State, Trigger
from edge_server.services.fleet.vehicles import find as find_vehicle
from edge_server.services.fleet.vehicles import why_unheard
from edge_server.services.retries import retry_on_conflict
from edge_server.store.connection.locks import WORK
from edge_server.store.rows import plans, vehicles, work
from edge_server.store.rows.work import CommandProgress, Work
from edge_server.transitions import IllegalTransitionError

REQUEST_LIFETIME_S: Final = 10.0
REQUEST_LIMIT: Final = 32
PAGE: Final = 100
POLL_INTERVAL_S: Final = 5.0
"""A long poll reads the database this often, in case another server's notice is lost."""
EXPIRED: Final = "expired before dispatch"
EXPIRED_EVENT: Final = "expired before the broker accepted it"
AGE_UNKNOWN: Final = "the clock was set back, and the broker had not reported how the event ended"


class Acknowledgement(StrEnum):
    """Status of a piece of work that the broker reports."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    DONE = "done"


@retry_on_conflict
def request_state_vector(context: Context, request: LatestStateVector) -> dict[str, Any]:
    """Queue a request for a fresh state vector; it expires after 10 s.

    Raises:
        NotFoundError: if the vehicle is not registered.
        TooMuchError: if too many requests wait.
    """
    if request.vehicle_id is not None:
        find_vehicle(context, request.vehicle_id)
    now = context.clock()
    with context.database.write(WORK) as connection:
        expire(context, connection, now)
        waiting = work.unfinished(connection)
        if sum(item.kind == work.STATE_VECTOR for item in waiting) >= REQUEST_LIMIT:
            raise TooMuchError(
                f"{REQUEST_LIMIT} requests for a state vector wait, the maximum; try again later"
            )
        identifier = work.add_request(
            connection,
            vehicle_id=request.vehicle_id,
            sequence_number=request.sequence_number,
            now=now,
            expires_at=now + REQUEST_LIFETIME_S,
        )
    context.work_signal.notify()
    return {"id": identifier, "expires_at": show_time(now + REQUEST_LIFETIME_S), **write(request)}


def poll(
    context: Context,
    after_id: int,
    wait_s: float,
    broker: str,
    vehicle_ids: frozenset[int] | None = None,
    is_connected: Callable[[], bool] = lambda: True,
) -> dict[str, Any]:
    """Return the unfinished work after a cursor, waiting for some if there is none.

    Work of vehicles that another broker serves is withheld until that one is gone. `vehicle_ids`
    restricts it to the work of these vehicles; None means every vehicle. The answer names its
    time: work expires by this clock, not by that of the broker. While it waits, the broker counts
    as present for as long as it `is_connected`.

    Raises:
        TooMuchError: if too many requests wait already.
    """
    number = context.contacts.begin_poll(broker)
    if not context.places_to_wait.acquire(blocking=False):
        raise TooMuchError("too many requests wait for work; try again later")
    try:
        deadline = time.monotonic() + wait_s

        def is_waiting() -> bool:
            """Note whether the broker still waits, and return it."""
            if is_connected():
                context.contacts.note_poll(broker)
                return True
            context.contacts.note_cut_off(broker, number)
            return False

        answer = _poll(context, after_id, deadline, broker, vehicle_ids, is_waiting)
        return {**answer, "time": show_time(context.clock())}
    finally:
        context.places_to_wait.release()


def _poll(
    context: Context,
    after_id: int,
    deadline: float,
    broker: str,
    vehicle_ids: frozenset[int] | None,
    is_waiting: Callable[[], bool],
) -> dict[str, Any]:
    """Read until there is work, the time is over or nobody waits any more."""
    while True:
        seen = context.work_signal.count
        answer = _read_work(context, after_id, broker, vehicle_ids)
        if not answer["commands"] and answer["cursor"] > after_id:
            after_id = answer["cursor"]  # A page full of work for others
            continue
        left = deadline - time.monotonic()
        if answer["commands"] or left <= 0 or context.work_signal.closed:
            return answer
        context.work_signal.wait(seen, min(left, POLL_INTERVAL_S))
        if not is_waiting():
            return answer


def _read_work(
    context: Context, after_id: int, broker: str, vehicle_ids: frozenset[int] | None
) -> dict[str, Any]:
    """Return events first, then the rest in order."""
    expire_if_due(context)
    with context.database.read() as connection:
        # A cursor beyond all work belongs to a database that was replaced: start at 0.
        cursor = after_id if after_id <= work.newest_id(connection) else 0
        now = context.clock()
        others = _served_by_others(connection, broker, now)
        cursor = context.contacts.first_released(broker, cursor, others)
        events = work.live_events(connection, now, after_id=cursor)
        found = work.unfinished(connection, after_id=cursor, limit=PAGE, may_fly=True)
        permitted = [
            item
            for item in (*events, *found)
            if vehicle_ids is None or item.vehicle_id is None or item.vehicle_id in vehicle_ids
        ]
        commands = [_show(connection, one) for one in permitted if one.vehicle_id not in others]
        context.contacts.withhold(broker, [one for one in permitted if one.vehicle_id in others])
    context.note_published(max((one["id"] for one in commands), default=0))
    # The rest follows a full page; an event behind it is then returned again.
    seen = found if len(found) == PAGE else [*events, *found]
    return {"cursor": max((item.id for item in seen), default=cursor), "commands": commands}


def _served_by_others(connection: Connection, broker: str, now: float) -> set[int]:
    """Return the vehicles whose work this broker does not get."""
    contacts = vehicles.contacts(connection)
    others = {one for one, contact in contacts.items() if not contact.serves(broker, now)}
    urgent = others & _to_be_stopped(connection, now) if others else others
    return others - {
        one for one in urgent if contacts[one].serves(broker, now, vehicles.URGENT_SERVED_S)
    }


def _to_be_stopped(connection: Connection, now: float) -> set[int | None]:
    """Return the vehicles for which an order that stops the flight waits for a broker."""
    return {
        one.vehicle_id
        for one in work.live_events(connection, now)
        if one.state == work.QUEUED and EventType((one.body or {})["event_type_id"]).stops_flight
    }


def _show(connection: Connection, item: Work) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "id": item.id,
        "kind": item.kind,
        "vehicle_id": item.vehicle_id,
        "expires_at": show_time(item.expires_at),
    }
    if item.kind == work.STATE_VECTOR:
        return {**shown, "sequence_number": item.sequence_number}
    shown["identity"] = work_identity.identity_of(connection, item)
    if item.kind == work.EVENT:
        # With the time of expiry that applies
        event = {**(item.body or {}), "expires_at": shown["expires_at"]}
        return {**shown, "state": item.state, "event": event}
    plan = plans.find(connection, item.plan) if item.plan is not None else None
    body = {} if plan is None else plan.body
    return {
        **shown,
        "plan_id": item.plan_id,
        "state": item.state,
        "mission": _as_flown(connection, _in_seconds(item, body), item),
        "geofence": body.get("geofence"),
        "rally_points": body.get("rally_points", []),
        "report": _whole_report(connection, item),
    }


def _whole_report(connection: Connection, item: Work) -> dict[str, Any] | None:
    """Return the last report of a mission with all of its commands.

    The report of a long mission lists only the commands that have changed; a restarted broker needs
    all of them.
    """
    known = work.commands(connection, item.id)
    if item.report is None or len(item.report["command_report_array"]) == len(known):
        return item.report
    return {**item.report, "command_report_array": _command_reports(known.values())}


def _command_reports(commands: Iterable[CommandProgress]) -> list[dict[str, Any]]:
    return [
        {"command_id": one.command_id, "command_status_id": one.status_id}
        | ({} if one.message is None else {"message": one.message})
        for one in commands
    ]


def _as_flown(
    connection: Connection, mission: dict[str, Any] | None, item: Work
) -> dict[str, Any] | None:
    """Return a mission with the speed to which an event has changed it, for a restarted broker."""
    changed = work.newest_event_about(connection, item) if item.state == work.ACCEPTED else None
    if mission is None or changed is None or changed.body is None:
        return mission
    return {**mission, "maximum_speed": changed.body["maximum_speed"]}


def _in_seconds(item: Work, plan: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the mission with its hold times in seconds, whatever its profile."""
    if plan.get("profile") != Profile.ANNEX:
        return item.body
    return write(in_seconds(Mission.model_validate(item.body)))


@retry_on_conflict
def vehicle_of(context: Context, identifier: int) -> int | None:
    """Return the vehicle of a piece of work; None for any, or if there is no such work."""
    with context.database.read() as connection:
        item = work.get(connection, identifier)
    return item.vehicle_id if item else None


def acknowledge(
    context: Context,
    identifier: int,
    status: Acknowledgement,
    message: str | None,
    broker: str | None = None,
    identity: str | None = None,
) -> dict[str, Any]:
    """Apply an acknowledgement of a piece of work; repeating it changes nothing.

    `identity` is that of the work which the broker has received, None from an older broker.

    Raises:
        NotFoundError: if there is no such work because it was cancelled; it must not be flown.
        ConflictError: if it is other work, has ended with another status or expired; it must not
            be flown.
    """
    with context.database.write(WORK) as connection:
        now = context.clock()
        expire(context, connection, now)
        item = work.get(connection, identifier)
        if item is None:
            raise NotFoundError(f"there is no work {identifier}; it may have been cancelled")
        is_done = status is Acknowledgement.DONE
        work_identity.check(context, connection, item, identity, ends=is_done)
        if broker is not None and item.vehicle_id is not None:
            _check_broker(connection, item.vehicle_id, broker, now)
        if item.kind == work.MISSION:
            _acknowledge_mission(connection, item, status, message, now)
        elif item.kind == work.EVENT:
            _acknowledge_event(connection, item, status, message)
        elif item.state != work.CLOSED:
            state = work.ACCEPTED if status is Acknowledgement.ACCEPTED else work.CLOSED
            work.change(connection, identifier, state=state)
        changed = work.get(connection, identifier)
    context.not_flown.clear()
    context.wake_relay()
    return {"id": identifier, "state": changed.state if changed else work.CLOSED}


def _check_broker(connection: Connection, vehicle_id: int, broker: str, now: float) -> None:
    """Check that no other broker serves a vehicle; from now on this one does."""
    contact = vehicles.contact(connection, vehicle_id)
    is_urgent = vehicle_id in _to_be_stopped(connection, now)
    within_s = vehicles.URGENT_SERVED_S if is_urgent else vehicles.SERVED_S
    if contact is not None and not contact.serves(broker, now, within_s):
        raise ConflictError(
            f"vehicle {vehicle_id} is served by another broker, {contact.broker}, whose last "
            f"request was {abs(now - contact.at):.0f} s ago; a vehicle has one broker: stop one"
        )
    brokers.note_contact(connection, broker, [vehicle_id], now, within_s)


def _acknowledge_mission(
    connection: Connection, item: Work, status: Acknowledgement, message: str | None, now: float
) -> None:
    if item.held:
        raise ConflictError(f"work {item.id} is of a plan that has not been dispatched")
    if status is Acknowledgement.DONE:
        raise ConflictError("a mission is done by its report, not by an acknowledgement")
    if status is Acknowledgement.REFUSED:
        if item.state != work.CLOSED:
            end(connection, item, Status.FAILED, message or "refused by the broker", now)
        elif item.status_id != Status.FAILED:
            raise ConflictError(f"work {item.id} has ended with another status than refused")
    elif item.state == work.CLOSED:
        raise ConflictError(f"work {item.id} has ended: {item.message or 'see the plan'}")
    elif item.state == work.QUEUED:
        vehicle_holds.check_free(connection, item)
        work.change(connection, item.id, state=work.ACCEPTED, accepted_at=now)


def _acknowledge_event(
    connection: Connection, item: Work, status: Acknowledgement, message: str | None
) -> None:
    state = event_states.state_of(item.status_id or Status.NOT_STARTED)
    try:
        following = EVENT_STATES.follow(state, Trigger(status.value))
    except IllegalTransitionError as error:
        raise ConflictError(f"work {item.id}: {error}") from None
    if following != state:
        _move_event(connection, item, following, message)
        if following is State.DONE and (item.body or {}).get("maximum_speed") is not None:
            _note_flown(connection, item)


def _note_flown(connection: Connection, item: Work) -> None:
    """Store which mission flies at the new speed: the first that the broker has accepted."""
    missions = work.unfinished(connection, vehicle_id=item.vehicle_id)
    flown = (m for m in missions if m.kind == work.MISSION and m.state == work.ACCEPTED)
    first = next(flown, None)
    if first is not None and first.id < item.id:
        work.note_mission(connection, item, first)


def _move_event(connection: Connection, item: Work, state: State, message: str | None) -> None:
    work.change(
        connection,
        item.id,
        state=work.ACCEPTED if state is State.ACCEPTED else work.CLOSED,
        status_id=int(event_states.STATUS[state]),
        message=message or item.message,
    )


@retry_on_conflict
def expire_if_due(context: Context) -> None:
    """End what has expired; costs one read if nothing has."""
    now = context.clock()
    with context.database.read() as connection:
        if not (work.overdue(connection, now) or work.from_the_future(connection, now)):
            return
    with context.database.write(WORK) as connection:
        expire(context, connection, now)
    context.wake_relay()


def expire(context: Context, connection: Connection, now: float) -> None:
    """End work that has expired, which is never flown.

    What was received while the clock was ahead is given its right age first.
    """
    for item in work.from_the_future(connection, now):
        if item.kind == work.MISSION:
            _count_from_now(connection, item, now)
        else:
            _correct_event(context, connection, item, now)
    for item in work.overdue(connection, now):
        if item.kind == work.MISSION:
            end(connection, item, Status.ABORTED, EXPIRED, now)
        elif item.kind == work.EVENT:
            why = why_unheard(connection, item.vehicle_id, now)
            _end_event(connection, item, f"{EXPIRED_EVENT}; {why}" if why else EXPIRED_EVENT)
        else:
            work.change(connection, item.id, state=work.CLOSED)


def _correct_event(context: Context, connection: Connection, item: Work, now: float) -> None:
    """Set the receipt of an event to its right time; end one that may be of any age.

    The age of an accepted event does not matter: the broker carries it out already, and how that
    ends is reported. Counted from now, it is handed out to a restarted broker for as long as
    any other.
    """
    age_s = context.event_ages.age_s(item.id)
    if age_s is None and item.state == work.QUEUED:
        _end_event(connection, item, AGE_UNKNOWN)
        return
    created_at = now - (age_s or 0.0)
    expires_at = created_at + item.expires_at - item.created_at
    work.change(connection, item.id, created_at=created_at, expires_at=expires_at)


def _end_event(connection: Connection, item: Work, message: str) -> None:
    """End an event that no broker has accepted in time."""
    before = event_states.state_of(item.status_id or Status.NOT_STARTED)
    _move_event(connection, item, EVENT_STATES.follow(before, Trigger.TOO_LATE), message)


def _count_from_now(connection: Connection, item: Work, now: float) -> None:
    """Set the receipt of a mission to now that was received while the clock was ahead.

    Otherwise it would expire too late by the clock's error. An `expires_at` in the plan itself is
    right in any case.
    """
    plan = plans.find(connection, item.plan) if item.plan is not None else None
    expires_at = item.expires_at
    if plan is not None and plan.body.get("expires_at") is None:
        expires_at = min(expires_at, now + item.expires_at - item.created_at)
        plans.replace(connection, plan._replace(received_at=now, expires_at=expires_at))
    work.change(connection, item.id, created_at=now, expires_at=expires_at)


def end(connection: Connection, item: Work, status: Status, message: str, now: float) -> None:
    """End a mission that no broker flies, with a report to the cloud as its broker would send."""
    progress.close(connection, item, status, message, now)
    if status == Status.FAILED:
        vehicle_holds.note_fault(connection, item, message, now)
    last = item.report or {}
    commands = work.commands(connection, item.id)
    body = {
        "sequence_number": min(last.get("sequence_number", -1) + 1, INT32_MAX),
        "vehicle_id": item.vehicle_id,
        "recorded_at": show_time(now),
        "mission_id": item.mission_id,
        "plan_id": item.plan_id,
        "work_id": item.id,
        "mission_status_id": int(status),
        "command_report_array": _command_reports(commands.values()),
        "message": message,
    }
    records.store(connection, Kind.MISSION_REPORT, body, now)
