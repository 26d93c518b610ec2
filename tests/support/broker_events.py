"""Events for a broker: their types, a place that an abort may name, and how they were answered."""

from tests.support.broker_world import World
from tests.support.vehicle_script import HOME

ABORT, SOFT_ABORT, SPEED = 1, 2, 3
"""Types of AFarCloud; a soft abort lets the running command end first."""
PAUSE, RESUME, RETURN_HOME = 101, 102, 103
"""Types that this project has added."""
POINT = {"latitude": HOME[0] + 2e-4, "longitude": HOME[1], "altitude": 7.0}
"""Where an abort sends a vehicle: 22 m north of its home."""


def answers(world: World, event: int) -> list[tuple[str, str | None]]:
    """What was acknowledged of an event, and why."""
    return [(body["status"], body.get("message")) for body in world.edge.acknowledgements(event)]


def answer(world: World, event: int) -> tuple[str, str | None]:
    """What was acknowledged last of an event, and why."""
    return answers(world, event)[-1]


def answer_statuses(world: World, event: int) -> list[str]:
    """The statuses that were acknowledged of an event."""
    return [body["status"] for body in world.edge.acknowledgements(event)]
