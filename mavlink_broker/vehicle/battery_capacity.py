"""How large a vehicle's battery is: BATTERY_STATUS does not tell it, a parameter mostly does."""

from typing import Final

from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.parameter_read import ParameterRead
from mavlink_broker.vehicle.vehicle import Vehicle

LARGEST_AH: Final = 100.0
"""What is larger, or nothing at all, is no size."""


class BatterySize:
    """Asks once; until the vehicle tells, it has the configured size."""

    def __init__(self, vehicle: Vehicle, configured_ah: float) -> None:
        self._vehicle = vehicle
        self._configured_ah = configured_ah
        self._question: ParameterRead | None = None

    def receive(self, message: Message) -> None:
        """Take what may be the answer."""
        if self._question is not None:
            self._question.receive(message)

    def tick(self, now: float) -> list[Message]:
        """Ask, as soon as it is known what for; write the answer into the vehicle's snapshot."""
        vehicle, snapshot = self._vehicle, self._vehicle.snapshot
        if snapshot.battery_capacity_ah is None:
            snapshot.battery_capacity_ah = self._configured_ah
        name = vehicle.family.battery_capacity_parameter
        if self._question is None and name is not None:
            self._question = ParameterRead(
                name, vehicle.route, vehicle.round_trip, encoding=vehicle.parameter_encoding
            )
        if self._question is None:
            return []
        messages = self._question.tick(now)
        told_ah = (self._question.value or 0.0) / 1e3
        if 0.0 < told_ah <= LARGEST_AH:
            snapshot.battery_capacity_ah = told_ah
        return messages
