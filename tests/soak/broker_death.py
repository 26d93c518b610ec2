"""The broker dies at any second of a mission and comes back up to a minute later.

The vehicle flies on meanwhile. Afterwards every command has ended with its right status, once;
nothing was ordered, photographed or reported twice. The vehicle is this project's own, in vehicle
time; the scripted ones stand for other autopilots.
"""

import dataclasses
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any, Final

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.fake_edge import FakeEdge
from tests.support.flying_world import PERFECT, Conditions, FlyingWorld
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.vehicle_script import Script

PLAN: Final = Path(__file__).parent.parent.parent / "examples" / "plans" / "eleven_commands.json"
AWAY_S: Final = (0.0, 2.0, 10.0, 30.0, 60.0)
PATIENCE_S: Final = 600.0
DEATHS: Final = (1, 1, 2, 3)
"""How often the broker dies in one flight."""
SCRIPTED_ITEM_S: Final = 4.0

ONCE: Final = (
    mavlink.MAV_CMD_DO_ORBIT,
    mavlink.MAV_CMD_DO_FOLLOW,
    mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE,
    mavlink.MAV_CMD_PANORAMA_CREATE,
)
"""Orders that must not be given again, whenever the broker died."""
PER_STRETCH: Final = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_MISSION_START)
"""Orders of the take-off, which begins again where the kill interrupted it."""
IN_FLIGHT: Final = frozenset({"RUNNING", "FLYING_LIVE", "IDLE"})


@dataclass(frozen=True, slots=True)
class Death:
    """When the broker is killed, and for how long no broker runs [s of vehicle time]."""

    at_s: float
    away_s: float


@dataclass(slots=True)
class Undisturbed:
    """What a flight without a death comes to."""

    duration_s: float
    orders: Mapping[int, int]
    uploads: int
    pictures: int = 0
    states: Mapping[int, str] = field(default_factory=dict)  # Of the session, by second


def eleven_commands() -> dict[str, Any]:
    """Give the mission that has every command once."""
    commands: dict[str, Any] = json.loads(PLAN.read_text(encoding="utf-8"))["missions"][0]
    return commands


def uploads(world: FlyingWorld) -> int:
    """How many missions were sent to the vehicle."""
    missions = mavlink.MAV_MISSION_TYPE_MISSION
    return sum(
        frame.kind == "MISSION_COUNT" and frame.message.mission_type == missions
        for frame in world.air.sent
    )


def fly(flown: dict[str, Any], deaths: Sequence[Death], folder: Path) -> FlyingWorld:
    """Fly with the broker dying so often; a death after the end is none."""
    world, number = FlyingWorld(folder), flown["mission_id"]
    world.edge.plan(flown)
    for death in deaths:
        while world.clock.now_s < death.at_s and not world.is_over(number):
            world.go_round()
        revive(world, death.away_s)
    world.run_until_over(number, PATIENCE_S)
    return world


def revive(world: FlyingWorld, away_s: float) -> None:
    """Kill the broker and start another one after a while."""
    world.kill_broker()
    world.run(away_s)
    world.start_broker()


def undisturbed(flown: dict[str, Any], folder: Path) -> Undisturbed:
    """Fly once without a death, to know what there is to expect."""
    world = FlyingWorld(folder)
    world.edge.plan(flown)
    states: dict[int, str] = {}
    while not world.is_over(flown["mission_id"]):
        assert world.clock.now_s < PATIENCE_S, world.outline()
        states[len(states)] = world.session_state
        world.run(1.0)
    judge_reports(world.edge, flown)
    return Undisturbed(
        world.clock.now_s, world.order_counts, uploads(world), world.pictures, states
    )


def judge(world: FlyingWorld, flown: dict[str, Any], expected: Undisturbed, state: str) -> None:
    """Hold a flight against one without a death; `state` is what the broker was doing."""
    judge_reports(world.edge, flown)
    judge_orders(world.order_counts, uploads(world), expected, state)
    assert world.pictures == expected.pictures


def judge_orders(
    orders: Mapping[int, int], uploaded: int, expected: Undisturbed, state: str
) -> None:
    """Nothing was ordered twice; in flight nothing was uploaded, armed or started again."""
    for command in (*ONCE, *(PER_STRETCH if state in IN_FLIGHT else ())):
        sent, wanted = orders.get(command, 0), expected.orders.get(command, 0)
        assert sent <= wanted, f"command {command}: {sent} times instead of {wanted}"
    assert uploaded == expected.uploads or state not in IN_FLIGHT, f"{uploaded} uploads"


def judge_reports(edge: FakeEdge, flown: dict[str, Any]) -> None:
    """Everything FINISHED, each status once and in order, each result set once."""
    number = flown["mission_id"]
    reports = edge.reports(number)
    assert edge.status(number) == Status.FINISHED, reports[-1]
    rows = [[report["mission_status_id"], *_statuses(report)] for report in reports]
    for column in zip(*rows, strict=True):
        assert column == tuple(sorted(column)), rows
        assert column[-1] == Status.FINISHED, rows
    assert sum(row[0] == Status.FINISHED for row in rows) == 1, "the end was reported twice"
    for path in ("/pose/", "/battery/"):
        keys = {post.idempotency_key for post in edge.posts if post.path == path}
        assert len(keys) == len(flown["command_array"]), f"{len(keys)} result sets at {path}"


def _statuses(report: dict[str, Any]) -> Iterator[int]:
    return (entry["command_status_id"] for entry in report["command_report_array"])


def scripted(
    commands: Sequence[dict[str, Any]], script: Script, death: Death | None
) -> tuple[World, str]:
    """Fly a mission on a scripted vehicle; gives what the broker was doing when it died."""
    world, state = World(tick_s=0.02), ""
    world.add_vehicle(script=dataclasses.replace(script, item_time_s=SCRIPTED_ITEM_S))
    world.edge.plan(mission(*commands))
    if death is not None:
        end_s = world.clock.monotonic() + death.at_s
        while world.clock.monotonic() < end_s and world.edge.status(1201) != Status.FINISHED:
            world.tick()
        state = world.app.sessions[1].state.name if 1 in world.app.sessions else "WAITING"
        world.kill_broker()
        world.run(death.away_s)
        world.restart_broker()
    world.run_until_over(1201, PATIENCE_S)
    return world, state


def sweep_scripted(
    commands: Sequence[dict[str, Any]], script: Script, every_s: float, seed: int
) -> int:
    """Let the broker die every so often, once per flight; gives how many flights that took."""
    random, number = Random(seed), 0
    world, _ = scripted(commands, script, None)
    expected = Undisturbed(
        world.clock.monotonic() - 1000.0,
        Counter(world.only_vehicle.commands),
        world.only_vehicle.uploads,
    )
    while (number + 0.5) * every_s < expected.duration_s:
        death = Death((number + 0.5) * every_s, random.choice(AWAY_S))
        try:
            world, state = scripted(commands, script, death)
            judge_reports(world.edge, mission(*commands))
            vehicle = world.only_vehicle
            judge_orders(Counter(vehicle.commands), vehicle.uploads, expected, state)
        except AssertionError as error:
            raise AssertionError(f"{death}: {error}") from error
        number += 1
    return number


def sorties() -> tuple[dict[str, Any], ...]:
    """Two sorties whose items are the same, which only the reports distinguish."""
    return takeoff(1), waypoint(2), go_home(3), takeoff(4), waypoint(5), go_home(6)


def run(
    every_s: float, seed: int, print_line: Callable[[str], None], conditions: Conditions = PERFECT
) -> None:
    """Let the broker die every so many seconds of the eleven commands, up to three times in a row.

    Each flight is a fork of the one that is flown undisturbed beside it. The disk is a slow one.
    """
    flown, random = eleven_commands(), Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        expected = undisturbed(flown, Path(folder) / "undisturbed")
        print_line(f"undisturbed: {expected.duration_s:.0f} s, {expected.pictures} pictures")
        world = FlyingWorld(
            Path(folder) / "disturbed",
            to_broker=conditions,
            to_vehicle=conditions,
            disk_lag_s=DISK_LAG_S,
        )
        world.edge.plan(flown)
        failed = number = 0
        while not world.is_over(flown["mission_id"]):
            number += 1
            deaths = _deaths(random)
            copy = Path(folder) / f"journal-{number}"
            failed += not _fork(world, copy, flown, expected, deaths, print_line)
            world.run(every_s)
    print_line(f"{number} deaths, {failed} of them not survived")
    assert not failed


def _deaths(random: Random) -> list[tuple[float, float]]:
    """How long no broker runs, and how long the next broker lives, in whole seconds."""
    number = random.choice(DEATHS)
    return [(random.choice(AWAY_S), float(random.randrange(11))) for _ in range(number)]


def _fork(
    world: FlyingWorld,
    journal: Path,
    flown: dict[str, Any],
    expected: Undisturbed,
    deaths: Sequence[tuple[float, float]],
    print_line: Callable[[str], None],
) -> bool:
    """Kill the broker in a copy of this world; whether that was survived.

    Each death has how long no broker runs, and how long the next broker lives if it dies too.
    """
    sys.stdout.flush()
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] == 0
    at_s, states, survived = world.clock.now_s, [world.session_state], False
    try:
        world.disk.move(journal)
        revive(world, deaths[0][0])
        for (_, lived_s), (away_s, _) in pairwise(deaths):
            world.run(lived_s)
            states.append(world.session_state)
            revive(world, away_s)
        world.run_until_over(flown["mission_id"], PATIENCE_S)
        judge(world, flown, expected, next((s for s in states if s not in IN_FLIGHT), states[0]))
        survived = True
    except AssertionError as error:
        pauses = ", ".join(
            f"away {away_s:.0f} s, lived {lived_s:.1f} s" for away_s, lived_s in deaths
        )
        print_line(f"killed at {at_s:.1f} s in {' and '.join(states)}: {pauses}: {error}")
    finally:
        sys.stdout.flush()
        os._exit(0 if survived else 1)
