"""What a plan has changed on a vehicle, and what was there before: given back after the plan."""

from dataclasses import dataclass, field
from typing import NamedTuple

from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.borrowed_parameters import Borrowed

Items = tuple[MissionItem, ...]


class ExchangedPlan(NamedTuple):
    """A fence or rally points, before and since."""

    before: Items
    placed: Items | None  # None: a transfer has failed, and what is there is not known


@dataclass(slots=True)
class Loan:
    """All of it, for one vehicle; kinds of plan are MAV_MISSION_TYPEs."""

    plans: dict[int, ExchangedPlan] = field(default_factory=dict)
    values: dict[str, Borrowed] = field(default_factory=dict)

    @property
    def is_open(self) -> bool:
        """Whether anything is still to be given back."""
        return bool(self.plans or self.values)

    def assume(self, kind: int, items: Items) -> None:
        """Take it that an earlier run of the broker has placed these where there were none."""
        if items and kind not in self.plans:
            self.plans[kind] = ExchangedPlan((), items)
