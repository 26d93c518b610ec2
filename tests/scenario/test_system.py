"""The whole system as its users meet it: real processes, real wires, the simulator's truth."""

import itertools
import re
import shlex
import signal
import subprocess
import sys
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from sim.launch.farm_client import rows
from tests.support.system import (
    ROOT,
    FarmSystem,
    example_plan,
    run_module,
    running,
    short_plan,
    wait_for,
)
from tests.support.truth import closest_approach_m, horizontal_distance_m, read_track

pytestmark = pytest.mark.scenario

HOME = (40.44340, -3.73820)
HOME_STANDING_HEIGHT_M = 0.3
CURL_WHERE_THERE_IS_NONE = (
    "command -v curl >/dev/null || "
    f'curl() {{ {shlex.quote(sys.executable)} -m tests.support.curl "$@"; }}'
)


def mission_reports(system: FarmSystem) -> list[dict[str, Any]]:
    return [record["body"] for record in system.cloud("/mission_report")]


def assert_each_once_and_in_order(system: FarmSystem) -> None:
    """Every stream of (vehicle, kind) counts up by one from its start, nothing twice."""
    records = system.cloud("/records")
    assert max(Counter(record["message_id"] for record in records).values()) == 1
    streams: dict[tuple[int, str], list[int]] = {}
    for record in records:
        stream = streams.setdefault((record["body"]["vehicle_id"], record["kind"]), [])
        stream.append(record["body"]["sequence_number"])
    for name, numbers in streams.items():
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), name


def tutorial_commands() -> list[str]:
    """The curl lines of the tutorial, as printed there."""
    page = (ROOT / "docs/tutorial/first-flight.md").read_text()
    return re.findall(r"^curl .*$", page, re.MULTILINE)


def type_into_shell(system: FarmSystem, command: str) -> str:
    """Run a line of the tutorial with this test's ports and state in place of the defaults."""
    line = (
        command.replace("127.0.0.1:8000", f"127.0.0.1:{system.settings.edge_port}")
        .replace("127.0.0.1:8100", f"127.0.0.1:{system.settings.cloud_port}")
        .replace("var/keys", shlex.quote(str(system.state_dir / "keys")))
    )
    run = subprocess.run(
        ["bash", "-c", f"{CURL_WHERE_THERE_IS_NONE}\n{line}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return run.stdout


def test_the_curl_lines_of_the_tutorial_fly_the_vehicle(tmp_path: Path) -> None:
    with running(tmp_path / "var") as system:
        post, show_plan, show_vehicles, reports, poses, kept, _latest = tutorial_commands()
        assert '"id":1' in type_into_shell(system, post).replace(" ", "")
        assert "connected" in type_into_shell(system, show_vehicles)
        plan = system.wait_until_ended(1)
        commands = plan["missions"][0]["command_array"]
        assert [c["command_status_id"] for c in commands] == [3] * 6
        assert "FINISHED" in type_into_shell(system, show_plan)
        system.wait_until_delivered()
        assert '"mission_status_id":3' in type_into_shell(system, reports).replace(" ", "")
        assert '"latitude"' in type_into_shell(system, poses)
        assert '"latitude"' not in type_into_shell(system, kept)
        statuses = [report["mission_status_id"] for report in mission_reports(system)]
        assert 2 in statuses
        assert statuses[-1] == 3
        assert statuses == sorted(statuses)
        assert len(system.cloud("/pose")) == len(system.cloud("/battery")) == 6
        assert_each_once_and_in_order(system)


def test_the_true_track_passes_every_waypoint_and_ends_at_home(tmp_path: Path) -> None:
    document = example_plan()
    with running(tmp_path / "var") as system:
        system.fly(document)
        track = read_track(system.state_dir / "vehicle-1" / "truth.csv")
    waypoints = [
        command["parameters"]
        for command in document["plan"]["missions"][0]["command_array"]
        if command["command_type_id"] == 3
    ]
    assert len(waypoints) == 4
    for waypoint in waypoints:
        distance_m = closest_approach_m(
            track, waypoint["latitude"], waypoint["longitude"], waypoint["altitude"]
        )
        assert distance_m <= waypoint["acceptance_radius"]
    assert horizontal_distance_m(track[-1], *HOME) <= 1.0
    assert track[-1].height_above_home_m < HOME_STANDING_HEIGHT_M


def test_a_cloud_unreachable_for_a_flight_gets_everything_afterwards(tmp_path: Path) -> None:
    with FarmSystem(tmp_path / "var") as system:
        system.start("edge", "broker", "vehicle-1").wait_until_connected()
        system.fly(short_plan())
        assert rows(system.get("/pose/")), "the edge server keeps what nobody has confirmed"
        system.start("cloud")
        system.wait_until_delivered()
        assert len(system.cloud("/pose")) == len(system.cloud("/battery")) == 3
        assert mission_reports(system)[-1]["mission_status_id"] == 3
        assert_each_once_and_in_order(system)


@pytest.mark.parametrize(
    "order", list(itertools.permutations(("edge", "broker", "vehicle-1"))), ids="-".join
)
def test_any_order_of_starting_flies(order: tuple[str, ...], tmp_path: Path) -> None:
    with FarmSystem(tmp_path / "var", speed=10.0) as system:
        for name in order:
            system.start(name)
            if name == "edge":
                system.wait_until_edge_answers()
            else:
                wait_for(partial(system.log_of, name), f"a first line of {name}")
        system.start("cloud").wait_until_connected()
        system.fly(short_plan())
        system.wait_until_delivered()


@pytest.mark.parametrize("victim", ["edge", "broker", "vehicle-1", "cloud"])
def test_after_a_kill_while_idle_the_next_plan_flies(victim: str, tmp_path: Path) -> None:
    with running(tmp_path / "var", speed=10.0) as system:
        system.fly(short_plan(mission_id=1))
        system.kill(victim)
        system.start(victim).wait_until_connected()
        system.fly(short_plan(mission_id=2))
        system.wait_until_delivered()
        assert len(system.cloud("/pose")) == 6
        assert {report["mission_id"] for report in mission_reports(system)} == {1, 2}


def test_make_sim_leaves_neither_process_nor_port_behind(tmp_path: Path) -> None:
    """Also where it was started with SIGINT ignored, as by `nohup` or with `&` in a script."""
    system = FarmSystem(tmp_path / "var")
    for stop in (signal.SIGINT, signal.SIGTERM):
        former = signal.signal(signal.SIGINT, signal.SIG_IGN)
        launcher = run_module("sim", environment=system.environment)
        signal.signal(signal.SIGINT, former)
        text = read_until(launcher, "Stop with Ctrl-C.")
        refused = run_module("sim", environment=FarmSystem(tmp_path / "var").environment)
        said, _ = refused.communicate(timeout=60)
        assert refused.returncode == 1
        assert f"a system runs on it already (process {launcher.pid})" in said.decode()
        assert "vehicle" not in said.decode(), "nothing starts before it is refused"
        launcher.send_signal(stop)
        rest, _ = launcher.communicate(timeout=60)
        assert launcher.returncode == 0, rest.decode()
        assert f"curl -sS -X POST {system.settings.edge_url}/plans/" in text
        assert processes_that_know(system.state_dir) == []


def read_until(process: subprocess.Popen[bytes], last: str) -> str:
    """Read a program's output up to a line."""
    assert process.stdout is not None
    text = ""
    for raw in process.stdout:
        text += raw.decode()
        if last in text:
            return text
    raise AssertionError(f"{last!r} was never printed:\n{text}")


def processes_that_know(state_dir: Path) -> list[str]:
    """Processes that were started with this state folder in their environment."""
    wanted = f"STATE_DIR={state_dir}".encode()
    found = []
    for environment in Path("/proc").glob("[0-9]*/environ"):
        try:
            if wanted in environment.read_bytes().split(b"\0"):
                found.append(environment.parent.name)
        except OSError:
            continue
    return found


@pytest.mark.parametrize("vehicles", [1, 3])
def test_make_demo_ends_when_the_cloud_holds_everything(vehicles: int, tmp_path: Path) -> None:
    system = FarmSystem(tmp_path / "var", vehicles=vehicles)
    demo = run_module("sim", "demo", environment=system.environment)
    output, _ = demo.communicate(timeout=240)
    text = output.decode()
    assert demo.returncode == 0, text
    for number in range(1, vehicles + 1):
        assert f"mission {number}  vehicle {number}" in text
    assert "the cloud holds every report and result" in text
    assert processes_that_know(system.state_dir) == []
