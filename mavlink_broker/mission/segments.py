"""The segments of one mission on one vehicle, and which one is flown now."""

import math
from typing import Final

from afarcloud.plan import Mission
from mavlink_broker.planning.mission import (
    SPARE_ITEMS,
    FlightPlan,
    Itinerary,
    LiveCommand,
    Segment,
    translate,
)
from mavlink_broker.planning.situation import Home
from mavlink_broker.vehicle.vehicle import Vehicle

SHORTEST_ITEMS: Final = 50
"""A vehicle that refuses a segment of so few items does not refuse their number."""


class Segments:
    """An itinerary and a place in it."""

    def __init__(self, mission: Mission, vehicle: Vehicle, flight: str) -> None:
        self._mission = mission
        self._flight = flight  # Name of the work
        self._vehicle = vehicle
        self.itinerary: Itinerary | None = None  # Until it is translated
        self._number = 0

    def translate(self) -> None:
        """Make the itinerary for the vehicle as it is known now; the place in it stays.

        Raises:
            RefusedError: for the first command that cannot be flown.
        """
        vehicle = self._vehicle
        self.itinerary = translate(
            self._mission,
            vehicle.family,
            vehicle.snapshot.home or Home(0.0, 0.0, 0.0),
            own_system=vehicle.route.own_system,
            refused=vehicle.item_limits.refused,
            most_items=vehicle.item_limits.most_items,
            flight=self._flight,
        )

    @property
    def speed_m_s(self) -> float:
        """At which it is flown."""
        return self._mission.maximum_speed

    def set_speed(self, speed_m_s: float) -> None:
        """Fly what is still to come at another speed."""
        self._mission = self._mission.model_copy(update={"maximum_speed": speed_m_s})
        if self.itinerary is not None:
            self.translate()

    def shorten(self) -> bool:
        """Halve this segment, which has too many items; false if it is too short for that."""
        before = self.plan
        if len(before.items) <= SHORTEST_ITEMS:
            return False
        self._vehicle.item_limits.most_items = math.ceil(len(before.items) / 2) + SPARE_ITEMS
        self.translate()
        self.go_to(before.first_command)
        return len(self.plan.items) < len(before.items)

    @property
    def longest(self) -> int:
        """How many items the longest segment has."""
        return max(
            (len(part.items) for part in self._segments if isinstance(part, FlightPlan)), default=0
        )

    def do_without(self, item: int) -> bool:
        """Translate again without the command of an item; whether that changes anything."""
        before = self.plan
        self._vehicle.item_limits.refused |= {before.items[item].command}
        self.translate()
        return self.plan.items != before.items

    @property
    def notes(self) -> tuple[tuple[str, ...], ...]:
        """Per command: what was left out or is done differently."""
        return () if self.itinerary is None else self.itinerary.notes

    @property
    def ends_on_ground(self) -> bool:
        """Whether the vehicle is on the ground when all segments are over."""
        return self.itinerary is None or self.itinerary.ends_on_ground

    @property
    def current(self) -> Segment:
        """The segment that is flown; before the translation an empty one."""
        return FlightPlan.empty() if self.itinerary is None else self._segments[self._number]

    @property
    def plan(self) -> FlightPlan:
        """The mission items that are flown; none in a live command."""
        current = self.current
        return current if isinstance(current, FlightPlan) else FlightPlan.empty()

    @property
    def live(self) -> LiveCommand:
        """The live command that is flown.

        Raises:
            TypeError: if items are being flown.
        """
        current = self.current
        if not isinstance(current, LiveCommand):
            raise TypeError("no live command is being flown")
        return current

    @property
    def has_moved(self) -> bool:
        """Whether this segment or one before it moves the vehicle."""
        return self._moves(self._number + 1)

    @property
    def is_on_ground(self) -> bool:
        """Whether the vehicle is on the ground when this segment is over, if any has moved it."""
        return Itinerary(self._segments[: self._number + 1]).ends_on_ground

    @property
    def is_from_ground(self) -> bool:
        """Whether the vehicle is on the ground before this segment."""
        before = Itinerary(self._segments[: self._number])
        return not self._moves(self._number) or before.ends_on_ground

    def _moves(self, count: int) -> bool:
        """Whether one of the first so many segments moves the vehicle."""
        return any(
            isinstance(segment, FlightPlan) or segment.action.moves
            for segment in self._segments[:count]
        )

    @property
    def is_first(self) -> bool:
        """Whether no segment lies before."""
        return self._number == 0

    @property
    def is_last(self) -> bool:
        """Whether no segment follows."""
        return self._number + 1 >= len(self._segments)

    def advance(self) -> bool:
        """Go to the next segment; false if there is none."""
        if self.is_last:
            return False
        self._number += 1
        return True

    def go_to(self, command: int) -> None:
        """Go to the segment of a command."""
        if self.itinerary is not None:
            self._number = self.itinerary.segment_of(command)

    @property
    def _segments(self) -> tuple[Segment, ...]:
        return () if self.itinerary is None else self.itinerary.segments
