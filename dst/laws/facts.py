"""What the laws judge by: what the edge server shows, and what the vehicles have flown by truth.

LawError  a law is broken
"""

import math
from collections.abc import Iterator, Mapping
from http import HTTPStatus
from typing import Any

from dst.actors.operator_person import Operator, PostedPlan
from dst.vehicles.flight import Reached, Truth, is_same_place
from dst.world.edge_process import EdgeDownError
from dst.world.world import World


class LawError(Exception):
    """A law is broken."""


class Facts:
    """The facts of one world."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self.edge_trouble_s = 0.0
        """When the edge server was last seen out of the broker's reach."""
        self._read_before: dict[str, tuple[object, Any]] = {}  # By path: its state then, the answer

    def note_edge_trouble(self) -> None:
        """Note whether the edge server is within the broker's reach."""
        if not (self._world.edge.is_up and self._world.http.is_perfect):
            self.edge_trouble_s = self._world.scheduler.now_s

    def forget(self) -> None:
        """Read everything again from now on."""
        self._read_before.clear()

    def missions(self) -> Iterator[tuple[PostedPlan, dict[str, Any]]]:
        """Give each plan that was not cancelled with its mission as the edge server shows it."""
        states = self._world.edge.states()
        for plan in self._operator.plans:
            if plan.cancelled_s is not None:
                continue
            known = self.read(f"/plans/{plan.number}", f"plan {plan.number}", states)
            if known is None:
                return
            yield plan, known["missions"][0]

    def read(self, path: str, what: str, states: Mapping[str, object]) -> Any:
        """Read what the edge server has acknowledged; None while it or its disk cannot be used.

        What was read before is taken as long as its state is the same.

        Raises:
            LawError: if it is not there.
        """
        state = states.get(path)
        if state is not None and self._read_before.get(path, (None, None))[0] == state:
            return self._read_before[path][1]
        try:
            response = self._world.request("GET", path)
        except EdgeDownError:
            return None
        if response.status == HTTPStatus.NOT_FOUND:
            raise LawError(f"{what} was acknowledged and is lost")
        if response.status != HTTPStatus.OK:
            return None
        self._read_before[path] = state, response.json()
        return self._read_before[path][1]

    def flown(self, plan: PostedPlan) -> list[Reached]:
        """Give what was flown of a plan, by whichever aircraft with its system id."""
        truths = self._world.truths(plan.vehicle_id)
        return [one for truth in truths for one in self.flown_by(truth, plan)]

    @staticmethod
    def flown_by(truth: Truth, plan: PostedPlan) -> list[Reached]:
        """Give what one aircraft has flown of a plan."""
        places = plan.commands.waypoints.values()
        return [one for one in truth.reached if any(is_at(one, place) for place in places)]

    def connected_since_s(self, system: int) -> float:
        """Give since when the broker can reach a vehicle; infinite while it cannot."""
        world = self._world
        is_linked = world.up[system].is_up and world.down[system].is_up
        is_connected = world.broker.is_running and is_linked
        return world.connected_s[system] if is_connected else math.inf


def is_at(reached: Reached, place: tuple[int, int]) -> bool:
    """Whether a waypoint that was reached is a place, in 1e-7 degrees."""
    return is_same_place((reached.latitude_e7, reached.longitude_e7), place)
