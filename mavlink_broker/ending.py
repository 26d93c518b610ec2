"""What is flown after an event has ended a mission: land, go somewhere, come home.

An order that is refused, not answered or not obeyed is given again for as long as the vehicle is
armed; a place that it will not go to is given up for landing where it is, unless the link is away.
"""

import math
from typing import Final

from afarcloud.enumerations import EventType
from afarcloud.plan import Event
from mavlink_broker.dialect import Message
from mavlink_broker.performer import Performer, Phase
from mavlink_broker.protocol.command_sequence import Ways
from mavlink_broker.protocol.heartbeat import LinkState
from mavlink_broker.translation.families import Family
from mavlink_broker.translation.live import Lasted, LiveAction
from mavlink_broker.translation.modes import ModeRole
from mavlink_broker.translation.situation import Spot
from mavlink_broker.vehicle import Vehicle

AGAIN_AFTER_S: Final = 1.5
"""Two heartbeats of a quick vehicle: longer than its mode takes to show."""
WITHIN_S: Final = 600.0
"""To reach a place; then the vehicle lands where it is."""


def coming_home(vehicle_id: int) -> Event:
    """What ends a mission that an alarm has failed: as if somebody had aborted it softly."""
    return Event(vehicle_id=vehicle_id, event_type_id=EventType.SOFT_ABORT_MISSION)


def action_after(event: Event, vehicle: Vehicle, *, goes_there: bool = True) -> LiveAction:
    """What an abort asks for at its end; its last order alone to one that need not go anywhere."""
    point = event.abort if goes_there else None
    spot = None if point is None else Spot(point.latitude, point.longitude, point.altitude)
    begin = _last_order(event, vehicle.family)
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, approach=spot, moves=False)


def landing_here(vehicle: Vehicle) -> LiveAction:
    """What is done where nothing else can be."""
    begin = vehicle.family.landing
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, moves=False)


def _last_order(event: Event, family: Family) -> Ways:
    if event.event_type_id is not EventType.SOFT_ABORT_MISSION:
        return family.landing
    return family.returning if event.abort is None else family.holding


_BEFORE_HOLDING: Final = frozenset({ModeRole.MISSION})
_BEFORE_COMING_DOWN: Final = frozenset({ModeRole.MISSION, ModeRole.HOLD, ModeRole.GUIDED})
"""Modes in which a vehicle has not obeyed yet; others are another hand's, who is nearer."""


class Ending:
    """Sees to it that a vehicle does what an abort asks for."""

    def __init__(self, event: Event, vehicle: Vehicle) -> None:
        self._event = event
        self._vehicle = vehicle
        self._performer = Performer(action_after(event, vehicle), vehicle)
        self._again_at = math.inf
        self._given_up = False

    @property
    def is_over(self) -> bool:
        """Whether the vehicle has obeyed the last order, or stands disarmed."""
        obeyed = self._performer.phase is Phase.DONE and not self._flies_on
        return obeyed or self._vehicle.snapshot.armed is False

    @property
    def _flies_on(self) -> bool:
        """Whether its mode still flies something else; an unknown autopilot's word must do."""
        others = _BEFORE_HOLDING if self.leaves_hovering else _BEFORE_COMING_DOWN
        return self._vehicle.family.knows_modes and self._vehicle.mode_role in others

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle waits in the air for what comes next."""
        soft = self._event.event_type_id is EventType.SOFT_ABORT_MISSION
        return soft and self._event.abort is not None and not self._given_up

    def start(self, now: float) -> list[Message]:
        """Give the first order."""
        return self._performer.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        return self._performer.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue, and begin again what was refused or not obeyed."""
        messages = self._performer.tick(now)
        has_failed = self._performer.phase is Phase.FAILED
        if not has_failed and not (self._performer.phase is Phase.DONE and self._flies_on):
            self._again_at = math.inf
            return messages
        if self._again_at == math.inf:
            self._again_at = now + AGAIN_AFTER_S
            is_there = self._vehicle.link.state(now) is LinkState.CONNECTED
            self._given_up |= has_failed and is_there  # Else it may not have heard the order
        if now < self._again_at:
            return messages
        self._again_at = math.inf
        self._performer = Performer(self._action(goes_there=has_failed), self._vehicle)
        return [*messages, *self._performer.start(now)]

    def _action(self, *, goes_there: bool) -> LiveAction:
        """Begin anew, or end only: one that came to its place does not leave it again."""
        if self._given_up:
            return landing_here(self._vehicle)
        return action_after(self._event, self._vehicle, goes_there=goes_there)
