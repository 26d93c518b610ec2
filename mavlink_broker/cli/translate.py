"""`translate`: prints the mission items and live commands of a plan, without flying it.

As text: a table per stretch, a paragraph per live command. With `--json` as plain data: the fields
of the messages to the vehicle; NaN, which JSON does not support, is null.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any, Final

from afarcloud.commands import NavTakeoff
from afarcloud.plan import Mission
from afarcloud.route import Spot
from farm_flight_bridge import program_name
from mavlink_broker.autopilots.families import (
    ARDUPILOT,
    ARDUPILOT_OTHER,
    GENERIC,
    OWN,
    PX4,
    Family,
)
from mavlink_broker.cli.local_edge import read_plan, select_missions
from mavlink_broker.cli.program import FAILED, SUCCEEDED, print_output
from mavlink_broker.config import DEFAULT_SYSTEM_ID
from mavlink_broker.mavlink.dialect import (
    AUTOPILOT,
    ONBOARD_COMPUTER,
    Message,
    Route,
    name_in,
)
from mavlink_broker.microservices.command import CommandAlternatives
from mavlink_broker.planning.geofence import AreaCheck
from mavlink_broker.planning.mission import FlightPlan, Itinerary, LiveCommand, translate
from mavlink_broker.planning.situation import (
    Circled,
    End,
    Home,
    Lasted,
    RefusedError,
    Series,
    Tracked,
    Turned,
)

_ITEM_FIELDS = (
    *("seq", "frame", "command", "current", "autocontinue"),
    *("param1", "param2", "param3", "param4", "x", "y", "z"),
)
_ROUTE = Route(DEFAULT_SYSTEM_ID, ONBOARD_COMPUTER, 1, AUTOPILOT)
_FRAMES: Final = {0: "0 above sea", 2: "2 none", 6: "6 above home"}
_HEADER: Final = (
    *("seq", "command", "frame", "p1", "p2", "p3", "p4", "x", "y", "z"),
    "command_id",
)
_E7: Final = 1e7
FAMILIES: Final[Mapping[str, Family]] = {
    family.name: family for family in (OWN, PX4, ARDUPILOT, ARDUPILOT_OTHER, GENERIC)
}


def command_name(number: int) -> str:
    """Give the name of a MAV_CMD without its prefix."""
    return name_in("MAV_CMD", number) or str(number)


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
        for message in plan.messages(*_ROUTE.target)
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


def mission_lines(mission: Mission, itinerary: Itinerary) -> Iterator[str]:
    """Give the lines of one mission."""
    count = len(itinerary.segments)
    for number, segment in enumerate(itinerary.segments, 1):
        yield ""
        if isinstance(segment, FlightPlan):
            yield f"part {number} of {count}: mission items"
            yield from _stretch_text(segment, mission)
        else:
            command = mission.command_array[segment.command]
            name = command.command_type_id.name
            yield f"part {number} of {count}: command {command.command_id} ({name}), live"
            yield from _live_text(segment)
    yield from _notes(mission, itinerary)


def _stretch_text(plan: FlightPlan, mission: Mission) -> Iterator[str]:
    rows = [
        _row(item, mission.command_array[owner].command_id)
        for item, owner in zip(items(plan), plan.command_of_item, strict=True)
    ]
    widths = [max(len(row[i]) for row in (_HEADER, *rows)) for i in range(len(_HEADER))]
    for row in (_HEADER, *rows):
        yield "  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()


def _row(item: dict[str, Any], command_id: int) -> Sequence[str]:
    has_place = item["frame"] != 2
    return (
        str(item["seq"]),
        f"{item['name']} ({item['command']})",
        _FRAMES.get(item["frame"], str(item["frame"])),
        *(_number(item[f"param{i}"]) for i in range(1, 5)),
        *(f"{item[a] / _E7:.7f}" if has_place else str(item[a]) for a in ("x", "y")),
        _number(item["z"]),
        str(command_id),
    )


def _live_text(live: LiveCommand) -> Iterator[str]:
    action = live.action
    if action.approach is not None:
        yield f"  first  to {_place(action.approach)}"
    if action.follow is not None:
        yield f"  target {_place(action.follow)}, sent 5 times a second"
    yield from _alternatives("begin ", action.begin, action.alternative_notes)
    yield f"  lasts  {end_sentence(action.end)}"
    yield from _alternatives("finish", action.finish, ())


def _alternatives(
    title: str, alternatives: CommandAlternatives, notes: Sequence[str]
) -> Iterator[str]:
    for number, alternative in enumerate(command_lists(alternatives)):
        lost = notes[number] if number < len(notes) else ""
        behind = f"  [{lost}]" if lost else ""
        for step, command in enumerate(alternative):
            label = title if number == step == 0 else "or    " if step == 0 else "then  "
            yield f"  {label} {_command_text(command)}{behind}"


def _command_text(command: dict[str, Any]) -> str:
    last = (
        ("x", "y", "z") if command["message"] == "COMMAND_INT" else ("param5", "param6", "param7")
    )
    names = (*(f"param{i}" for i in range(1, 5)), *last)
    values = " ".join(_number(command[name]) for name in names)
    return f"{command['message']} {command['name']} ({command['command']}): {values}"


def _notes(mission: Mission, itinerary: Itinerary) -> Iterator[str]:
    noted = [
        (command, notes)
        for command, notes in zip(mission.command_array, itinerary.notes, strict=True)
        if notes
    ]
    if noted:
        yield ""
        yield "notes"
    for command, notes in noted:
        for note in notes:
            yield f"  command {command.command_id} ({command.command_type_id.name}): {note}"


def _place(spot: Spot) -> str:
    height = f"{spot.relative_altitude_m:g} m above home"
    return f"{spot.latitude_deg:.7f}, {spot.longitude_deg:.7f}, {height}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.8g}"


def parse_home(text: str) -> Home:
    """Parse `latitude,longitude,altitude`: degrees, degrees, metres above mean sea level.

    Raises:
        argparse.ArgumentTypeError: if the format or a value is invalid.
    """
    try:
        latitude, longitude, altitude = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"must be latitude,longitude,altitude above sea level, not {text!r}"
        ) from None
    if not (abs(latitude) <= 90 and abs(longitude) <= 180 and abs(altitude) <= 10_000):
        raise argparse.ArgumentTypeError(f"is not a position on earth: {text!r}")
    return Home(latitude, longitude, altitude)


def run(arguments: Sequence[str], now: datetime) -> int:
    """Print the translation of a plan; 1 if a mission cannot be flown.

    Raises:
        UsageError: if the plan cannot be read, or the output cannot be written.
    """
    options = _parser().parse_args(arguments)
    plan, warnings = read_plan(options.plan, now)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    family = FAMILIES[options.family]
    records, status = [], SUCCEEDED
    for mission in select_missions(plan, options.mission_id, options.vehicle_id):
        home = options.home or _assumed_home(mission)
        head = {"family": family.name, "home": home._asdict()}
        try:
            itinerary = translate(mission, family, home)
            if plan.geofence is not None:
                area = AreaCheck(plan.geofence)
                area.check(mission, family, start=None, home=options.home)
        except RefusedError as error:
            status = FAILED
            print(_refusal(mission, error), file=sys.stderr)
            records.append(head | _refused_record(mission, error))
            continue
        records.append(head | mission_record(mission, itinerary))
        if not options.json:
            print_output(
                "\n".join(_lines(mission, itinerary, family, home, assumed=options.home is None))
            )
    if options.json:
        print_output(json.dumps({"missions": records}, indent=1))
    return status


def _lines(
    mission: Mission, itinerary: Itinerary, family: Family, home: Home, *, assumed: bool
) -> Iterator[str]:
    position = f"{home.latitude_deg:.7f}, {home.longitude_deg:.7f}"
    how = " (assumed; set it by --home)" if assumed else ""
    yield f"mission {mission.mission_id} for vehicle {mission.vehicle_id}, family {family.name}"
    yield f"home {position}, {home.altitude_amsl_m:g} m above sea level{how}"
    yield from mission_lines(mission, itinerary)
    yield ""


def _refusal(mission: Mission, error: RefusedError) -> str:
    command = mission.command_array[error.command_index]
    what = f"command {command.command_id} ({command.command_type_id.name})"
    return f"mission {mission.mission_id}, {what} cannot be flown: {error.reason}"


def _refused_record(mission: Mission, error: RefusedError) -> dict[str, Any]:
    return {
        "mission_id": mission.mission_id,
        "vehicle_id": mission.vehicle_id,
        "refused": {
            "command_id": error.command_id,
            "parameter": error.refusal.parameter,
            "reason": error.refusal.why,
        },
    }


def _assumed_home(mission: Mission) -> Home:
    """Give the position of the first take-off, at sea level."""
    for command in mission.command_array:
        if isinstance(command, NavTakeoff):
            return Home(command.parameters.latitude, command.parameters.longitude, 0.0)
    return Home(0.0, 0.0, 0.0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"{program_name('mavlink_broker')} translate",
        description="Print the mission items and live commands that a plan becomes.",
    )
    parser.add_argument("plan", help="a plan as JSON, or - for the standard input")
    parser.add_argument(
        "--family", choices=sorted(FAMILIES), default=OWN.name, help="kind of vehicle: %(default)s"
    )
    parser.add_argument(
        "--home",
        type=parse_home,
        metavar="LAT,LON,ALT",
        help="the vehicle's home [deg, deg, m above sea level]; else the place of take-off, 0 m",
    )
    parser.add_argument("--mission-id", type=int, help="only this mission of the plan")
    parser.add_argument("--vehicle-id", type=int, help="only the mission of this vehicle")
    parser.add_argument("--json", action="store_true", help="as JSON")
    return parser
