"""Plans imported from other programs' mission files, and exported to them."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from afarcloud.annex import in_seconds
from afarcloud.enumerations import Profile
from afarcloud.faults import Fault, InvalidError
from afarcloud.numbers import INT32_MAX, Boolean, Int32, Model, ShortText, VehicleId
from afarcloud.plan import Mission, Plan, Speed
from afarcloud.wire import read_as, write
from edge_server.exchange import from_commands, to_commands
from edge_server.exchange.mission_item import Home, Item, MissionFile
from edge_server.exchange.to_commands import Translated
from edge_server.services.context import Caller, Context
from edge_server.services.errors import NotFoundError
from edge_server.services.planning import plans
from edge_server.store.rows import plans as stored_plans
from edge_server.store.rows import work

_OF_COMMAND: Final = re.compile(r"missions\.0\.command_array\.(\d+)(?:\.(.+))?")
_OF_MISSION: Final = "missions.0."


class ImportOrder(Model):
    """What a mission file does not contain: the vehicle, and whether to dispatch the plan."""

    vehicle_id: VehicleId
    dispatch: Boolean = False
    mission_id: Int32 | None = None
    maximum_speed: Speed | None = None  # In place of the file's own
    name: ShortText | None = None


def create(
    context: Context, file: MissionFile, order: ImportOrder, caller: Caller
) -> dict[str, Any]:
    """Store the plan of a mission file; returns it as stored.

    Raises:
        InvalidError: if an item has no command for it, or the plan breaks a rule.
        ConflictError: as for a plan.
        KeyReusedError: if the idempotency key belongs to another request.
    """
    translated = to_commands.translate(
        file.items, file.home, speed_m_s=file.speed_m_s, zero_yaw_is_unset=file.zero_yaw_is_unset
    )
    source = {
        "commands": translated.commands,
        "maximum_speed": translated.maximum_speed_m_s,
        "geofence": file.geofence,
        "rally_points": file.rally_points,
        "order": write(order),
    }
    warnings = [*file.warnings, *translated.warnings]
    try:
        plan = read_as(Plan, _document(context, file, translated, order))
        (kept,) = plans.create_all(
            context,
            [plan],
            caller,
            source,
            warnings,
            numbered_here=order.mission_id is None,
            missing=file.missing,
        )
    except InvalidError as error:
        raise InvalidError(_placed(error.faults, translated.paths)) from None
    return kept


def _document(
    context: Context, file: MissionFile, translated: Translated, order: ImportOrder
) -> dict[str, Any]:
    mission_id = order.mission_id
    if mission_id is None:
        mission_id = int(context.clock()) % INT32_MAX
    mission = {
        "mission_id": mission_id,
        "vehicle_id": order.vehicle_id,
        "maximum_speed": order.maximum_speed or translated.maximum_speed_m_s,
        "command_array": translated.commands,
    }
    plan: dict[str, Any] = {"dispatch": order.dispatch, "missions": [mission]}
    if order.name is not None:
        plan["name"] = order.name
    if file.geofence is not None:
        plan["geofence"] = file.geofence
    if file.rally_points:
        plan["rally_points"] = file.rally_points
    return plan


def _placed(faults: Sequence[Fault], paths: Sequence[str]) -> tuple[Fault, ...]:
    """Replace paths in the plan by the places in the file from which they were made."""
    return tuple(_place(fault, paths) for fault in faults)


def _place(fault: Fault, paths: Sequence[str]) -> Fault:
    found = _OF_COMMAND.fullmatch(fault.path)
    if found is not None and int(found[1]) < len(paths):
        what = f"{found[2]} " if found[2] else ""
        return fault._replace(path=paths[int(found[1])], message=f"{what}{fault.message}")
    return fault._replace(path=fault.path.removeprefix(_OF_MISSION))


class Exported(NamedTuple):
    """One mission of a plan as items, and what a file says beside them."""

    vehicle_id: int
    items: list[Item]
    home: Home
    speed_m_s: float
    geofence: Mapping[str, Any] | None
    rally_points: Sequence[Mapping[str, Any]]


def export(context: Context, reference: int | str, vehicle_id: int | None) -> Exported:
    """Translate the mission of a plan, of several the vehicle's.

    Raises:
        NotFoundError: if there is no such plan, or no mission of the vehicle in it.
        InvalidError: if the plan has several missions and no vehicle is given.
    """
    with context.database.read() as connection:
        stored = stored_plans.find(connection, reference)
        if stored is None:
            raise NotFoundError(f"there is no plan {reference}")
        bodies = [item.body for item in work.of_plan(connection, stored.id)]
    missions = [Mission.model_validate(body) for body in bodies]
    mission = _chosen(missions, vehicle_id)
    if stored.body.get("profile") == Profile.ANNEX:
        mission = in_seconds(mission)
    home = from_commands.home_of(mission)
    return Exported(
        mission.vehicle_id,
        from_commands.items_of(mission, home),
        home,
        mission.maximum_speed,
        stored.body.get("geofence"),
        stored.body.get("rally_points", ()),
    )


def _chosen(missions: Sequence[Mission], vehicle_id: int | None) -> Mission:
    vehicles = [mission.vehicle_id for mission in missions]
    if vehicle_id is None and len(missions) > 1:
        listed = ", ".join(map(str, vehicles))
        message = f"must be given: the plan has missions of vehicles {listed}"
        raise InvalidError((Fault("vehicle_id", message),))
    if vehicle_id is not None and vehicle_id not in vehicles:
        raise NotFoundError(f"the plan has no mission of vehicle {vehicle_id}")
    return missions[0 if vehicle_id is None else vehicles.index(vehicle_id)]
