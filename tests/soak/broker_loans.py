"""The broker dies every so often in a flight that borrows all that can be borrowed of a vehicle.

A fence, rally points, the parameters that guard the fence and those of a command: afterwards the
vehicle has what it had before, and nothing is left in the journal. Over a good link and over one
that loses a fifth in each direction; the disk is a slow one.
"""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any, Final

from afarcloud.enumerations import Status
from tests.support.overridden_settings import WITH_FOLLOW, WITH_RATE, Farm
from tests.support.vehicle_script import ARDUPILOT, PX4, Script

LOSSES: Final = (0.0, 0.2)
LONGEST_S: Final = 120.0
AWAY_S: Final = (0.0, 1.0, 10.0, 40.0)
DEATHS: Final = (1, 1, 2, 3)
BACK_WITHIN_S: Final = 120.0
VEHICLES: Final[Mapping[str, tuple[Script, Mapping[str, Any]]]] = {
    "PX4": (PX4, WITH_FOLLOW),
    "ArduPilot": (ARDUPILOT, WITH_RATE),
}


def run(every_s: float, seed: int, print_line: Callable[[str], None]) -> None:
    """Let the broker die every so many seconds, up to three times in a flight."""
    random, failed, number = Random(seed), 0, 0
    for name in VEHICLES:
        for loss in LOSSES:
            at_s = 0.0
            while at_s < LONGEST_S:
                at_s += every_s * random.random() * 2.0
                fault = _fly(name, loss, at_s, random)
                number, failed = number + 1, failed + (fault is not None)
                if fault is not None:
                    print_line(f"{name}, {loss:.0%} lost, killed at {at_s:.2f} s: {fault}")
    print_line(f"{number} flights with overridden settings, {failed} of them not as before")
    assert not failed


def _fly(name: str, loss: float, at_s: float, random: Random) -> str | None:
    """Fly once; what was not as before, or None."""
    script, values = VEHICLES[name]
    with tempfile.TemporaryDirectory() as folder:
        farm = Farm(Path(folder), script, values, loss=loss, seed=random.randrange(1000))
        world = farm.world
        world.run(at_s)
        for _ in range(random.choice(DEATHS)):
            world.kill_broker()
            world.run(random.choice(AWAY_S))
            world.restart_broker()
            world.run(random.uniform(0.0, 8.0))
        try:
            world.run_until_over(1201, 600.0)
            world.run_until(farm.is_as_before, BACK_WITHIN_S)
        except AssertionError as error:
            return f"{error}; {farm.before} became {farm.held}"
        status = world.edge.status(1201)
        return None if status == Status.FINISHED else str(world.edge.reports(1201)[-1])
