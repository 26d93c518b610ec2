"""A translated mission as plain data for `--json`: the fields of the messages to the vehicle.

NaN, which JSON does not support, is null.
"""

import math
from typing import Any

from afarcloud.plan import Mission
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import CommandAlternatives
from mavlink_broker.planning.live_actions import Circled, End, Lasted, Series, Tracked, Turned
from mavlink_broker.planning.mission import FlightPlan, Itinerary, LiveCommand
from mavlink_broker.planning.situation import Spot

_ITEM_FIELDS = (
    *("seq", "frame", "command", "current", "autocontinue"),
    *("param1", "param2", "param3", "param4", "x", "y", "z"),
)
_ROUTE = Route(254, 191, 1, 1)


def command_name(number: int) -> str:
    """Give the name of a MAV_CMD without its prefix."""
    entry = mavlink.enums["MAV_CMD"].get(number)
    return str(number) if entry is None else entry.name.removeprefix("MAV_CMD_")


def mission_record(mission: Mission, itinerary: Itinerary) -> dict[str, Any]:
    """Give a whole mission."""
    ids = [command.command_id for command in mission.command_array]
    return {
        "mission_id": mission.mission_id,
        "vehicle_id": mission.vehicle_id,
        "segments": [
            _stretch(segment, ids) if isinstance(segment, FlightPlan) else _live(segment, ids)
            for segment in itinerary.segments
        ],
        "commands": [
            {
                "command_id": command.command_id,
                "command_type_id": int(command.command_type_id),
                "name": command.command_type_id.name,
                "notes": list(notes),
            }
            for command, notes in zip(mission.command_array, itinerary.notes, strict=True)
        ],
    }


def items(plan: FlightPlan) -> list[dict[str, Any]]:
    """Give the items as they are uploaded."""
    return [
        {name: plain(getattr(message, name)) for name in _ITEM_FIELDS}
        | {"name": command_name(message.command)}
        for message in plan.messages(_ROUTE.target_system, _ROUTE.target_component)
    ]


def command_lists(alternatives: CommandAlternatives) -> list[list[dict[str, Any]]]:
    """Give the commands of each alternative, as they are sent."""
    return [
        [_command(command.message(_ROUTE, 0)) for command in alternative]
        for alternative in alternatives
    ]


def end_sentence(end: End) -> str:
    """Give a sentence on the end of a live command."""
    match end:
        case Turned(radius_m=radius_m, angle_rad=angle_rad):
            return f"until {angle_rad / math.tau:g} turn at {radius_m:g} m is flown"
        case Circled(turn=Turned(radius_m=radius_m), heading=heading):
            return f"until 1 turn at {radius_m:g} m is flown from point to point, {heading.name}"
        case Series(steps):
            return f"until {len(steps)} steps are done"
        case Tracked(mode=mode, duration_s=duration_s):
            return f"for {duration_s:g} s or until the subject is lost, {mode.name}"
        case Lasted(duration_s):
            return f"for {duration_s:g} s" if duration_s > 0.0 else "until it is accepted"


def plain(value: Any) -> Any:
    """Give a value that JSON supports."""
    return None if isinstance(value, float) and math.isnan(value) else value


def _stretch(plan: FlightPlan, ids: list[int]) -> dict[str, Any]:
    owners = [ids[index] for index in plan.command_of_item]
    return {
        "kind": "items",
        "first_item": plan.first_item,
        "ends_on_ground": plan.ends_on_ground,
        "items": [
            item | {"command_id": owner} for item, owner in zip(items(plan), owners, strict=True)
        ],
    }


def _live(live: LiveCommand, ids: list[int]) -> dict[str, Any]:
    action = live.action
    return {
        "kind": "live",
        "command_id": ids[live.command],
        "approach": _spot(action.approach),
        "target": _spot(action.follow),
        "begin": command_lists(action.begin),
        "way_notes": list(action.alternative_notes),
        "end": end_sentence(action.end),
        "finish": command_lists(action.finish),
    }


def _command(message: Message) -> dict[str, Any]:
    fields = {
        k: v for k, v in message.to_dict().items() if k not in {"target_system", "mavpackettype"}
    }
    return {name: plain(value) for name, value in fields.items()} | {
        "message": message.get_type(),
        "name": command_name(message.command),
    }


def _spot(spot: Spot | None) -> dict[str, float] | None:
    return None if spot is None else spot._asdict()
