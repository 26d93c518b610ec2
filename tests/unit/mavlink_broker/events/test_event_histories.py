"""Any history of events, pilots, restarts and lost datagrams: what an event promises holds.

The laws, whatever comes in whichever order:

* every event has exactly one final answer, and it comes;
* a mission has one terminal status;
* once a pilot has the vehicle, the broker sends no order;
* when nobody else flies, an event that ends missions brings the vehicle to the ground;
* a mission that is paused at the end flies on when it is resumed, and ends.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, Final

import pytest

from tests.support.autopilot_families import OWN
from tests.support.broker_events import ABORT, PAUSE, RESUME, RETURN_HOME, SOFT_ABORT, SPEED
from tests.support.broker_world import World, follow, go_home, mission, takeoff, waypoint
from tests.support.orders import orders
from tests.support.vehicle_script import ARDUPILOT, COPTER_STABILIZE, PX4, PX4_POSITION, Script

ENDING: Final = {ABORT, SOFT_ABORT, RETURN_HOME}
FINAL: Final = {"done", "refused"}
STEPS: Final = 10
SCRIPTS: Final = {"px4": PX4, "own": OWN, "ardupilot": ARDUPILOT}


class History:
    """One random history of one vehicle."""

    def __init__(self, seed: int, script: Script, journal: Path) -> None:
        self.random = Random(seed)
        loss = self.random.choice([0.0, 0.0, 0.1])
        self.world = World(journal=journal, loss=loss, seed=seed)
        self.vehicle = self.world.add_vehicle(
            script=dataclasses.replace(script, item_time_s=6.0, goes_to_places=False)
        )
        self.events: list[tuple[int, int]] = []
        self.piloted_since: int | None = None
        self.did: list[str] = []

    def live(self) -> None:
        """Fly, and let things happen at random times."""
        world = self.world
        commands = [takeoff(1), waypoint(2, hold_time=20.0), follow(3), waypoint(4), go_home(5)]
        world.edge.plan(mission(*commands))
        world.run_until(lambda: self.vehicle.airborne)
        choices: list[Callable[[], None]] = [self._event] * 8 + [self._restart, self._restart]
        if self.random.random() < 0.3:
            choices.append(self._pilot)
        for _ in range(STEPS):
            world.run(self.random.choice([0.05, 0.3, 1.0, 3.0, 8.0]))
            self.random.choice(choices)()

    def _event(self) -> None:
        kind = self.random.choice([PAUSE, PAUSE, RESUME, RESUME, SPEED, *ENDING])
        more: dict[str, Any] = {"maximum_speed": 2.0} if kind == SPEED else {}
        if kind in ENDING and self.random.random() < 0.6:
            return
        self.events.append((self.world.edge.event(kind, **more), kind))
        self.did.append(f"{self.world.clock.now:.2f} event {kind}")

    def _restart(self) -> None:
        self.world.restart_broker()
        self.did.append(f"{self.world.clock.now:.2f} restart")

    def _pilot(self) -> None:
        if self.piloted_since is None and self.vehicle.armed:
            is_copter = self.vehicle.script.autopilot == ARDUPILOT.autopilot
            self.vehicle.steer(COPTER_STABILIZE if is_copter else PX4_POSITION)
            self.world.run(1.5)
            self.piloted_since = len(self.vehicle.frames)
            self.did.append(f"{self.world.clock.now:.2f} pilot")

    def check(self) -> None:
        """Check the laws when everything has come to its end."""
        world, vehicle = self.world, self.vehicle
        world.run(60.0)
        if self.piloted_since is not None:
            assert orders(vehicle, self.piloted_since) == [], self.did
        for number, kind in self.events:
            answers = [body["status"] for body in world.edge.acknowledgements(number)]
            finals = [status for status in answers if status in FINAL]
            assert finals, (kind, answers, self.did)
            assert len(set(finals)) == 1, (kind, answers, self.did)
        ended = [
            number
            for number, kind in self.events
            if kind in ENDING and world.edge.acknowledgements(number)[-1]["status"] == "done"
        ]
        if self.piloted_since is None:
            if not ended and vehicle.armed:
                world.edge.event(RESUME)
            world.run(240.0)
            assert not vehicle.armed, (vehicle.custom_mode, self.did)
        statuses = [
            report["mission_status_id"]
            for report in world.edge.reports(1201)
            if report["mission_status_id"] >= 3
        ]
        assert len(set(statuses)) == 1, (statuses, self.did)


@pytest.mark.first_case
@pytest.mark.parametrize("family", SCRIPTS)
@pytest.mark.parametrize("seed", range(1))
def test_events_keep_their_promises_in_any_history(family: str, seed: int, tmp_path: Path) -> None:
    history = History(seed, SCRIPTS[family], tmp_path / "journal")
    history.live()
    history.check()


@pytest.mark.thorough
@pytest.mark.parametrize("family", SCRIPTS)
@pytest.mark.parametrize("seed", range(1, 40))
def test_events_keep_their_promises_in_more_histories(
    family: str, seed: int, tmp_path: Path
) -> None:
    history = History(seed, SCRIPTS[family], tmp_path / "journal")
    history.live()
    history.check()
