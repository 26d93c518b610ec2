"""After a plan its vehicle gets back the fence and the parameters that were its own."""

import logging
import math
from typing import Final

from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.command import Refused
from mavlink_broker.mission.geofence_transfer import Fencing, Wanted
from mavlink_broker.vehicle.vehicle import Vehicle

AGAIN_AFTER_S: Final = 30.0

_LOG = logging.getLogger(__name__)


class GivingBack:
    """Gives a vehicle back what was its own, once it stands there and has nothing to do.

    A vehicle that is switched off after its landing gets it when it is heard again.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._fencing: Fencing | None = None
        self._not_before = -math.inf
        self._is_heard = False
        self._has_failed = False

    @property
    def is_owed(self) -> bool:
        """Whether the vehicle waits for something of its own, and can be given it now."""
        return self._waits and not self._has_failed

    @property
    def _waits(self) -> bool:
        vehicle = self._vehicle
        return self._is_heard and vehicle.loan.is_open and vehicle.snapshot.is_on_ground

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        return [] if self._fencing is None else self._fencing.receive(message, now)

    def step(self, now: float, *, idle: bool) -> list[Message]:
        """Let time pass; a mission that begins takes everything over."""
        self._is_heard = self._vehicle.is_heard(now)
        self._has_failed &= idle and self._is_heard
        if not idle or not self._waits or now < self._not_before:
            self._fencing = None
            return []
        if self._fencing is None:
            self._fencing = Fencing(Wanted(), self._vehicle)
            return self._fencing.start(now)
        messages = self._fencing.tick(now)
        if isinstance(self._fencing.outcome, Refused):
            _LOG.warning(
                "vehicle %d keeps what its last plan has set: %s",
                self._vehicle.vehicle_id,
                self._fencing.outcome.reason,
            )
            self._has_failed = True
            self._not_before = now + AGAIN_AFTER_S
        return messages
