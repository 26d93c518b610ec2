"""The mission that the vehicle holds, and how far it is."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from sim.tester.vehicle.mission_steps import HOLD, Item, Step, steps


class MissionState(IntEnum):
    """MISSION_STATE."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(slots=True)
class Mission:
    """Items, and which of them is being flown."""

    items: Sequence[Item] = ()
    current: int = 0
    state: MissionState = MissionState.NO_MISSION
    steps: tuple[Step, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Find the commands in the items."""
        self.steps = steps(self.items)
        if self.items:
            self.state = MissionState.NOT_STARTED

    @property
    def is_running(self) -> bool:
        """Whether it is being flown, or would be but for a pause."""
        return self.state in {MissionState.ACTIVE, MissionState.PAUSED}

    @property
    def step(self) -> Step | None:
        """What is being flown; None when nothing is left."""
        if not self.is_running:
            return None
        return next((step for step in self.steps if self.current <= step.last), None)

    def finish_step(self) -> int:
        """Go on behind the running step; gives the number of items that are finished with it."""
        step = self.step
        if step is None:
            return 0
        count = step.last + 1 - self.current
        self.current = min(step.last + 1, len(self.items) - 1)
        if step is self.steps[-1]:
            self.state = MissionState.COMPLETE
        return count

    @property
    def holds(self) -> bool:
        """Whether it ends in the air."""
        return bool(self.items) and self.items[-1].command == HOLD
