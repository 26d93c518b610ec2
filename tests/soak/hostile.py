"""A farm under everything at once: fleet, cut answers, slow sockets, kills, full disk, pilots.

The real programs fly `VEHICLES` vehicles in real time for `MINUTES`. Operators post missions,
abort some and release the vehicles that are held; a proxy spoils the cloud's answers; sockets
without a key stay half open; edge server, relay, broker and cloud are killed; the edge server's
disk fills up; pilots take vehicles over. Then the faults stop, and the laws are held against what
was acknowledged, what the cloud has and what the vehicles truly did.
"""

import csv
import os
import signal
import subprocess
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, Final

import requests

from sim.launch.farm_client import rows
from tests.bench.process import resident_mb
from tests.soak.cutting_proxy import CuttingProxy
from tests.soak.pilot import Pilots
from tests.soak.slow_sockets import SlowSockets
from tests.support.process_tree import command_words, descendants
from tests.support.system import FarmSystem, wait_for

ABORT, SOFT_ABORT = 1, 2
TERMINAL: Final = 3
SPOILED_SHARE: Final = 0.15
SLOW_SOCKETS: Final = 300
DISK_MIB: Final = 96
ANSWER_LIMIT_S: Final = 10.0
SETTLE_S: Final = 900.0
LOW_CHARGE: Final = 0.35
"""Share of charge below which a standing vehicle gets a new battery."""
LANDED_S: Final = 300.0
TOUCHDOWN_LIMIT_M_S: Final = 1.0
STANDING_M: Final = 0.3
"""Height above home below which a vehicle touches the ground."""
RANGE_LIMIT_M: Final = 400.0
EDGE_LIMIT_MB, BROKER_LIMIT_MB = 250.0, 120.0
HOME: Final = (40.44340, -3.73820)
_METRES_PER_DEGREE: Final = 111_320.0


@dataclass(slots=True)
class Record:
    """What was done, and what was answered."""

    missions: dict[int, int] = field(default_factory=dict)  # Mission id to plan id, acknowledged
    abort_answer_s: list[float] = field(default_factory=list)
    done: Counter[str] = field(default_factory=Counter)
    largest_mb: dict[str, float] = field(default_factory=lambda: defaultdict(float))


class Farm:
    """The system with its persons; every method may fail while a fault lasts."""

    def __init__(self, system: FarmSystem, seed: int) -> None:
        self.system = system
        self.record = Record()
        self._random = Random(seed)
        self._next_mission = 1
        self._just_swapped: set[int] = set()

    def plan(self, vehicle: int) -> None:
        """Post a mission of one vehicle: up, one waypoint, home."""
        number, self._next_mission = self._next_mission, self._next_mission + 1
        north_m, height_m = self._random.uniform(10.0, 60.0), 4.0 + 2.0 * (vehicle % 10)
        east_deg = HOME[1] + 3.0 * (vehicle - 1) / (_METRES_PER_DEGREE * 0.761)
        place = {"latitude": HOME[0], "longitude": east_deg, "altitude": height_m}
        away = {**place, "latitude": HOME[0] + north_m / _METRES_PER_DEGREE}
        commands = [
            {"command_id": 1, "command_type_id": 1, "parameters": place},
            {"command_id": 2, "command_type_id": 3, "parameters": away},
            {"command_id": 3, "command_type_id": 11, "parameters": {"landing": True}},
        ]
        mission = {"mission_id": number, "vehicle_id": vehicle, "command_array": commands}
        answer = self._post("/plans/", {"missions": [mission]})
        if answer is not None and answer.status_code == 201:
            self.record.missions[number] = answer.json()["id"]
            self.record.done["missions posted"] += 1

    def abort(self, vehicle: int, kind: int) -> None:
        """Abort what a vehicle flies; measures how long the answer takes."""
        body = {"sequence_number": 1, "vehicle_id": vehicle, "event_type_id": kind}
        began = time.monotonic()
        answer = self._post("/events/", body)
        if answer is not None and answer.status_code < 500:
            self.record.abort_answer_s.append(time.monotonic() - began)
            self.record.done[f"aborts answered {answer.status_code}"] += 1

    def tend(self) -> None:
        """Release held vehicles, give work to idle ones, swap one low battery."""
        has_swapped = False
        for state in rows(self.system.get("/vehicles/")):
            vehicle = state["vehicle_id"]
            is_low = (state.get("battery_percentage") or 1.0) < LOW_CHARGE
            if not is_low:
                self._just_swapped.discard(vehicle)
            if state.get("held"):
                self._post(f"/vehicles/{vehicle}/release", {"reason": "inspected"})
                self.record.done["releases"] += 1
            elif state.get("mission_id") is None and not state.get("armed"):
                if is_low:
                    if not has_swapped and vehicle not in self._just_swapped:
                        self._swap_battery(vehicle)
                        has_swapped = True
                else:
                    self.plan(vehicle)

    def _swap_battery(self, vehicle: int) -> None:
        """Start the vehicle anew with a full battery; its true track so far is kept.

        Not again before the edge server shows the new charge: until then it shows the old one.
        """
        self._just_swapped.add(vehicle)
        name = f"vehicle-{vehicle}"
        self.system.kill(name)
        track = self.system.state_dir / name / "truth.csv"
        number = len(list(track.parent.glob("truth*.csv")))
        track.rename(track.with_name(f"truth-{number}.csv"))
        self.system.start(name)
        self.record.done["batteries swapped"] += 1

    def _post(self, path: str, body: Any) -> requests.Response | None:
        try:
            return self.system.post(path, body)
        except requests.RequestException as error:
            self.record.done[f"no answer: {type(error).__name__}"] += 1
            return None


@contextmanager
def small_disk(folder: Path) -> Iterator[bool]:
    """A file system of its own for the edge server; false where this user may not mount one."""
    folder.mkdir(parents=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MIB}m", "tmpfs", str(folder)]
    mounted = subprocess.run(command, check=False, capture_output=True).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def fill(folder: Path, ends: Callable[[], bool]) -> None:
    """Take all room of a disk until `ends`; what is freed meanwhile is taken too."""
    ballast = folder / "ballast-of-the-soak"
    with ballast.open("ab", buffering=0) as file:
        while not ends():
            with suppress(OSError):
                while True:
                    file.write(bytes(65_536))
            time.sleep(0.5)
    ballast.unlink()


class Faults:
    """What goes wrong, one thing after the other; several last at the same time."""

    def __init__(self, farm: Farm, pilots: Pilots, disk: Path | None, seed: int) -> None:
        self._farm = farm
        self._pilots = pilots
        self._disk = disk
        self._random = Random(seed)
        self._filling: threading.Thread | None = None
        self._full_until_s = 0.0

    def one(self) -> None:
        """Draw one fault."""
        system, done = self._farm.system, self._farm.record.done
        fault = self._random.choice(
            ("edge", "relay", "broker", "cloud", "pilot", "pilot", "abort", "abort", "disk")
        )
        if fault == "relay":
            done["relay killed"] += _kill_relay(system.process_id("edge"))
        elif fault == "pilot":
            done["takeovers"] += self._pilots.take() is not None
        elif fault == "abort":
            armed = sorted(self._pilots.armed())
            if armed:
                kind = self._random.choice((ABORT, SOFT_ABORT))
                self._farm.abort(self._random.choice(armed), kind)
        elif fault == "disk":
            self._fill()
        else:
            system.kill(fault)
            time.sleep(self._random.choice((0.0, 1.0, 10.0)))
            system.start(fault)
            done[f"{fault} killed"] += 1

    def stop(self) -> None:
        """Let nothing go wrong any more."""
        self._full_until_s = 0.0
        if self._filling is not None:
            self._filling.join()

    def _fill(self) -> None:
        disk = self._disk
        if disk is None or (self._filling is not None and self._filling.is_alive()):
            return
        self._full_until_s = time.monotonic() + self._random.uniform(10.0, 60.0)
        self._filling = threading.Thread(
            target=fill, args=(disk, lambda: time.monotonic() > self._full_until_s)
        )
        self._filling.start()
        self._farm.record.done["disk filled"] += 1


def _kill_relay(edge: int) -> bool:
    for process_id in descendants(edge):
        if "relay" in command_words(process_id):
            with suppress(ProcessLookupError):
                os.kill(process_id, signal.SIGKILL)
                return True
    return False


def run(folder: Path, vehicles: int, minutes: float, seed: int, say: Callable[[str], None]) -> None:
    """Do all of it; raises AssertionError with every law that was broken."""
    with ExitStack() as stack:
        disk = folder / "disk"
        has_disk = stack.enter_context(small_disk(disk))
        system = FarmSystem(folder / "var", vehicles=vehicles, speed=1.0)
        proxy = stack.enter_context(
            CuttingProxy(system.settings.cloud_port, seed, share=SPOILED_SHARE)
        )
        keys = str(system.settings.keys_dir.resolve())
        system.own["edge"] = {"CLOUD_URL": f"http://127.0.0.1:{proxy.port}"}
        if has_disk:
            budget = {"DATA_BUDGET_MIB": "48", "PICTURE_BUDGET_MIB": "8"}
            system.own["edge"] |= {"STATE_DIR": str(disk), "KEYS_DIR": keys, **budget}
        else:
            say("this user may not mount a file system: the disk stays as large as it is")
        stack.enter_context(system)
        pilots = stack.enter_context(Pilots(system.settings.gcs_port, seed))
        system.start().wait_until_connected()
        farm = Farm(system, seed)
        slow = stack.enter_context(SlowSockets(system.settings.edge_port, SLOW_SOCKETS, seed))
        faults = Faults(farm, pilots, disk if has_disk else None, seed)
        _storm(farm, faults, minutes * 60.0, say)
        faults.stop()
        proxy.share_off()
        slow.__exit__()
        broken = _settle(farm, pilots)
        _report(farm.record, proxy.counts + slow.counts, pilots, say)
        broken += _judge(farm, pilots)
    assert not broken, "\n".join(broken)


def _storm(farm: Farm, faults: Faults, seconds: float, say: Callable[[str], None]) -> None:
    ends, tell_s = time.monotonic() + seconds, 0.0
    while time.monotonic() < ends:
        with suppress(requests.RequestException):
            farm.tend()
        faults.one()
        _measure(farm)
        if time.monotonic() > tell_s:
            tell_s = time.monotonic() + 60.0
            left_min = max(0.0, ends - time.monotonic()) / 60.0
            say(f"{left_min:.0f} min to go: {dict(farm.record.done)}")
        time.sleep(5.0)


def _measure(farm: Farm) -> None:
    for name in ("edge", "broker"):
        with suppress(OSError, ValueError):
            size_mb = resident_mb(farm.system.process_id(name))
            farm.record.largest_mb[name] = max(farm.record.largest_mb[name], size_mb)


def _settle(farm: Farm, pilots: Pilots) -> list[str]:
    """Wait, without faults, until nothing is under way; gives what never ended."""
    broken = []
    for plan_id in sorted(set(farm.record.missions.values())):
        try:
            wait_for(partial(_has_ended, farm.system, plan_id), f"plan {plan_id}", SETTLE_S)
        except AssertionError as error:
            broken.append(f"a plan never ended: {error}")
    try:
        farm.system.wait_until_delivered()
    except AssertionError as error:
        broken.append(f"records stay on the farm: {error}")
    try:
        wait_for(lambda: not pilots.armed(), "every vehicle to stand disarmed", LANDED_S)
    except AssertionError:
        broken += [f"never disarmed: {pilots.describe(number)}" for number in pilots.armed()]
    return broken


def _has_ended(system: FarmSystem, plan_id: int) -> bool:
    for state in rows(system.get("/vehicles/")):
        if state.get("held"):
            system.post(f"/vehicles/{state['vehicle_id']}/release", {"reason": "the end"})
    missions = system.get(f"/plans/{plan_id}")["missions"]
    return all(mission["mission_status_id"] >= TERMINAL for mission in missions)


def _judge(farm: Farm, pilots: Pilots) -> list[str]:
    """Every law that was broken, in sentences."""
    system = farm.system
    broken = [
        f"vehicle {each.system} was put into main mode {each.lost_to_mode} in its pilot's hands: "
        f"{'; '.join(each.texts)}"
        for each in pilots.done
        if each.lost_to_mode is not None and not each.in_failsafe
    ]
    broken += _judge_cloud(farm, system.cloud("/records"))
    for name, limit_mb in (("edge", EDGE_LIMIT_MB), ("broker", BROKER_LIMIT_MB)):
        if farm.record.largest_mb[name] > limit_mb:
            broken.append(f"{name} took {farm.record.largest_mb[name]:.0f} MB")
    for number in system.settings.started_ids:
        for track in sorted((system.state_dir / f"vehicle-{number}").glob("truth*.csv")):
            broken += _judge_track(number, track)
    return broken


def _judge_cloud(farm: Farm, records: list[dict[str, Any]]) -> list[str]:
    """One terminal report per mission, which agrees with the plan; nothing after it."""
    broken = []
    reports: dict[int, list[int]] = defaultdict(list)
    for record in records:
        if record["kind"] == "mission_report":
            body = record["body"]
            reports[body["mission_id"]].append(body["mission_status_id"])
    for number, plan_id in farm.record.missions.items():
        (mission,) = farm.system.get(f"/plans/{plan_id}")["missions"]
        status, statuses = mission["mission_status_id"], reports[number]
        terminal = [each for each in statuses if each >= TERMINAL]
        if len(terminal) > 1 or (terminal and statuses[-1] != terminal[0]):
            broken.append(f"mission {number}: the cloud received {statuses}")
        if terminal and terminal[0] != status:
            broken.append(f"mission {number}: {status} on the farm, {terminal[0]} in the cloud")
    return broken


def _judge_track(number: int, path: Path) -> list[str]:
    """Nothing hit the ground, left the farm, or stands on it with turning rotors at the end."""
    broken: list[str] = []
    former: float | None = None
    with path.open(newline="", encoding="utf-8") as log:
        for row in csv.DictReader(line for line in log if line.endswith("\n")):
            height = float(row["height_above_home_m"])
            down = float(row["velocity_down_m_s"])
            fast = down > TOUCHDOWN_LIMIT_M_S
            if fast and former is not None and former > STANDING_M >= height:
                at_s = row["time_s"]
                broken.append(f"vehicle {number} hit the ground at {down:.1f} m/s, {at_s} s")
            north = (float(row["latitude_deg"]) - HOME[0]) * _METRES_PER_DEGREE
            if abs(north) > RANGE_LIMIT_M:
                broken.append(f"vehicle {number} was {north:.0f} m from home at {row['time_s']} s")
                break
            former = height
    return broken


def _report(
    record: Record, counts: Counter[str], pilots: Pilots, say: Callable[[str], None]
) -> None:
    say(", ".join(f"{name} {count}" for name, count in sorted(record.done.items())))
    say(", ".join(f"{name} {count}" for name, count in sorted(counts.items())))
    say(f"{len(pilots.done)} takeovers, {sum(each.has_it for each in pilots.done)} of them taken")
    for each in pilots.done:
        if each.lost_to_mode is not None and each.in_failsafe:
            say(f"vehicle {each.system} left its pilot by its failsafe: {'; '.join(each.texts)}")
    answers = sorted(record.abort_answer_s)
    if answers:
        p50, p99 = answers[len(answers) // 2], answers[int(0.99 * (len(answers) - 1))]
        say(f"{len(answers)} aborts answered")
        say(f"p50 {p50:.3f} s, p99 {p99:.3f} s, worst {answers[-1]:.3f} s")
    sizes = ", ".join(f"{name} {size:.0f} MB" for name, size in record.largest_mb.items())
    say(f"at most {sizes}")
