"""Whether the stored mission can be flown, kept up to date as home, fence and parameters change."""

from collections.abc import Callable, Hashable, Sequence
from typing import Final, TypeAlias

from uav_firmware.lib.stepwise import Stepwise
from uav_firmware.msg.mission import MissionItem, MissionRejection, PlanReview

BUDGET: Final = 200
"""Work of one step, in the unit of PlanReview: some 1 ms."""

Items: TypeAlias = Sequence[MissionItem]


class MissionReview:
    """Judges anew what has been judged under other circumstances; meanwhile the old word holds."""

    def __init__(self) -> None:
        self.rejection: MissionRejection | None = None
        self._items: Items = ()
        self._circumstances: Hashable = None
        self._work: Stepwise[MissionRejection | None] | None = None

    def trust(self, items: Items, circumstances: Hashable) -> None:
        """Note that these very items have just been found good."""
        self._items, self._circumstances = items, circumstances
        self._work, self.rejection = None, None

    def update(
        self, items: Items, circumstances: Hashable, judge: Callable[[Items], PlanReview]
    ) -> str:
        """Judge a part of what is new; gives a reason not to fly that was not there before."""
        if items is not self._items or circumstances != self._circumstances:
            self.rejection = self.rejection if items is self._items else None
            self._items, self._circumstances = items, circumstances
            self._work = Stepwise(judge(items))
        if self._work is None or not self._work.advance(BUDGET):
            return ""
        before, self.rejection = self.rejection, self._work.result
        self._work = None
        if self.rejection is None or self.rejection == before:
            return ""
        return self.rejection.reason
