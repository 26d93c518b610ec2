"""Every event in every state of a mission, on this project's own vehicle; the truth judges.

An event may come over a link that loses and delays: it is then carried out as late as that
takes, and no less.
"""

import math
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from afarcloud.enumerations import Status
from tests.support.broker_events import ABORT, SOFT_ABORT, SPEED
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.flying_world import PERFECT, Conditions, FlyingWorld
from tests.support.vehicle_script import HOME

HEIGHT_M: Final = 5.0
POINT_M: Final = (12.0, 8.0, 7.0)
"""Where an event sends the vehicle: metres north, east and above home."""
NEW_SPEED_M_S: Final = 1.5
SPEED_SLACK: Final = 1.5
"""It overshoots when it sets off; the mission's own speed is 4 m/s."""
MISSION_ID: Final = 1201
SLACK_M: Final = 1.5
BRAKES_WITHIN_M: Final = 6.0
OBEYS_WITHIN_S: Final = 10.0
"""Over a link that loses a fifth: an order is repeated, and every repetition may be lost too."""
PATIENCE_S: Final = 300.0


class Event(NamedTuple):
    """A row of the table."""

    kind: int
    has_point: bool = False


EVENTS: Final[Mapping[str, Event]] = {
    "abort": Event(ABORT),
    "abort with a point": Event(ABORT, has_point=True),
    "soft abort": Event(SOFT_ABORT),
    "soft abort with a point": Event(SOFT_ABORT, has_point=True),
    "speed": Event(SPEED),
}
MOMENTS: Final = ("idle", "taking off", "waypoint", "hotpoint", "follow", "landing")


def place(north_m: float, east_m: float, height_m: float) -> dict[str, float]:
    """Give a place as the cloud writes it."""
    per_degree = 111_195.0
    return {
        "latitude": HOME[0] + north_m / per_degree,
        "longitude": HOME[1] + east_m / per_degree / math.cos(math.radians(HOME[0])),
        "altitude": height_m,
    }


def commands() -> tuple[dict[str, Any], ...]:
    """Take off, a waypoint, a circle about it, a target to follow, home."""
    north = 20.0
    centre = place(north, 0.0, HEIGHT_M)
    circle = {name: centre[name] for name in ("latitude", "longitude")} | {
        "orbit_altitude": HEIGHT_M,
        "radius": 8.0,
        "angular_velocity": 15.0,
        "start_point": 4,
    }
    return (
        takeoff(1, altitude=HEIGHT_M),
        waypoint(2) | {"parameters": centre},
        {"command_id": 3, "command_type_id": 7, "parameters": circle},
        {"command_id": 4, "command_type_id": 8, "parameters": place(north, 10.0, HEIGHT_M)},
        go_home(5),
    )


def world_at(
    moment: str, folder: Path, *, conditions: Conditions = PERFECT, seed: int = 1
) -> FlyingWorld:
    """Fly until a moment of the mission; idle is before there is one."""
    world = FlyingWorld(folder, to_broker=conditions, to_vehicle=conditions, seed=seed)
    if moment == "idle":
        world.run(10.0)
        return world
    world.edge.plan(mission(*commands()))
    index = MOMENTS.index(moment) - 1
    world.run_until(lambda: world.running(MISSION_ID) == index, PATIENCE_S)
    if moment == "landing":
        world.run_until(lambda: math.hypot(*world.place[:2]) < 1.0, PATIENCE_S)
    world.run(2.0)
    return world


def send(world: FlyingWorld, name: str) -> int:
    """Send an event; gives the number of its work."""
    event = EVENTS[name]
    more: dict[str, Any] = {"abort": place(*POINT_M)} if event.has_point else {}
    if event.kind == SPEED:
        more["maximum_speed"] = NEW_SPEED_M_S
    return world.edge.event(event.kind, **more)


def interrupt(
    name: str, moment: str, folder: Path, *, conditions: Conditions = PERFECT, seed: int = 1
) -> None:
    """Send an event at a moment and hold what comes of it against the truth."""
    world = world_at(moment, folder, conditions=conditions, seed=seed)
    before, running = world.place, world.running(MISSION_ID)
    number = send(world, name)
    if moment == "idle":
        _judge_idle(world, number)
    elif EVENTS[name].kind == SPEED:
        _judge_speed(world, number)
    else:
        if EVENTS[name] == EVENTS["abort"] and moment != "landing":
            before = _place_when_obeyed(world)
        world.run_until(lambda: _answers(world, number)[-1:] == ["done"], PATIENCE_S)
        _judge_end(world, name, moment, before)
        _judge_statuses(world, EVENTS[name].kind, running or 0)


def _place_when_obeyed(world: FlyingWorld) -> tuple[float, float, float]:
    """Where an order reached the vehicle: it flies on until then, but must not for long."""
    sent_at, mode = world.clock.now_s, world.mode
    while world.mode == mode and world.is_armed:
        world.go_round()
    assert world.clock.now_s - sent_at < OBEYS_WITHIN_S, world.outline()
    return world.place


def _answers(world: FlyingWorld, number: int) -> list[str]:
    return [body["status"] for body in world.edge.acknowledgements(number)]


def _judge_idle(world: FlyingWorld, number: int) -> None:
    world.run(3.0)
    assert _answers(world, number) == ["refused"]
    assert not world.is_armed


def _judge_speed(world: FlyingWorld, number: int) -> None:
    """The mission goes on to its end, at the new speed and no more."""
    world.run_until(lambda: _answers(world, number)[-1:] == ["done"], PATIENCE_S)
    world.run(4.0)  # It brakes to it
    while not world.is_over(MISSION_ID):
        north, east, _ = world.simulation.truth.velocity_ned
        in_items = world.session_state == "RUNNING" and world.mode == "AUTO_MISSION"
        assert not in_items or math.hypot(north, east) < NEW_SPEED_M_S * SPEED_SLACK
        world.run(0.5)
    assert world.edge.statuses(MISSION_ID) == [Status.FINISHED] * 5


def _judge_end(
    world: FlyingWorld, name: str, moment: str, before: tuple[float, float, float]
) -> None:
    """Where the vehicle is in the end: landed, at home, or holding at the point."""
    soft, has_point = EVENTS[name].kind == SOFT_ABORT, EVENTS[name].has_point
    if soft and has_point and moment != "landing":
        world.run(5.0)
        assert world.is_armed
        assert math.dist(world.place, POINT_M) < SLACK_M, world.outline()
        return
    world.run_until(lambda: not world.is_armed, PATIENCE_S)
    assert world.place[2] < 1.0
    there, within_m = (0.0, 0.0), SLACK_M
    if not soft:
        there, within_m = (POINT_M[:2], SLACK_M) if has_point else (before[:2], BRAKES_WITHIN_M)
    assert math.dist(world.place[:2], there) < within_m, world.outline()


def _judge_statuses(world: FlyingWorld, kind: int, running: int) -> None:
    """What ran was cut off or has ended; what came behind it never began."""
    statuses = world.edge.statuses(MISSION_ID)
    reported = {report["mission_status_id"] for report in world.edge.reports(MISSION_ID)}
    terminal = {status for status in reported if Status(status).is_terminal}
    assert len(terminal) == 1, terminal
    assert statuses[:running] == [Status.FINISHED] * running
    allowed = {Status.ABORTED} if kind == ABORT else {Status.ABORTED, Status.FINISHED}
    assert statuses[running] in allowed
    assert set(statuses[running + 1 :]) <= {Status.ABORTED}


def run(conditions: Conditions, seed: int, print_line: Callable[[str], None]) -> None:
    """The whole table."""
    failed = 0
    for moment in MOMENTS:
        for name in EVENTS:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    interrupt(name, moment, Path(folder), conditions=conditions, seed=seed)
                except AssertionError as error:
                    failed += 1
                    print_line(f"{name} when {moment}: {error}")
    print_line(f"{len(MOMENTS) * len(EVENTS)} events, {failed} of them not carried out rightly")
    assert not failed
