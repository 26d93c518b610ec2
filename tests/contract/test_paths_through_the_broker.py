"""How many modules and calls an abort and a STATUSTEXT pass in the broker.

Whoever follows one of them through the code reads these modules: the numbers may not grow unseen.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import mavlink_broker
from mavlink_broker.mission.abort_executor import AbortExecutor
from tests.support.broker_world import World, flying_world

ROOT = Path(mavlink_broker.__file__).parent
ABORT_MISSION = 1
BETWEEN_STEPS_S = 0.001
"""Shorter than the period in which every session is stepped."""


def broker_modules(frame: FrameType | None) -> list[str]:
    """Modules of the broker on the stack, the innermost first."""
    modules = []
    while frame is not None:
        if Path(frame.f_code.co_filename).is_relative_to(ROOT):
            modules.append(frame.f_code.co_filename)
        frame = frame.f_back
    return modules


def traced(world: World) -> tuple[set[str], dict[str, int]]:
    """Run the loop once; gives its modules, and the depth at which each function was called."""
    modules: set[str] = set()
    depths: dict[str, int] = {}

    def observe(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call" and Path(frame.f_code.co_filename).is_relative_to(ROOT):
            stack = broker_modules(frame)
            modules.add(stack[0])
            depths.setdefault(frame.f_code.co_qualname, len(stack))

    world.clock.now += BETWEEN_STEPS_S
    sys.setprofile(observe)
    try:
        world.app.step(0.0)
    finally:
        sys.setprofile(None)
    return modules, depths


def after(change: Callable[[World], object]) -> tuple[set[str], dict[str, int]]:
    world = flying_world(tick_s=0.1)
    world.run(1.0)
    change(world)
    return traced(world)


def test_an_abort_reaches_its_order_through_nine_calls() -> None:
    modules, depths = after(lambda world: world.edge.event(ABORT_MISSION))
    assert depths[AbortExecutor.start.__qualname__] <= 9
    assert len(modules) <= 27, sorted(modules)


def test_a_status_text_passes_those_that_read_it() -> None:
    def complain(world: World) -> None:
        vehicle = world.only_vehicle
        vehicle.send_status_text("compass not calibrated")
        world.air.step()

    modules, _ = after(complain)
    assert any(module.endswith("status_texts.py") for module in modules)
    assert len(modules) <= 25, sorted(modules)
