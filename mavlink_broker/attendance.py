"""What the broker is to a vehicle: a companion, or the ground station that it asks for.

A vehicle may be told to come home when its last ground station falls silent. To it the broker is a
companion (type 18), so that a mission survives a broker that dies. But PX4 with NAV_DLL_ACT above
0, as its simulation has it, does not even arm before it has heard a ground station (type 6), and
where nobody else is one, the broker has to be. Whoever set the parameter wants the vehicle home
when nobody attends to it, and a broker that is restarted reads it again before it is missed.
"""

from typing import Final

from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.heartbeat import OwnHeartbeat
from mavlink_broker.protocol.parameter_read import ParameterRead
from mavlink_broker.vehicle import Vehicle

_COMPLAINTS: Final = ("no connection to the ground contro", "no connection to the gcs")
"""PX4's, as far as they go into the first 50 bytes of a text that comes in parts."""


class Attendance:
    """Our heartbeats for one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._heartbeat = OwnHeartbeat()
        self._link_loss: ParameterRead | None = None
        self._is_missed = False

    @property
    def is_ground_station(self) -> bool:
        """Whether the vehicle is to take the broker for its ground station."""
        action = self._link_loss.value if self._link_loss else None
        return self._is_missed or (action is not None and action > 0)

    def renew(self) -> None:
        """Ask again: the vehicle was restarted."""
        self._link_loss = None

    def receive(self, message: Message) -> None:
        """Take the parameter, or the vehicle's complaint that nobody is there."""
        if self._link_loss is not None:
            self._link_loss.receive(message)
        if message.get_type() == "STATUSTEXT":
            text = message.text.lower()
            self._is_missed |= any(complaint in text for complaint in _COMPLAINTS)

    def tick(self, now: float) -> list[Message]:
        """Say that we are there, once a second."""
        kind = (
            mavlink.MAV_TYPE_GCS if self.is_ground_station else mavlink.MAV_TYPE_ONBOARD_CONTROLLER
        )
        return [*self._read(now), *self._heartbeat.tick(now, kind)]

    def _read(self, now: float) -> list[Message]:
        vehicle = self._vehicle
        name = vehicle.family.link_loss_parameter
        if name is None or not vehicle.is_identified:
            return []
        if self._link_loss is None:
            self._link_loss = ParameterRead(
                name, vehicle.route, vehicle.round_trip, encoding=vehicle.parameter_encoding
            )
        return self._link_loss.tick(now)
