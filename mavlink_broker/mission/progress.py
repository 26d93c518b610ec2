"""How far a mission is, from the vehicle's numbers; it never goes back.

Three sources say the same and each may be lost: MISSION_ITEM_REACHED says that item k was
reached, MISSION_CURRENT beyond k proves it, and a complete mission proves all. A repeated
MISSION_ITEM_REACHED of the mission before is told from ours by MISSION_CURRENT: nothing can be
reached that was not current first.
"""

from dataclasses import dataclass, replace
from typing import Self

from mavlink_broker.planning.mission import FlightPlan

NOTHING = -1


@dataclass(frozen=True, slots=True)
class Progress:
    """The farthest that is known of one stretch; its commands are counted from its own first."""

    plan: FlightPlan
    current: int = NOTHING  # Highest item that was current
    reached: int = NOTHING  # Highest item that was reached
    on_ground: bool = False  # Landed and disarmed after the last command had begun

    @classmethod
    def after(cls, plan: FlightPlan, finished_commands: int) -> Self:
        """Take up a flight of which so many commands were finished before."""
        if finished_commands == 0:
            return cls(plan)
        done = plan.done_item[finished_commands - 1]
        return cls(plan, current=done, reached=done)

    def with_current(self, seq: int) -> Self:
        """Take MISSION_CURRENT: everything before it has been reached."""
        if not self.current < seq < len(self.plan.items):
            return self
        return replace(self, current=seq, reached=max(self.reached, seq - 1))

    def with_reached(self, seq: int) -> Self:
        """Take MISSION_ITEM_REACHED."""
        if not self.reached < seq <= self.current:
            return self
        return replace(self, reached=seq)

    def with_complete(self) -> Self:
        """Take the vehicle's word that the mission is complete."""
        last = len(self.plan.items) - 1
        return replace(self, current=last, reached=last)

    def with_landing(self) -> Self:
        """Take that the vehicle is on the ground and disarmed; early, it proves nothing."""
        return replace(self, on_ground=True) if self.last_command_has_begun else self

    @property
    def last_command_has_begun(self) -> bool:
        """Whether the last command's items are being flown, or have been."""
        last = self.plan.commands[-1]
        return self.current >= self.plan.first_item_of(last)

    @property
    def finished_commands(self) -> int:
        """How many commands, counted from the first, are finished.

        A last command that lands is finished on the ground and disarmed, not before.
        """
        count = sum(done <= self.reached for done in self.plan.done_item)
        if not self.plan.ends_on_ground:
            return count
        total = len(self.plan.done_item)
        return total if self.on_ground else min(count, total - 1)

    @property
    def is_finished(self) -> bool:
        """Whether every command is."""
        return self.finished_commands == len(self.plan.done_item)
