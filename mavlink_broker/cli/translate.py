"""`translate`: prints the mission items and live commands of a plan, without flying it."""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any, Final

from afarcloud.commands import NavTakeoff
from afarcloud.plan import Mission
from farm_flight_bridge import program_name
from mavlink_broker.autopilots.families import (
    ARDUPILOT,
    ARDUPILOT_OTHER,
    GENERIC,
    OWN,
    PX4,
    Family,
)
from mavlink_broker.cli.plan_file import read_plan, select_missions
from mavlink_broker.cli.program import FAILED, SUCCEEDED, print_output
from mavlink_broker.cli.translation_json import mission_record
from mavlink_broker.cli.translation_text import mission_lines
from mavlink_broker.planning.geofence_check import AreaCheck
from mavlink_broker.planning.mission import Home, Itinerary, RefusedError, translate

FAMILIES: Final[Mapping[str, Family]] = {
    family.name: family for family in (OWN, PX4, ARDUPILOT, ARDUPILOT_OTHER, GENERIC)
}


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
