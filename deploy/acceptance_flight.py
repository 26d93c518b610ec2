"""`python -m deploy.acceptance_flight`: fly a plan on the running system, as a farm's test.

It posts a plan to EDGE_URL as the operator, waits until every mission has ended, and then until
CLOUD_URL holds the last report of each and a pose per command, and the edge server keeps none.
0 when all of that came true, 1 with a sentence when not.

FlightError  what did not come true
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import requests

FINISHED: Final = 3
TERMINAL: Final = 3
READY_S: Final = 120.0
FLIGHT_S: Final = 900.0
DELIVERY_S: Final = 60.0
_LOOK_S: Final = 0.5
_EXAMPLE: Final = Path("examples/plans/first_flight.json")


class FlightError(Exception):
    """What did not come true."""


class System:
    """Edge server and cloud, over HTTP."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._edge = environment.get("EDGE_URL", "http://127.0.0.1:8000").rstrip("/")
        self._cloud = environment.get("CLOUD_URL", "http://127.0.0.1:8100").rstrip("/")
        self._key_file = Path(environment.get("KEY_FILE", "var/keys/operator.key"))

    def edge(self, path: str, body: Any = None) -> Any:
        """Ask the edge server; None while it does not answer or refuses for the moment."""
        key = self._key_file.read_text(encoding="ascii").strip()
        return _ask(self._edge + path, body, {"Authorization": f"Bearer {key}"})

    def cloud(self, path: str) -> Any:
        """Ask the mock cloud; None while it does not answer."""
        return _ask(self._cloud + path, None, {})


def _ask(url: str, body: Any, headers: Mapping[str, str]) -> Any:
    method = "GET" if body is None else "POST"
    try:
        answer = requests.request(method, url, json=body, headers=dict(headers), timeout=5.0)
    except requests.RequestException:
        return None
    if answer.status_code >= 500 or answer.status_code in {401, 429}:
        return None
    if not answer.ok:
        raise FlightError(f"{method} {url}: {answer.status_code} {answer.text.strip()}")
    return answer.json()


def fly(system: System, plan: Mapping[str, Any]) -> None:
    """Fly a plan and see its records arrive; raises FlightError."""
    missions = plan.get("plan", plan)["missions"]
    vehicles = {mission["vehicle_id"] for mission in missions}
    _wait("the vehicles are connected", READY_S, lambda: vehicles <= connected(system))
    overview = _wait("the cloud answers", READY_S, lambda: system.cloud("/"))
    arrived = sum(overview["counts"].values())
    stored = _wait("the edge server takes the plan", READY_S, lambda: system.edge("/plans/", plan))
    print(f"plan {stored['id']} is stored", flush=True)
    ended = _wait("every mission has ended", FLIGHT_S, lambda: ended_missions(system, stored["id"]))
    failed = [m["mission_id"] for m in ended if m["mission_status_id"] != FINISHED]
    if failed:
        raise FlightError(f"missions {failed} did not finish: {json.dumps(ended)}")
    print(f"{len(ended)} of {len(ended)} missions are FINISHED", flush=True)
    _wait("the cloud holds the records", DELIVERY_S, lambda: delivered(system, ended, arrived))
    print("the cloud holds every report and pose, the edge server none", flush=True)


def connected(system: System) -> set[int]:
    """Vehicles that the broker is in touch with."""
    return {
        vehicle["vehicle_id"]
        for vehicle in system.edge("/vehicles/") or []
        if vehicle.get("link_state") == "connected"
    }


def ended_missions(system: System, number: int) -> list[dict[str, Any]] | None:
    """The missions of a plan once all have ended; None before."""
    plan = system.edge(f"/plans/{number}")
    if plan is None or any(m["mission_status_id"] < TERMINAL for m in plan["missions"]):
        return None
    missions: list[dict[str, Any]] = plan["missions"]
    return missions


def delivered(system: System, missions: list[dict[str, Any]], arrived: int) -> bool:
    """Whether the cloud has the last report and a pose per command, and the edge server none.

    `arrived` is the number of records that the cloud held before the flight.
    """
    records = system.cloud(f"/records?after={arrived}")
    if records is None or (system.edge("/pose/"), system.edge("/mission_report/")) != ([], []):
        return False
    return all(_has_arrived(mission, records) for mission in missions)


def _has_arrived(mission: Mapping[str, Any], records: list[dict[str, Any]]) -> bool:
    mine = [r for r in records if r["body"].get("vehicle_id") == mission["vehicle_id"]]
    reports = [r["body"] for r in mine if r["kind"] == "mission_report"]
    of_mission = [r for r in reports if r["mission_id"] == mission["mission_id"]]
    poses = sum(r["kind"] == "pose" for r in mine)
    finished = bool(of_mission) and of_mission[-1]["mission_status_id"] == FINISHED
    return finished and poses == len(mission["command_array"])


def _wait(what: str, patience_s: float, look: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + patience_s
    while not (found := look()):
        if time.monotonic() > deadline:
            raise FlightError(f"not after {patience_s:.0f} s: {what}")
        time.sleep(_LOOK_S)
    return found


def main(arguments: list[str], environment: Mapping[str, str]) -> int:
    """Fly; gives the exit code."""
    parser = argparse.ArgumentParser(prog="deploy.acceptance_flight", description=__doc__)
    parser.add_argument("plan", type=Path, nargs="?", default=_EXAMPLE, help=str(_EXAMPLE))
    options = parser.parse_args(arguments)
    try:
        fly(System(environment), json.loads(options.plan.read_text(encoding="utf-8")))
    except (FlightError, OSError, ValueError) as error:
        print(f"acceptance flight: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], os.environ))
