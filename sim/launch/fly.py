"""`make fly`: fly a plan, as fast as the computer allows, and report on the flight.

The real system flies it: edge server, broker, vehicles and mock cloud, on ports of their own
and with state that is thrown away. What is kept goes to one folder: `report.html`, `report.png`,
and each vehicle's flight logs, true track and pictures.
"""

import json
import os
import shutil
import socket
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sim.launch.console import TERMINAL, Screen
from sim.launch.demo import FINISHED, FLIGHT_TIMEOUT_S, DemoError, post, read_plan
from sim.launch.farm_client import NotReadyError, RefusedError
from sim.launch.launcher import Stopped, System
from sim.launch.settings import IMAGE_FOLDER, Settings, from_environment, vehicle_folder
from sim.launch.supervisor import SupervisorError
from sim.mosaic.album import Album, write_album
from sim.physics.worlds import DEFAULT
from sim.report.arrays import ReportError
from sim.report.figures import Flight, examine
from sim.report.flight_log import read_logs
from sim.report.page import described, page
from sim.report.plan import planned_for
from sim.report.sheet import write_overview, write_sheet
from sim.report.truth_track import read_truth

DISARM_TIMEOUT_S: Final = 30.0
_PORTS: Final = ("EDGE_PORT", "CLOUD_PORT", "MAVLINK_PORT", "GCS_PORT")
_VEHICLE_PORTS: Final = "VEHICLE_PORT_BASE"


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What a run of the system has left behind."""

    plan: dict[str, Any]  # as the edge server shows it at the end
    wall_clock_s: float  # from posting the plan to its end


def run(settings: Settings, out: Path) -> int:
    """Fly and report; 0 only when every mission has finished and the report is written."""
    with Screen() as screen, tempfile.TemporaryDirectory(prefix="fly-") as scratch:
        try:
            plan = read_plan(settings)
            flown = _fly(_own_system(plan, settings, Path(scratch)), plan, screen)
            screen.say("drawing the report, which takes some seconds")
            written = write_report(flown, settings, Path(scratch), out)
        except Stopped:
            screen.say("ERROR stopped before the plan had ended")
            return 1
        except (SupervisorError, RefusedError, ReportError, OSError) as error:
            screen.say(f"ERROR {error}")
            return 1
        screen.say(f"report: {written}")
    failed = [m for m in _missions(flown.plan) if m["mission_status_id"] != FINISHED]
    for mission in failed:
        screen.say(f"ERROR mission {mission['mission_id']} did not finish")
    return 1 if failed else 0


def _own_system(plan: dict[str, Any], settings: Settings, state_dir: Path) -> Settings:
    """Settings of a system on free ports, with a vehicle for each that the plan names.

    The programs read their settings from the environment, so it is changed as well.
    """
    vehicles = max(int(mission["vehicle_id"]) for mission in _missions(plan))
    chosen = {name: str(port) for name, port in zip(_PORTS, free_ports(len(_PORTS)), strict=True)}
    environment = {
        **chosen,
        _VEHICLE_PORTS: str(_free_range(vehicles)),
        "VEHICLES": str(max(vehicles, settings.vehicles)),
        "SPEED": f"{settings.speed:g}",
        "STATE_DIR": str(state_dir),
        "TRUTH": "1",
    }
    os.environ.update(environment)
    os.environ.pop("BROKER", None)
    os.environ.pop("GCS", None)
    return from_environment(os.environ)


def free_ports(count: int) -> list[int]:
    """Ports that are free for TCP and UDP alike at this moment."""
    found: list[int] = []
    while len(found) < count:
        with socket.socket() as probe, socket.socket(type=socket.SOCK_DGRAM) as other:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
            try:
                other.bind(("127.0.0.1", port))
            except OSError:
                continue
            if port not in found:
                found.append(port)
    return found


def _free_range(count: int) -> int:
    """A base with `count` free UDP ports above it."""
    while True:
        base = free_ports(1)[0] - 1
        probes = []
        try:
            for port in range(base + 1, base + 1 + count):
                probes.append(probe := socket.socket(type=socket.SOCK_DGRAM))
                probe.bind(("127.0.0.1", port))
        except (OSError, OverflowError):
            continue
        else:
            return base
        finally:
            for probe in probes:
                probe.close()


def _fly(settings: Settings, plan: dict[str, Any], screen: Screen) -> Flown:
    """Run the system until the plan has ended and its vehicles have disarmed."""
    with System(settings, screen) as system:
        system.wait_until_healthy()
        began_s = time.monotonic()
        number = post(system, plan)
        ended = _await_end(system, number)
        wall_clock_s = time.monotonic() - began_s
        _await_disarmed(system)
    return Flown(plan=ended, wall_clock_s=wall_clock_s)


def _await_end(system: System, number: int) -> dict[str, Any]:
    deadline_s = time.monotonic() + FLIGHT_TIMEOUT_S
    while time.monotonic() < deadline_s:
        system.step()
        try:
            plan: dict[str, Any] = system.client.edge(f"/plans/{number}")
        except NotReadyError:
            continue
        missions = _missions(plan)
        system.screen.missions(missions)
        if all(int(mission["mission_status_id"]) >= TERMINAL for mission in missions):
            return plan
    raise DemoError(f"plan {number} had not ended after {FLIGHT_TIMEOUT_S:.0f} s")


def _await_disarmed(system: System) -> None:
    """Wait for the end of the flights; a plan may also leave its vehicles in the air."""
    deadline_s = time.monotonic() + DISARM_TIMEOUT_S
    while time.monotonic() < deadline_s:
        system.step()
        try:
            vehicles = system.client.connected_vehicles()
        except NotReadyError:
            continue
        if not any(vehicle.get("armed") for vehicle in vehicles.values()):
            return
    system.screen.say("WARNING a vehicle is still armed; the report ends here")


def write_report(flown: Flown, settings: Settings, state_dir: Path, out: Path) -> Path:
    """Keep logs and tracks, draw the report; gives the page.

    Raises:
        ReportError: if a vehicle has logged nothing to report on.
        OSError: if the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    vehicles = sorted({int(mission["vehicle_id"]) for mission in _missions(flown.plan)})
    flights = [_flight(number, flown.plan, state_dir, out) for number in vehicles]
    title = flown.plan.get("name") or "Flight"
    albums = [album for number in vehicles if (album := _album(number, state_dir, out))]
    facts = _facts(flown, settings, flights)
    for flight in flights:
        folder = out if len(flights) == 1 else vehicle_folder(out, flight.vehicle_id)
        heading = f"{title}: vehicle {flight.vehicle_id}"
        write_sheet(folder / "report.png", heading, described(facts), flight)
    if len(flights) > 1:
        write_overview(out / "report.png", title, described(facts), flights)
    report = out / "report.html"
    report.write_text(page(title, described(facts), flights, albums), encoding="utf-8")
    (out / "plan.json").write_text(json.dumps(flown.plan, indent=2) + "\n", encoding="utf-8")
    return report


def _flight(vehicle_id: int, plan: Mapping[str, Any], state_dir: Path, out: Path) -> Flight:
    """Copy what one vehicle has left, and examine it."""
    kept = vehicle_folder(out, vehicle_id)
    kept.mkdir(parents=True, exist_ok=True)
    for old in kept.glob("*.ulg"):
        old.unlink()
    left = vehicle_folder(state_dir, vehicle_id)
    logs = [
        Path(shutil.copy2(log, kept / f"{log.parent.name}_{log.name}"))
        for log in sorted((left / "log").glob("*/*.ulg"))
    ]
    truth = read_truth(Path(shutil.copy2(left / "truth.csv", kept / "truth.csv")))
    return examine(vehicle_id, planned_for(plan, vehicle_id, truth.plane), read_logs(logs), truth)


def _album(vehicle_id: int, state_dir: Path, out: Path) -> Album | None:
    """Copy the pictures that a vehicle has taken, and lay them on sheets."""
    left = vehicle_folder(state_dir, vehicle_id) / IMAGE_FOLDER
    kept = vehicle_folder(out, vehicle_id)
    shutil.rmtree(kept / IMAGE_FOLDER, ignore_errors=True)
    if not left.is_dir():
        return None
    shutil.copytree(left, kept / IMAGE_FOLDER)
    name = os.environ.get("WORLD") or DEFAULT
    return write_album(vehicle_id, kept / IMAGE_FOLDER, kept, name, without=frozenset())


def _facts(flown: Flown, settings: Settings, flights: list[Flight]) -> list[tuple[str, str]]:
    """Notes on the run."""
    flown_s = max(flight.armed_for_s for flight in flights)
    return [
        ("wind", f"{os.environ.get('WIND') or '0'} m/s"),
        ("receiver", os.environ.get("GPS") or "m9n"),
        ("seed", os.environ.get("SEED") or "1"),
        ("noise factor", os.environ.get("NOISE") or "1"),
        ("speed", "as fast as it goes" if settings.speed == 0.0 else f"{settings.speed:g}"),
        ("flown", f"{flown_s:.0f} s in {flown.wall_clock_s:.1f} s of the wall clock"),
    ]


def _missions(plan: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Missions of a plan, bare or in its envelope, or of a document that is one mission."""
    inner = plan.get("plan", plan)
    missions: list[dict[str, Any]] = inner.get("missions", [inner])
    return missions
