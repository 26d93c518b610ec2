"""What must hold of a vehicle that a pilot has taken over: nobody commands it."""

from collections.abc import Iterator
from typing import Final

from dst.actors.operator_person import Operator
from dst.vehicles.flight import OrderUnderPilot
from dst.world.network import PERFECT
from dst.world.world import World

TAKEOVER_S: Final = 15.0
"""The broker has noticed a pilot within this time on a link that is up."""
ACCEPTED_S: Final = 10.0
"""An abort that was posted is accepted within this time, or not any more."""
UNHEARD_S: Final = 30.0
"""A vehicle that is not received is ordered all the same for this time."""
SHOWN_S: Final = 2.0
"""A vehicle that is received shows its pilot within this time."""


class PilotLaws:
    """Watches the orders that the vehicles of a world receive under a pilot."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator

    def broken(self) -> Iterator[str]:
        """Give each order, since the last call, that a vehicle should not have received."""
        for system, vehicle in self._world.vehicles.items():
            for order in vehicle.truth.orders_under_pilot:
                if self._is_too_late(system, order) or self._is_by_what_was_old(system, order):
                    yield (
                        f"vehicle {system}: {order.name} at {order.time_s:.1f} s, under a pilot "
                        f"since {order.pilot_since_s:.1f} s"
                    )
            vehicle.truth.orders_under_pilot.clear()

    def _is_too_late(self, system: int, order: OrderUnderPilot) -> bool:
        """Whether the broker has been able to notice the pilot."""
        known_s = max(order.pilot_since_s, self._world.connected_s[system])
        path = self._world.up[system]
        if not path.is_up and path.changed_s < order.pilot_since_s:  # It cannot notice the pilot
            aborts = (one for one in self._operator.aborts if one.vehicle_id == system)
            accepted_s = max((one.posted_s + ACCEPTED_S for one in aborts), default=0.0)
            known_s = max(known_s, accepted_s + UNHEARD_S)
        return order.time_s - known_s > TAKEOVER_S

    def _is_by_what_was_old(self, system: int, order: OrderUnderPilot) -> bool:
        """Whether a broker that was suspended has ordered before it received the vehicle again.

        It is not asked of links that lose or delay: there it goes on after a while unheard.
        """
        world, resumed_s = self._world, self._world.broker.resumed_s
        paths = world.up[system], world.down[system]
        others_s = (world.broker.started_s, world.vehicles[system].booted_at_s)
        changed_s = max(*others_s, *(path.changed_s for path in paths))
        is_perfect = all(path.is_up and path.conditions == PERFECT for path in paths)
        is_after = order.pilot_since_s + SHOWN_S < resumed_s < order.time_s
        return is_perfect and is_after and changed_s < order.pilot_since_s
