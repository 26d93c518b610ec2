"""What must hold of events: each one ends, and a vehicle has been where it was sent."""

import math
from collections.abc import Iterator, Mapping
from functools import partial
from http import HTTPStatus
from typing import Any, Final

from dst.actors.operator_person import Operator, PostedAbort
from dst.world.edge_process import EdgeDownError
from dst.world.world import World

THERE_M: Final = 4.0
"""Horizontally; a position has an error."""
LOOK_S: Final = 0.5


class EventLaws:
    """Watches the events of a world."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self._visited: set[int] = set()
        self._may_stay_away: set[int] = set()
        operator.on_sent_away = self._watch

    def _watch(self, abort: PostedAbort) -> None:
        """Follow a vehicle that an event sends to a place, until it is there or has landed."""
        vehicle = self._world.vehicles[abort.vehicle_id]
        truth, place_m = vehicle.truth, abort.place_m
        is_new = self._world.scheduler.now_s <= abort.posted_s
        if place_m is None or (not vehicle.is_flying and (is_new or abort.waits)):
            self._may_stay_away.add(abort.number)  # It stands, or has landed by itself
        elif not vehicle.is_flying:
            return
        elif math.dist((truth.north_m, truth.east_m), place_m) <= THERE_M:
            self._visited.add(abort.number)
        else:
            self._world.scheduler.after(LOOK_S, partial(self._watch, abort))

    def open(self) -> list[str]:
        """Give the events that have not ended, and those that ended otherwise than they say."""
        return [*self._waiting(), *self._never_there()]

    def _waiting(self) -> Iterator[str]:
        for number in self._operator.speeds:
            event = self._read(number)
            if event is not None and event["state"] in {"queued", "accepted"}:
                yield f"event {number} is {event['state']}"

    def _never_there(self) -> Iterator[str]:
        """Give the places at which a vehicle never was, though the event is done as ordered."""
        for abort in self._operator.aborts:
            is_known = abort.number in self._visited | self._may_stay_away
            if abort.place_m is None or is_known or abort.vehicle_id in self._world.twinned:
                continue
            event = self._read(abort.number)
            if event is not None and event["state"] == "done" and not event.get("message"):
                yield f"abort {abort.number} is done, and its vehicle was never at its place"

    def _read(self, number: int) -> Mapping[str, Any] | None:
        try:
            response = self._world.request("GET", f"/events/{number}")
        except EdgeDownError:
            return None
        found: Mapping[str, Any] | None
        found = response.json() if response.status == HTTPStatus.OK else None
        return found
