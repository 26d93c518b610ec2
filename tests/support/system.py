"""The real programs as real processes, each on ports and state of this test alone."""

import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

import requests

from sim.launch.farm_client import rows
from sim.launch.launcher import prepare_signing_keys
from sim.launch.processes import live_pictures, programs, uplink
from sim.launch.settings import Settings, from_environment
from tests.support.polling import PATIENCE_S
from tests.support.process_tree import descendants, gone
from uav_firmware.module_errors import INTERNAL_ERROR

ROOT = Path(__file__).parent.parent.parent

TERMINAL = 3
FINISHED = 3


FIRST_PORT = 20_000
LAST_PORT = 32_000
"""Below the range from which the kernel takes ports for outgoing connections."""
CONNECT_S = 30.0
"""Time allowed for each vehicle to connect, beside the others on a busy machine."""


def free_ports(count: int) -> list[int]:
    """Find neighbouring ports that are free for TCP and UDP alike."""
    while True:
        first = random.randrange(FIRST_PORT, LAST_PORT - count)
        ports = list(range(first, first + count))
        if all(_is_free(port) for port in ports):
            return ports


def _is_free(port: int) -> bool:
    for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return False
    return True


def wait_for(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """Poll until the condition gives something true, and give that."""
    deadline = time.monotonic() + patience_s
    while True:
        try:
            outcome = condition()
        except requests.RequestException:
            outcome = None
        if outcome:
            return outcome
        assert time.monotonic() < deadline, f"waited {patience_s:.0f} s for {what}"
        time.sleep(0.1)


class FarmSystem:
    """Cloud, edge server, broker and vehicles; each can be started and killed by name."""

    def __init__(
        self,
        state_dir: Path,
        *,
        vehicles: int = 1,
        speed: float = 5.0,
        mqtt: bool = False,
        tester_script: Path | None = None,
    ) -> None:
        """`tester_script`: another tester runs, with this file as its input."""
        ports = free_ports(6 + vehicles)
        self.environment = {
            **os.environ,
            "VEHICLES": str(vehicles),
            "TESTERS": str(int(tester_script is not None)),
            "TESTER_SCRIPT": str(tester_script or ""),
            "SPEED": str(speed),
            "SEED": "1",
            "WIND": "0",
            "GPS": "rtk",  # True tracks are judged to decimetres
            "TRUTH": "1",
            "EDGE_PORT": str(ports[0]),
            "CLOUD_PORT": str(ports[1]),
            "MAVLINK_PORT": str(ports[2]),
            "GCS_PORT": str(ports[3]),
            "MQTT_PORT": str(ports[4]) if mqtt else "",
            "VEHICLE_PORT_BASE": str(ports[5]),
            "STATE_DIR": str(state_dir),
            "EDGE_URL": f"http://127.0.0.1:{ports[0]}",
            "PYTHONUNBUFFERED": "1",
            "PLAN": "",
        }
        self.own: dict[str, dict[str, str]] = {}
        """Variables of one program alone, by its name."""
        self.settings: Settings = from_environment(self.environment)
        self.environment |= uplink(self.settings)
        self.state_dir = state_dir
        self._programs = {program.name: program for program in programs(self.settings)}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        self.state_dir.mkdir(parents=True, exist_ok=True)
        prepare_signing_keys(self.settings)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for name in list(self._running):
            self.kill(name)
        if kind is None:
            for log in self.state_dir.glob("vehicle-*.log"):
                assert INTERNAL_ERROR not in log.read_text(errors="replace"), log

    def start(self, *names: str) -> Self:
        """Start programs in the order given; all of them when none is named."""
        for name in names or tuple(self._programs):
            with (self.state_dir / f"{name}.log").open("ab") as log:
                self._running[name] = subprocess.Popen(
                    self._programs[name].arguments,
                    cwd=ROOT,
                    env=self.environment | self.own.get(name, {}),
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    start_new_session=True,
                )
        return self

    def kill(self, name: str) -> None:
        """Kill -9 a program; all that it has started dies with it, and is waited for.

        Otherwise a part of the old program could still answer what the test asks the new one.
        """
        process = self._running.pop(name)
        family = descendants(process.pid)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        assert gone(family, PATIENCE_S), f"parts of {name} live on"

    def process_id(self, name: str) -> int:
        """Process id of a running program."""
        return self._running[name].pid

    def log_of(self, name: str) -> str:
        """What a program has printed so far."""
        return (self.state_dir / f"{name}.log").read_text(errors="replace")

    def headers(self, role: str = "operator") -> dict[str, str]:
        """Headers that carry a role's key."""
        key = self.settings.key_path(role).read_text().strip()
        return {"Authorization": f"Bearer {key}"}

    def get(self, path: str) -> Any:
        """GET from the edge server as the operator."""
        answer = requests.get(self.settings.edge_url + path, headers=self.headers(), timeout=10)
        answer.raise_for_status()
        return answer.json()

    def post(self, path: str, body: Any) -> requests.Response:
        """POST to the edge server as the operator."""
        return requests.post(
            self.settings.edge_url + path, json=body, headers=self.headers(), timeout=10
        )

    def cloud(self, path: str) -> list[dict[str, Any]]:
        """GET records from the mock cloud."""
        answer = requests.get(self.settings.cloud_url + path, timeout=10)
        answer.raise_for_status()
        listing: list[dict[str, Any]] = answer.json()
        return listing

    def wait_until_edge_answers(self) -> None:
        """Wait for the edge server's health and its keys."""
        key = self.settings.key_path("operator")
        url = self.settings.edge_url + "/healthz"
        wait_for(lambda: key.exists() and requests.get(url, timeout=5).ok, "the edge server")

    def wait_until_connected(self) -> Self:
        """Wait until every vehicle is connected; longer for many, which start beside each other."""
        self.wait_until_edge_answers()
        wanted = set(self.settings.started_ids)

        def connected() -> bool:
            states = {v["vehicle_id"]: v["link_state"] for v in rows(self.get("/vehicles/"))}
            return wanted == {v for v, state in states.items() if state == "connected"}

        patience_s = PATIENCE_S + CONNECT_S * len(wanted)
        wait_for(connected, f"vehicles {sorted(wanted)}", patience_s)
        return self

    def fly(self, plan: dict[str, Any]) -> dict[str, Any]:
        """Post a plan, wait for its end, require that all of it FINISHED."""
        answer = self.post("/plans/", plan)
        assert answer.status_code == 201, answer.text
        ended = self.wait_until_ended(answer.json()["id"])
        for mission in ended["missions"]:
            statuses = [c["command_status_id"] for c in mission["command_array"]]
            assert mission["mission_status_id"] == FINISHED, mission
            assert set(statuses) == {FINISHED}, mission
        return ended

    def wait_until_ended(self, plan_id: int) -> dict[str, Any]:
        """Wait until every mission of a plan is terminal; give the plan."""

        def ended() -> dict[str, Any] | None:
            plan: dict[str, Any] = self.get(f"/plans/{plan_id}")
            done = all(m["mission_status_id"] >= TERMINAL for m in plan["missions"])
            return plan if done else None

        plan: dict[str, Any] = wait_for(ended, f"the end of plan {plan_id}")
        return plan

    def wait_until_delivered(self) -> None:
        """Wait until the edge server keeps no report and no result."""

        def empty() -> bool:
            kinds = ("pose", "battery", "mission_report", "alarm", "image", "observation")
            return not any(rows(self.get(f"/{kind}/")) for kind in kinds)

        wait_for(empty, "delivery to the cloud")


@contextmanager
def running(
    state_dir: Path, *, vehicles: int = 1, speed: float = 5.0, with_video: bool = False
) -> Iterator[FarmSystem]:
    """Run a whole system whose vehicles are connected; also with their live pictures."""
    with FarmSystem(state_dir, vehicles=vehicles, speed=speed) as system:
        if with_video:
            system.environment |= live_pictures(system.settings)
        yield system.start().wait_until_connected()


def example_plan(name: str = "first_flight") -> dict[str, Any]:
    """One of the example plans."""
    plan: dict[str, Any] = json.loads((ROOT / "examples" / "plans" / f"{name}.json").read_text())
    return plan


def short_plan(mission_id: int = 1) -> dict[str, Any]:
    """Take off to 4 m, one waypoint 10 m north, home."""
    place = {"latitude": 40.44340, "longitude": -3.73820, "altitude": 4.0}
    return {
        "missions": [
            {
                "mission_id": mission_id,
                "vehicle_id": 1,
                "command_array": [
                    {"command_id": 1, "command_type_id": 1, "parameters": place},
                    {
                        "command_id": 2,
                        "command_type_id": 3,
                        "parameters": {**place, "latitude": 40.44349},
                    },
                    {"command_id": 3, "command_type_id": 11, "parameters": {"landing": True}},
                ],
            }
        ]
    }


def run_module(*arguments: str, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    """Start `python -m ...` from the root of the project."""
    return subprocess.Popen(
        [sys.executable, "-m", *arguments],
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
