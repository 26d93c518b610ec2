"""`make demo`: fly an example plan and wait until the cloud holds all its results."""

import copy
import json
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

from sim.config import VEHICLE_SPACING_M
from sim.launch.console import TERMINAL, Screen
from sim.launch.farm_client import NotReadyError, RefusedError, rows
from sim.launch.launcher import Stopped, System
from sim.launch.settings import IMAGE_FOLDER, Settings, example_plan, vehicle_folder
from sim.launch.supervisor import SupervisorError
from sim.mosaic.album import write_album
from sim.physics.earth import degrees_per_metre
from sim.physics.worlds import DEFAULT

UP_SPACING_M = 2.0
"""Difference of their altitudes, so that no two are ever at one point."""


def for_vehicles(document: dict[str, Any], vehicles: int) -> dict[str, Any]:
    """Give a plan with one mission for each of `vehicles` vehicles.

    A plan that already has several missions, or a single vehicle, leaves it as it is. The
    document may be bare, in its envelope, or a single mission.
    """
    plan = document.get("plan", document)
    missions = plan.get("missions", [plan])
    if len(missions) > 1 or vehicles == 1:
        return document
    return {
        "name": plan.get("name", "fleet"),
        "missions": [_shifted(missions[0], number) for number in range(vehicles)],
    }


def _shifted(mission: dict[str, Any], number: int) -> dict[str, Any]:
    shifted = copy.deepcopy(mission)
    shifted["vehicle_id"] += number
    shifted["mission_id"] += number
    shifted["sequence_number"] = number
    for command in shifted["command_array"]:
        parameters = command.get("parameters", {})
        if "longitude" in parameters:
            metre = degrees_per_metre(parameters["latitude"], 0.0)
            parameters["longitude"] += number * VEHICLE_SPACING_M * metre.east
        for name in ("altitude", "orbit_altitude"):
            if name in parameters:
                parameters[name] += number * UP_SPACING_M
    return shifted


FLIGHT_TIMEOUT_S = 900.0
DELIVERY_TIMEOUT_S = 60.0
"""Without a new record after the flight has ended; the camera may still write pictures."""
CAMERA_IMAGE, CAMERA_PANORAMA = 4, 10
PANORAMA_PICTURES = {0: 8, 1: 5}
"""Of a full and of half a circle."""
FINISHED = 3
MAXIMUM_MISSIONS = 16
KEPT_UNTIL_DELIVERED = ("pose", "battery", "image", "observation", "mission_report", "alarm")


class DemoError(SupervisorError):
    """The demo failed; the message names what is missing."""


def run(settings: Settings) -> int:
    """Fly the plan; 0 only when every report and result is in the cloud and only there."""
    with Screen() as screen:
        try:
            plan = read_plan(settings)
            former = {number: _names(settings, number) for number in settings.started_ids}
            with System(settings, screen) as system:
                system.wait_until_healthy()
                arrived = len(system.client.cloud("/records"))
                number = post(system, plan)
                missions = _fly(system, number)
                _await_delivery(system, missions, arrived)
                screen.say(f"plan {number}: flown, and the cloud holds every report and result")
            show_pictures(settings, former, screen.say)
        except Stopped:
            screen.say("ERROR stopped before the plan had ended")
            return 1
        except (SupervisorError, RefusedError, OSError) as error:
            screen.say(f"ERROR {error}")
            return 1
    return 0


def _names(settings: Settings, vehicle_id: int) -> frozenset[str]:
    """Pictures that a vehicle has on its card."""
    return frozenset(path.name for path in _image_folder(settings, vehicle_id).glob("*.jpg"))


def _image_folder(settings: Settings, vehicle_id: int) -> Path:
    return vehicle_folder(settings.state_dir, vehicle_id) / IMAGE_FOLDER


def show_pictures(
    settings: Settings, former: Mapping[int, frozenset[str]], say: Callable[[str], None]
) -> None:
    """Put the pictures of the flight on sheets, and show their paths.

    Args:
        settings: of the system that has flown.
        former: names of the pictures that each vehicle had before.
        say: prints a line.

    Raises:
        OSError: if a picture cannot be read or a sheet not be written.
    """
    for number, names in former.items():
        out = vehicle_folder(settings.state_dir / "album", number)
        place = os.environ.get("WORLD") or DEFAULT
        folder = _image_folder(settings, number)
        album = write_album(number, folder, out, place, without=names)
        if album is not None:
            say(f"vehicle {number}: {album.sentence}: {out}")


def read_plan(settings: Settings) -> dict[str, Any]:
    """Read the plan to fly, made for as many vehicles as there are.

    Raises:
        DemoError: if the file holds no plan, or there are more vehicles than a plan may have.
    """
    vehicles = len(settings.started_ids)
    if not 1 <= vehicles <= MAXIMUM_MISSIONS:
        raise DemoError(f"VEHICLES: a plan holds 1 to {MAXIMUM_MISSIONS} missions, not {vehicles}")
    path = settings.plan or example_plan()
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        return for_vehicles(document, vehicles)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DemoError(f"{path} holds no plan: {type(error).__name__} {error}") from None


def post(system: System, plan: dict[str, Any]) -> int:
    """Post the plan and give its id; raises RefusedError."""
    while True:
        try:
            return int(system.client.post_plan(plan)["id"])
        except NotReadyError:
            system.step()


def _fly(system: System, number: int) -> list[dict[str, Any]]:
    """Show progress until every mission has ended; give the missions as they ended."""
    deadline = time.monotonic() + FLIGHT_TIMEOUT_S
    while time.monotonic() < deadline:
        system.step()
        try:
            missions: list[dict[str, Any]] = system.client.edge(f"/plans/{number}")["missions"]
        except NotReadyError:
            continue
        system.screen.missions(missions)
        require_free(missions)
        if all(int(mission["mission_status_id"]) >= TERMINAL for mission in missions):
            failed = [m["mission_id"] for m in missions if m["mission_status_id"] != FINISHED]
            if failed:
                raise DemoError(f"missions {failed} did not finish: {missions}")
            return missions
    raise DemoError(f"plan {number} had not ended after {FLIGHT_TIMEOUT_S:.0f} s")


def require_free(missions: list[dict[str, Any]]) -> None:
    """Raise DemoError if a mission waits for a held vehicle, as after a flight that was stopped."""
    reasons = {str(mission["waiting"]) for mission in missions if "waiting" in mission}
    if reasons:
        raise DemoError(f"{'; '.join(sorted(reasons))}, or use another STATE_DIR")


def _await_delivery(system: System, missions: list[dict[str, Any]], arrived: int) -> None:
    lacked, deadline = "", 0.0
    while (missing := undelivered(system.client, missions, arrived)) is not None:
        if missing != lacked:
            lacked, deadline = missing, time.monotonic() + DELIVERY_TIMEOUT_S
        if time.monotonic() > deadline:
            raise DemoError(f"not delivered: {missing}")
        system.step()


class Answering(Protocol):
    """Reads records from edge server and cloud."""

    def edge(self, path: str, /) -> Any:
        """GET from the edge server."""

    def cloud(self, path: str, /) -> Any:
        """GET from the cloud."""


def undelivered(client: Answering, missions: list[dict[str, Any]], arrived: int) -> str | None:
    """Describe what the cloud lacks of the missions, or what the edge server still keeps.

    Args:
        client: to ask with.
        missions: the missions as the edge server shows them at their end.
        arrived: number of records that the cloud held before the flight.
    """
    try:
        kept = [kind for kind in KEPT_UNTIL_DELIVERED if rows(client.edge(f"/{kind}/"))]
        records = client.cloud(f"/records?after={arrived}")
    except NotReadyError as error:
        return str(error)
    if kept:
        return f"the edge server still keeps {', '.join(kept)}"
    lacks = [lack for mission in missions if (lack := _lack_of(mission, records))]
    return "; ".join(lacks) or None


def _lack_of(mission: dict[str, Any], records: list[dict[str, Any]]) -> str | None:
    """Describe what the cloud lacks of one mission: its last report, results, pictures."""
    mine = [r for r in records if r["body"].get("vehicle_id") == mission["vehicle_id"]]
    reports = [
        r["body"]
        for r in mine
        if r["kind"] == "mission_report" and r["body"]["mission_id"] == mission["mission_id"]
    ]
    if not reports or reports[-1]["mission_status_id"] != FINISHED:
        return f"the cloud lacks the last report of mission {mission['mission_id']}"
    commands = mission["command_array"]
    wanted = {
        "pose": len(commands),
        "battery": len(commands),
        "image": sum(map(pictures, commands)),
    }
    for kind, count in wanted.items():
        held = sum(r["kind"] == kind for r in mine)
        if held < count or (held > count and kind != "image"):
            return (
                f"the cloud holds {held} {kind} records of vehicle {mission['vehicle_id']}, "
                f"not {count}"
            )
    return None


def pictures(command: dict[str, Any]) -> int:
    """How many pictures a command takes."""
    parameters = command.get("parameters") or {}
    if command["command_type_id"] == CAMERA_IMAGE:
        return int(parameters.get("photo_count", 1))
    if command["command_type_id"] == CAMERA_PANORAMA:
        return PANORAMA_PICTURES[int(parameters.get("panorama_mode", 0))]
    return 0
