"""What is flown after an event has ended a mission: land, go somewhere, come home.

An order that is refused or not answered is given again for as long as the vehicle is armed; a
place that it will not go to is given up for landing where it is.
"""

import math
from typing import Final

from afarcloud.enumerations import EventType
from afarcloud.plan import Event
from mavlink_broker.dialect import Message
from mavlink_broker.performer import Performer, Phase
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


def action_after(event: Event, vehicle: Vehicle, *, give_up_place: bool = False) -> LiveAction:
    """What an abort asks for at its end."""
    family, point = vehicle.family, event.abort
    is_soft = event.event_type_id is EventType.SOFT_ABORT_MISSION
    if point is None or give_up_place:
        begin = family.returning if is_soft and not give_up_place else family.landing
        return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, moves=False)
    spot = Spot(point.latitude, point.longitude, point.altitude)
    begin = family.holding if is_soft else family.landing
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, approach=spot, moves=False)


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
        """Whether its mode still flies the mission; an unknown autopilot's word must do."""
        return self._vehicle.family.knows_modes and self._vehicle.mode_role is ModeRole.MISSION

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
        """Repeat what is overdue, and begin again what was refused."""
        messages = self._performer.tick(now)
        has_failed = self._performer.phase is Phase.FAILED
        if not has_failed and not (self._performer.phase is Phase.DONE and self._flies_on):
            self._again_at = math.inf
            return messages
        if self._again_at == math.inf:
            self._again_at = now + AGAIN_AFTER_S
        if now < self._again_at:
            return messages
        self._again_at = math.inf
        self._given_up |= has_failed
        action = action_after(self._event, self._vehicle, give_up_place=self._given_up)
        self._performer = Performer(action, self._vehicle)
        return [*messages, *self._performer.start(now)]
