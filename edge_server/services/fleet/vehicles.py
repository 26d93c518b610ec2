"""The registry: which vehicles there are, and the last reported state of each."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError

from afarcloud.numbers import (
    Boolean,
    Byte,
    Fraction,
    Int32,
    Latitude,
    Longitude,
    Model,
    Number,
    ShortText,
    Time,
    Yaw,
    json_number,
)
from edge_server.services.context import Context, Precondition, show_time, unconditionally
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.services.retries import retry_on_conflict
from edge_server.store.connection.locks import WORK, of_vehicle
from edge_server.store.rows import vehicle_holds, vehicles, work
from edge_server.store.rows.vehicle_holds import VehicleHold
from edge_server.store.rows.vehicles import URGENT_SERVED_S, Contact, StoredVehicle

NotNegative = Annotated[float, Field(ge=0), BeforeValidator(json_number)]


class VehicleState(Model):
    """State of a vehicle that a broker reports; altitude in metres above home.

    `position_age` is the age of the position at that time, in seconds; `stale` names what has not
    been received for some time. `speed` is the length of the velocity [m/s], `heading` in degrees
    clockwise from north, `battery_time_remaining` the vehicle's own estimate [s].
    """

    link_state: Literal["connected", "stale", "lost"]
    autopilot: Literal["px4", "ardupilot", "generic"] | None = None
    armed: Boolean | None = None
    mode: ShortText | None = None
    activity: (
        Literal[
            "on_ground",
            "mission",
            "paused",
            "hold",
            "guided",
            "return_or_land",
            "failsafe",
            "manual",
        ]
        | None
    ) = None
    latitude: Latitude | None = None
    longitude: Longitude | None = None
    altitude: Number | None = None
    battery_percentage: Fraction | None = None
    mission_id: Int32 | None = None
    family: ShortText | None = None
    version: ShortText | None = None
    position_age: NotNegative | None = None
    speed: NotNegative | None = None
    heading: Yaw | None = None
    gps_fix: ShortText | None = None
    satellites: Byte | None = None
    battery_time_remaining: NotNegative | None = None
    stale: Annotated[tuple[ShortText, ...], Field(max_length=16)] | None = None
    warning: ShortText | None = None
    recorded_at: Time | None = None


@retry_on_conflict
def put(
    context: Context,
    vehicle_id: int,
    state: VehicleState,
    precondition: Precondition = unconditionally,
) -> tuple[dict[str, Any], bool]:
    """Register or update a vehicle; returns it and whether it is new.

    A field that is not given stays as it was; null is a value. Raises ChangedError if the
    precondition fails; for a new vehicle it is checked against an empty object.
    """
    given = state.model_dump(mode="json", exclude_unset=True)
    now = context.clock()
    with context.database.write(of_vehicle(vehicle_id)) as connection:
        known = _newest(context, connection, vehicle_id)
        hold = vehicle_holds.get(connection, vehicle_id)
        contact = vehicles.contact(connection, vehicle_id)
        precondition(_show(known, hold, contact, now) if known else {})
        merged = {**known.state, **given} if known else given
        vehicles.put(connection, vehicle_id, merged, now)
        since = known.registered_at if known else now
        stored = _show(StoredVehicle(vehicle_id, merged, since, now), hold, contact, now)
    context.unstored.forget(vehicle_id)
    if state.armed is not None:
        context.archive.take_armed(vehicle_id, state.recorded_at, now, armed=state.armed)
    return stored, known is None


def report(
    context: Context, vehicle_id: int, state: VehicleState, precondition: Precondition
) -> tuple[dict[str, Any], bool]:
    """Take what a broker reports of a vehicle, as `put`.

    What the database refuses is shown to readers nevertheless; the broker learns of the refusal.
    """
    try:
        return put(context, vehicle_id, state, precondition)
    except DBAPIError:
        _keep(context, vehicle_id, state, precondition)
        raise


def _keep(
    context: Context, vehicle_id: int, state: VehicleState, precondition: Precondition
) -> None:
    """Keep the state of a registered vehicle in memory."""
    now = context.clock()
    with context.database.read() as connection:
        stored = vehicles.get(connection, vehicle_id)
        if stored is None:
            return
        precondition(shown(context, connection, vehicle_id, now))
    known = context.unstored.newest(stored)
    given = state.model_dump(mode="json", exclude_unset=True)
    newest = known._replace(state={**known.state, **given}, updated_at=now)
    context.unstored.keep(newest, stored)


def _newest(context: Context, connection: Connection, vehicle_id: int) -> StoredVehicle | None:
    """Return a registered vehicle with its newest state, which may not be stored."""
    stored = vehicles.get(connection, vehicle_id)
    return None if stored is None else context.unstored.newest(stored)


def everyone(context: Context) -> list[dict[str, Any]]:
    """List all vehicles."""
    with context.database.read() as connection:
        holds, contacts = vehicle_holds.everyone(connection), vehicles.contacts(connection)
        now = context.clock()
        return [
            _show(
                context.unstored.newest(item),
                holds.get(item.vehicle_id),
                contacts.get(item.vehicle_id),
                now,
            )
            for item in vehicles.everyone(connection)
        ]


def find(context: Context, vehicle_id: int) -> dict[str, Any]:
    """Return one vehicle; raises NotFoundError."""
    with context.database.read() as connection:
        return shown(context, connection, vehicle_id, context.clock())


def shown(context: Context, connection: Connection, vehicle_id: int, now: float) -> dict[str, Any]:
    """Return one vehicle inside a transaction; raises NotFoundError."""
    known = _newest(context, connection, vehicle_id)
    if known is None:
        raise NotFoundError(f"vehicle {vehicle_id} is not registered")
    hold, contact = (
        vehicle_holds.get(connection, vehicle_id),
        vehicles.contact(connection, vehicle_id),
    )
    return _show(known, hold, contact, now)


@retry_on_conflict
def remove(context: Context, vehicle_id: int) -> None:
    """Delete a vehicle; raises NotFoundError, or ConflictError while it has missions."""
    with context.database.write(WORK, of_vehicle(vehicle_id)) as connection:
        if vehicles.get(connection, vehicle_id) is None:
            raise NotFoundError(f"vehicle {vehicle_id} is not registered")
        if work.unfinished(connection, vehicle_id=vehicle_id, limit=1):
            raise ConflictError(f"vehicle {vehicle_id} cannot be deleted: it has unfinished work")
        vehicles.remove(connection, vehicle_id)
    context.unstored.forget(vehicle_id)


def _show(
    stored: StoredVehicle, hold: VehicleHold | None, contact: Contact | None, now: float
) -> dict[str, Any]:
    """Return a vehicle as the API shows it.

    `held` is why its queue waits, null if it does not; `brokers` are those that are connected, the
    first one serves the vehicle. In flight `warning` also says that orders reach no broker.
    """
    is_flying = stored.state.get("armed") or stored.state.get("mission_id") is not None
    unheard = _unheard(contact, now) if is_flying else None
    warnings = [one for one in (stored.state.get("warning"), unheard) if one]
    return {
        "vehicle_id": stored.vehicle_id,
        **stored.state,
        **({"warning": "; ".join(warnings)} if unheard else {}),
        "held": None if hold is None else _hold(hold),
        "brokers": [] if contact is None else contact.brokers(now),
        "registered_at": show_time(stored.registered_at),
        "updated_at": show_time(stored.updated_at),
    }


def why_unheard(connection: Connection, vehicle_id: int | None, now: float) -> str | None:
    """Explain why an order about a vehicle reaches no broker now; None if one asks for it."""
    contact = None if vehicle_id is None else vehicles.contact(connection, vehicle_id)
    return _unheard(contact, now)


def _unheard(contact: Contact | None, now: float) -> str | None:
    if contact is None:
        return None
    last = f"the last request of {contact.broker} was at {show_time(contact.at)}"
    connected = contact.brokers(now)
    is_silent = abs(now - contact.at) >= URGENT_SERVED_S
    if len(connected) > 1 and is_silent:
        return f"{connected[1]} gets only orders that stop the flight yet: {last}"
    if len(connected) > 1:
        return f"{connected[1]} gets no orders yet: {last}"
    is_alone = contact.other is None or contact.other not in connected
    return f"no broker asks for orders: {last}" if is_silent and is_alone else None


def _hold(hold: VehicleHold) -> dict[str, Any]:
    return {
        "reason": hold.reason,
        "since": show_time(hold.since),
        "mission_id": hold.mission_id,
        "plan_id": hold.plan_id,
    }


def check_not_held(connection: Connection, vehicle_id: int) -> None:
    """Check that a vehicle is not held; raises ConflictError with the reason."""
    hold = vehicle_holds.get(connection, vehicle_id)
    if hold is not None:
        raise ConflictError(explain_hold(hold))


def explain_hold(hold: VehicleHold) -> str:
    """Explain why a vehicle is held, and how to release it."""
    after = "" if hold.mission_id is None else f" after mission {hold.mission_id}"
    return (
        f"vehicle {hold.vehicle_id} is held since {show_time(hold.since)}{after}: {hold.reason}; "
        f"an operator releases it with POST /vehicles/{hold.vehicle_id}/release"
    )
