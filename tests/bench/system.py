"""Latencies, processor share and memory of the running system."""

import struct
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from tests.bench.process import cpu_seconds, resident_mb
from tests.bench.results import Result, at_least, at_most, percentile
from tests.bench.wiretap import MISSION_ACK, POSITION, Wiretap
from tests.support.system import FarmSystem, free_ports, wait_for

PLANS = 20
QUIET_SECONDS = 30
ACCEPTED = 0
PAYLOAD_TYPE_AT = 2
"""MISSION_ACK's payload: target system, target component, type (trailing zeros cut off)."""

MEMORY_BARS_MB = {"edge": 150.0, "broker": 100.0, "vehicle-1": 200.0}


def ten_commands(mission_id: int) -> dict[str, Any]:
    """Build a plan of ten commands that is soon flown: up 3 m, eight points, home."""
    place = {"latitude": 40.44340, "longitude": -3.73820, "altitude": 3.0}
    waypoint = {**place, "acceptance_radius": 3.0}
    commands = [
        {"command_id": 1, "command_type_id": 1, "parameters": place},
        *({"command_id": n, "command_type_id": 3, "parameters": waypoint} for n in range(2, 10)),
        {"command_id": 10, "command_type_id": 11, "parameters": {"landing": True}},
    ]
    return {"mission_id": mission_id, "vehicle_id": 1, "command_array": commands}


def measure(state_dir: Path) -> Iterator[Result]:
    """Measure a system of one vehicle behind a wiretap."""
    (tap_port,) = free_ports(1)
    with FarmSystem(state_dir, speed=1.0) as system:
        broker_port = system.settings.mavlink_port
        system.environment["TRUTH"] = "0"
        with Wiretap(tap_port, broker_port) as tap:
            system.start("cloud", "edge", "broker")
            system.environment["MAVLINK_PORT"] = str(tap_port)
            system.start("vehicle-1").wait_until_connected()
            yield from _upload_latency(system, tap)
            yield from _idle_share(system)
            yield from _telemetry_latency(system, tap)
            for name, bar in MEMORY_BARS_MB.items():
                used = resident_mb(system.process_id(name))
                yield at_most(f"resident memory of {name}", used, "MB", bar, [used])


def _upload_latency(system: FarmSystem, tap: Wiretap) -> Iterator[Result]:
    system.fly(ten_commands(PLANS + 1))  # The first one waits for the vehicle's estimator.
    latencies = []
    for number in range(1, PLANS + 1):
        noted = len(tap.passed)
        posted = time.time()
        answer = system.post("/plans/", ten_commands(number))
        answer.raise_for_status()
        latencies.append(wait_for(lambda: _accepted(tap, noted), "MISSION_ACK") - posted)  # noqa: B023
        system.wait_until_ended(answer.json()["id"])
    for percent, bar in ((50, 50.0), (99, 150.0)):
        value = percentile(latencies, percent) * 1e3
        name = f"POST of a 10-command plan to MISSION_ACK, p{percent}"
        yield at_most(name, value, "ms", bar, [latency * 1e3 for latency in latencies])


def _accepted(tap: Wiretap, noted: int) -> float | None:
    for moment, number, payload in tap.passed[noted:]:
        if number == MISSION_ACK and not any(payload[PAYLOAD_TYPE_AT : PAYLOAD_TYPE_AT + 1]):
            return moment
    return None


def _idle_share(system: FarmSystem) -> Iterator[Result]:
    names = ("vehicle-1", "broker", "edge")
    before = [cpu_seconds(system.process_id(name)) for name in names]
    started = time.monotonic()
    time.sleep(QUIET_SECONDS)
    passed = time.monotonic() - started
    for name, used, bar in zip(names, before, (6.0, 10.0, 10.0), strict=True):
        share = (cpu_seconds(system.process_id(name)) - used) / passed * 100.0
        yield at_most(f"share of one core at SPEED=1, {name}", share, "%", bar, [share])


def _telemetry_latency(system: FarmSystem, tap: Wiretap) -> Iterator[Result]:
    """From the moment in which a position leaves the vehicle until the cloud has its vector."""
    reported = [
        (moment, place_of(body)) for moment, number, body in tap.passed if number == POSITION
    ]
    latencies = []
    for record in system.cloud("/state_vector"):
        vector = record["body"]
        made_at = datetime.fromisoformat(vector["recorded_at"]).timestamp()
        place = (vector["latitude"], vector["longitude"], vector["altitude"])
        left_at = max(moment for moment, known in reported if moment <= made_at and known == place)
        latencies.append(record["received_at"] - left_at)
    for percent, bar in ((50, 50.0), (99, 250.0)):
        value = percentile(latencies, percent) * 1e3
        name = f"state vector from vehicle to cloud, p{percent}"
        yield at_most(name, value, "ms", bar, [latency * 1e3 for latency in latencies])
    rate = len(latencies)
    yield at_least("state vectors that reached the cloud", rate, "records", 1, [rate])


def place_of(global_position: bytes) -> tuple[float, float, float]:
    """Read latitude and longitude [deg] and height above home [m] of GLOBAL_POSITION_INT."""
    whole = global_position.ljust(28, b"\0")  # MAVLink 2 cuts trailing zeros off
    _, latitude_e7, longitude_e7, _, relative_mm = struct.unpack_from("<Iiiii", whole)
    return latitude_e7 / 1e7, longitude_e7 / 1e7, relative_mm / 1e3
