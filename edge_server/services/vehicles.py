"""The registry: which vehicles there are and what was last said of each."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from sqlalchemy import Connection

from afarcloud.model import Model
from afarcloud.numbers import (
    Boolean,
    Fraction,
    Int32,
    Latitude,
    Longitude,
    Number,
    ShortText,
    Time,
    json_number,
)
from edge_server.services.attempts import repeatable
from edge_server.services.context import Context, Precondition, show_time, unconditionally
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.store import vehicle_holds, vehicles, work
from edge_server.store.locks import WORK, of_vehicle
from edge_server.store.vehicle_holds import VehicleHold
from edge_server.store.vehicles import StoredVehicle

Age = Annotated[float, Field(ge=0), BeforeValidator(json_number)]


class VehicleState(Model):
    """What a broker says of a vehicle; altitude in metres above home.

    `position_age` is how old the position was then, in seconds; `stale` names what has not been
    told for some time.
    """

    link_state: Literal["connected", "stale", "lost"]
    autopilot: Literal["px4", "ardupilot", "generic"] | None = None
    armed: Boolean | None = None
    mode: ShortText | None = None
    latitude: Latitude | None = None
    longitude: Longitude | None = None
    altitude: Number | None = None
    battery_percentage: Fraction | None = None
    mission_id: Int32 | None = None
    family: ShortText | None = None
    version: ShortText | None = None
    position_age: Age | None = None
    stale: Annotated[tuple[ShortText, ...], Field(max_length=16)] | None = None
    warning: ShortText | None = None
    recorded_at: Time | None = None


@repeatable
def put(
    context: Context,
    vehicle_id: int,
    state: VehicleState,
    precondition: Precondition = unconditionally,
) -> tuple[dict[str, Any], bool]:
    """Register or update a vehicle; returns it and whether it is new.

    What is not said stays as it was; a null is said. Raises ChangedError if the precondition
    does; a vehicle that is new is shown to it as an empty object.
    """
    said = state.model_dump(mode="json", exclude_unset=True)
    now = context.clock()
    with context.database.write(of_vehicle(vehicle_id)) as connection:
        known = vehicles.get(connection, vehicle_id)
        precondition(shown(connection, vehicle_id) if known else {})
        merged = {**known.state, **said} if known else said
        vehicles.put(connection, vehicle_id, merged, now)
        return shown(connection, vehicle_id), known is None


def everyone(context: Context) -> list[dict[str, Any]]:
    """List all vehicles."""
    with context.database.read() as connection:
        holds = vehicle_holds.everyone(connection)
        return [show(item, holds.get(item.vehicle_id)) for item in vehicles.everyone(connection)]


def find(context: Context, vehicle_id: int) -> dict[str, Any]:
    """Give one vehicle; raises NotFoundError."""
    with context.database.read() as connection:
        return shown(connection, vehicle_id)


def shown(connection: Connection, vehicle_id: int) -> dict[str, Any]:
    """Give one vehicle inside a transaction; raises NotFoundError."""
    known = vehicles.get(connection, vehicle_id)
    if known is None:
        raise NotFoundError(f"vehicle {vehicle_id} is not registered")
    return show(known, vehicle_holds.get(connection, vehicle_id))


@repeatable
def remove(context: Context, vehicle_id: int) -> None:
    """Forget a vehicle; raises NotFoundError, or ConflictError while it has missions."""
    with context.database.write(WORK, of_vehicle(vehicle_id)) as connection:
        if vehicles.get(connection, vehicle_id) is None:
            raise NotFoundError(f"vehicle {vehicle_id} is not registered")
        if work.unfinished(connection, vehicle_id=vehicle_id, limit=1):
            raise ConflictError(f"vehicle {vehicle_id} has unfinished work")
        vehicles.remove(connection, vehicle_id)


def show(stored: StoredVehicle, hold: VehicleHold | None = None) -> dict[str, Any]:
    """Give a vehicle as the API shows it; `held` says why its queue waits, null if it does not."""
    return {
        "vehicle_id": stored.vehicle_id,
        **stored.state,
        "held": None if hold is None else _hold(hold),
        "registered_at": show_time(stored.registered_at),
        "updated_at": show_time(stored.updated_at),
    }


def _hold(hold: VehicleHold) -> dict[str, Any]:
    return {
        "reason": hold.reason,
        "since": show_time(hold.since),
        "mission_id": hold.mission_id,
        "plan_id": hold.plan_id,
    }
