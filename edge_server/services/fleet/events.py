"""Events: they interrupt a mission now or not at all; one transaction each.

An event is work for the broker, published before every mission. It expires within seconds: if no
broker has accepted it by `expires_at`, it is never published again. An abort empties the vehicle's
queue in the transaction that stores it, so that no later mission starts behind it.
"""

from collections.abc import Iterable
from typing import Any, Final

from sqlalchemy import Connection

from afarcloud.enumerations import EventType, Status
from afarcloud.faults import Fault, InvalidError
from afarcloud.flyable import speed_fault
from afarcloud.plan import Event
from afarcloud.wire import Kind, write
from edge_server.services import audit, post_idempotency
from edge_server.services.context import (
    Caller,
    Context,
    Precondition,
    show_time,
    unconditionally,
)
from edge_server.services.errors import ConflictError, NotFoundError, TooMuchError
from edge_server.services.fleet import broker_work
from edge_server.services.fleet.event_states import state_of
from edge_server.services.fleet.vehicles import why_unheard
from edge_server.services.retries import retry_on_conflict, retry_with_room
from edge_server.store.connection.database import to_json
from edge_server.store.connection.locks import WORK
from edge_server.store.rows import events, vehicles, work, work_removal
from edge_server.store.rows.events import StoredEvent
from edge_server.store.rows.idempotency import Answered

LIFETIME_S: Final = 10.0
"""Longest lifetime of an event, whatever its `expires_at`."""
LATE_S: Final = 1.0
"""A request that was read this much later has waited, as no request does on a running server."""
RESULT_TIMEOUT_S: Final = 600.0
"""After its expiry, for the broker to report how an accepted event has ended: a flight to a place,
and back. Then it shows no flight any more, and can be deleted."""
EVENT_LIMIT: Final = 64
"""Queued events of all vehicles, at most."""


@retry_with_room
@retry_on_conflict
def create(context: Context, event: Event, caller: Caller, waited_s: float = 0.0) -> dict[str, Any]:
    """Store an event and wake the broker; returns it as stored.

    `waited_s` is how long ago it may have arrived, by which it expires earlier.

    Raises:
        NotFoundError: if the vehicle is not registered.
        ConflictError: if the vehicle has no active mission.
        InvalidError: if it has expired already, or exceeds the vehicle's limits.
        TooMuchError: if too many events wait.
        KeyReusedError: if the idempotency key belongs to another request.
    """
    body_sha256 = post_idempotency.hash_body(write(event))
    route = Kind.EVENT.value
    with context.database.write(WORK) as connection:
        now = context.clock()
        broker_work.expire(context, connection, now)
        answered = post_idempotency.find_answer(connection, caller, route, body_sha256)
        if answered is None:
            work_id = _queue(connection, context, event, now, waited_s)
            identifier = events.add(connection, work_id=work_id, received_at=now)
            _empty_queue(connection, event, identifier, now)
            name = event.event_type_id.name
            audit.about(f"events/{identifier}: {name} of vehicle {event.vehicle_id}")
            shown = _show(connection, _find(connection, identifier), now)
            answered = Answered(route, body_sha256, identifier, None, now, to_json(shown))
            post_idempotency.store_answer(connection, caller, answered)
        else:
            shown = post_idempotency.first_answer(
                answered,
                lambda: _show(connection, _find(connection, answered.object_id), now),
            )
    context.work_signal.notify()
    context.wake_relay()
    return shown


@retry_with_room
@retry_on_conflict
def replace(
    context: Context, identifier: int, event: Event, precondition: Precondition = unconditionally
) -> dict[str, Any]:
    """Replace an event that the broker has not accepted; its id stays.

    The new event has a lifetime of its own, and the broker receives it as new work.

    Raises:
        NotFoundError: if there is none.
        ChangedError: if the precondition fails.
        ConflictError, InvalidError: as for `create`; and if it is no longer queued.
    """
    with context.database.write(WORK) as connection:
        now = context.clock()
        broker_work.expire(context, connection, now)
        old = _find(connection, identifier)
        precondition(_show(connection, old, now))
        if old.state != work.QUEUED:
            raise ConflictError(
                f"event {identifier} cannot be replaced: it is {state_of(old.status_id)}"
            )
        if event.vehicle_id != old.vehicle_id:
            raise ConflictError(
                f"event {identifier} is for vehicle {old.vehicle_id}",
                (Fault("vehicle_id", "cannot be changed"),),
            )
        events.set_work(connection, identifier, _queue(connection, context, event, now))
        work_removal.remove(connection, old.work_id)
        _empty_queue(connection, event, identifier, now)
        shown = _show(connection, _find(connection, identifier), now)
    context.work_signal.notify()
    context.wake_relay()
    return shown


def find(context: Context, identifier: int) -> dict[str, Any]:
    """Return an event with its live state; raises NotFoundError."""
    broker_work.expire_if_due(context)
    with context.database.read() as connection:
        return _show(connection, _find(connection, identifier), context.clock())


def page(
    context: Context,
    *,
    after_id: int,
    limit: int,
    since_s: float = 0.0,
    vehicle_id: int | None = None,
) -> list[dict[str, Any]]:
    """List events with their live state, oldest first; `since_s` bounds their receipt."""
    broker_work.expire_if_due(context)
    with context.database.read() as connection:
        found = events.page(
            connection, after_id=after_id, limit=limit, since_s=since_s, vehicle_id=vehicle_id
        )
        now = context.clock()
        return [_show(connection, item, now) for item in found]


@retry_on_conflict
def remove(context: Context, identifier: int) -> None:
    """Cancel a queued event, or delete one that has ended.

    Raises:
        NotFoundError: if there is none.
        ConflictError: if the broker is carrying it out.
    """
    with context.database.write(WORK) as connection:
        now = context.clock()
        broker_work.expire(context, connection, now)
        stored = _find(connection, identifier)
        if stored.state == work.ACCEPTED and now < stored.expires_at + RESULT_TIMEOUT_S:
            raise ConflictError(f"event {identifier} cannot be deleted: the broker carries it out")
        events.remove(connection, identifier)
        work_removal.remove(connection, stored.work_id)


def show(stored: StoredEvent) -> dict[str, Any]:
    """Return an event as the API shows it."""
    shown = {
        "id": stored.id,
        **stored.body,
        "event_type_name": EventType(stored.body["event_type_id"]).name,
        "received_at": show_time(stored.received_at),
        "expires_at": show_time(stored.expires_at),
        "state": state_of(stored.status_id).value,
    }
    return {**shown, "message": stored.message} if stored.message else shown


def _show(connection: Connection, stored: StoredEvent, now: float) -> dict[str, Any]:
    """Return an event as the API shows it; one that reaches no broker says why."""
    if stored.state == work.QUEUED and not stored.message:
        stored = stored._replace(message=why_unheard(connection, stored.vehicle_id, now))
    return show(stored)


def _queue(
    connection: Connection, context: Context, event: Event, now: float, waited_s: float = 0.0
) -> int:
    """Check an event and queue it as work; returns the id of the work."""
    late_s = waited_s if waited_s >= LATE_S else 0.0
    expires_at = min(_expiry(event, now), now + LIFETIME_S - late_s)
    _check_speed(context, event)
    live = [
        one for one in work.live_events(connection, now) if now < one.expires_at + RESULT_TIMEOUT_S
    ]
    _check_vehicle(connection, event, live)
    if len(live) >= EVENT_LIMIT:
        raise TooMuchError(f"{EVENT_LIMIT} events wait, the maximum; try again later")
    work_id = work.add_event(connection, body=write(event), now=now, expires_at=expires_at)
    context.event_ages.keep_only([item.id for item in live])
    context.event_ages.note(work_id)
    return work_id


def _expiry(event: Event, now: float) -> float:
    """When an event expires: at its `expires_at`, but at most after the longest lifetime."""
    if event.expires_at is None:
        return now + LIFETIME_S
    wanted = event.expires_at.timestamp()
    if wanted <= now:
        raise InvalidError((Fault("expires_at", "is in the past"),))
    return min(wanted, now + LIFETIME_S)


def _check_speed(context: Context, event: Event) -> None:
    wanted = event.maximum_speed
    text = None if wanted is None else speed_fault(wanted, context.vehicle_limits)
    if text is not None:
        raise InvalidError((Fault("maximum_speed", text),))


def _check_vehicle(connection: Connection, event: Event, live: Iterable[work.Work]) -> None:
    """Check that there is something to interrupt: a mission here, or a flight of the vehicle.

    An event of the `live` ones that the broker carries out shows a flight, too: what the vehicle
    does may not be known.
    """
    known = vehicles.get(connection, event.vehicle_id)
    if known is None:
        raise NotFoundError(
            f"vehicle {event.vehicle_id} is not registered",
            (Fault("vehicle_id", "is not registered"),),
        )
    is_flying = known.state.get("armed") or known.state.get("mission_id") is not None
    is_interrupted = any(
        one.vehicle_id == event.vehicle_id and one.state == work.ACCEPTED for one in live
    )
    if not (is_flying or is_interrupted or _missions(connection, event.vehicle_id)):
        raise ConflictError(
            f"vehicle {event.vehicle_id} has no active mission",
            (Fault("vehicle_id", "has no active mission", 409, "NO_ACTIVE_MISSION"),),
        )


def _empty_queue(connection: Connection, event: Event, identifier: int, now: float) -> None:
    """End the queued missions behind an aborted one; the broker ends those that it has accepted."""
    if not event.event_type_id.ends_mission:
        return
    for item in _missions(connection, event.vehicle_id):
        if item.state == work.QUEUED:
            why = f"aborted by event {identifier}"
            broker_work.end(connection, item, Status.ABORTED, why, now)


def _missions(connection: Connection, vehicle_id: int) -> list[work.Work]:
    return [
        item
        for item in work.unfinished(connection, vehicle_id=vehicle_id)
        if item.kind == work.MISSION
    ]


def _find(connection: Connection, identifier: int) -> StoredEvent:
    stored = events.get(connection, identifier)
    if stored is None:
        raise NotFoundError(f"there is no event {identifier}")
    return stored
