"""Missions over links that lose and delay: all uploaded, proved, flown and reported, once."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, Final, NamedTuple

from tests.soak.broker_death import judge_reports
from tests.soak.broker_events import HEIGHT_M, place
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.flying_world import Conditions, FlyingWorld

LOSSES: Final = (0.0, 0.05, 0.2)
ROUND_TRIPS_S: Final = (0.0, 0.3, 1.5)
PATIENCE_S: Final = 900.0


class Flown(NamedTuple):
    """What a mission took [s of vehicle time]."""

    started_s: float
    ended_s: float


def conditions(loss: float, round_trip_s: float) -> Conditions:
    """A link that loses so much in each direction, and duplicates and reorders as well."""
    disorder = 0.05 if loss else 0.0
    return Conditions(
        loss=loss,
        delay_us=round(round_trip_s / 2.0 * 1e6),
        duplication=disorder,
        reordering=disorder,
    )


def short_flight(mission_id: int = 1201) -> dict[str, Any]:
    """Up, two points, home."""
    flown: dict[str, Any] = mission(
        takeoff(1, altitude=HEIGHT_M),
        waypoint(2) | {"parameters": place(8.0, 0.0, HEIGHT_M)},
        waypoint(3) | {"parameters": place(8.0, 6.0, HEIGHT_M)},
        go_home(4),
        mission_id=mission_id,
    )
    return flown


def fly(loss: float, round_trip_s: float, seed: int, folder: Path) -> Flown:
    """Fly one mission over one such link, and judge it."""
    link, flown = conditions(loss, round_trip_s), short_flight()
    world = FlyingWorld(folder, to_broker=link, to_vehicle=link, seed=seed)
    world.edge.plan(flown)
    armed, armings, started_s = False, 0, 0.0
    while not world.is_over(flown["mission_id"]):
        assert world.clock.now_s < PATIENCE_S, world.outline()
        world.go_round()
        armings += world.is_armed and not armed
        armed = world.is_armed
        started_s = started_s or (world.clock.now_s if armed else 0.0)
    judge_reports(world.edge, flown)
    assert armings == 1, f"armed {armings} times"
    assert max(world.place[:2], key=abs) < 1.0, world.outline()
    return Flown(started_s, world.clock.now_s)


def run(missions: int, seed: int, print_line: Callable[[str], None]) -> None:
    """Fly the whole matrix, so many missions per cell."""
    failed = 0
    for loss in LOSSES:
        for round_trip_s in ROUND_TRIPS_S:
            flown: list[Flown] = []
            for number in range(missions):
                with tempfile.TemporaryDirectory() as folder:
                    try:
                        flown.append(fly(loss, round_trip_s, seed + number, Path(folder)))
                    except AssertionError as error:
                        print_line(
                            f"loss {loss:.0%}, {round_trip_s} s, seed {seed + number}: {error}"
                        )
            failed += missions - len(flown)
            taken = f", armed after {median(f.started_s for f in flown):.1f} s" if flown else ""
            print_line(
                f"loss {loss:.0%} each way, round trip {round_trip_s} s: "
                f"{len(flown)} of {missions}{taken}"
            )
    assert not failed
