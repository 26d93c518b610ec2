"""What the broker is to a vehicle: a companion, or the ground station that it asks for.

A vehicle may be told to come home when its last ground station falls silent. To it the broker is a
companion (type 18), so that a mission survives a broker that dies. But PX4 with NAV_DLL_ACT above
0, as its simulation has it, does not even arm before it has heard a ground station (type 6), and
where nobody else is one, the broker has to be. Whoever set the parameter wants the vehicle home
when nobody attends to it; but a broker that is restarted within a minute must find it flying. So
while a mission flies the vehicle waits longer than that (COM_DL_LOSS_T, 10 s by itself).

PX4 up to 1.16 sends its texts to nobody but ground stations. Where NAV_DLL_ACT is 0 it does nothing
when one falls silent, and the broker is one for the texts' sake.
"""

from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.borrowed_parameters import Loan
from mavlink_broker.microservices.heartbeat import OwnHeartbeat
from mavlink_broker.microservices.parameter_read import ParameterRead
from mavlink_broker.microservices.parameter_write import Setting
from mavlink_broker.vehicle.vehicle import Vehicle

AWAY_S: Final = 90.0
"""A minute that the broker may be away, and the time in which it hears and greets a vehicle."""
_COMPLAINTS: Final = ("no connection to the ground contro", "no connection to the gcs")
"""PX4's, as far as they go into the first 50 bytes of a text that comes in parts."""


class Attendance:
    """Our heartbeats for one vehicle."""

    def __init__(self, vehicle: Vehicle, *, observes: bool = False) -> None:
        """Greet a vehicle; an observer is never its ground station, for it soon goes away."""
        self._vehicle = vehicle
        self._observes = observes
        self._heartbeat = OwnHeartbeat()
        self._link_loss: ParameterRead | None = None
        self._patience: ParameterRead | None = None
        self._is_missed = False

    @property
    def is_ground_station(self) -> bool:
        """Whether the vehicle is to take the broker for its ground station."""
        return self._is_depended_on or self._is_heard_out

    @property
    def _action(self) -> float | None:
        """What the vehicle does when it is left alone, once it has told; 0 for nothing."""
        return self._link_loss.value if self._link_loss else None

    @property
    def _is_depended_on(self) -> bool:
        return self._is_missed or (self._action is not None and self._action > 0)

    @property
    def _is_heard_out(self) -> bool:
        """Whether it tells its reasons to ground stations alone, and does nothing without one."""
        return self._action == 0 and self._vehicle.family.talks_to_stations_only

    def renew(self) -> None:
        """Ask again: the vehicle was restarted."""
        self._link_loss = self._patience = None

    def receive(self, message: Message) -> None:
        """Take the parameter, or the vehicle's complaint that nobody is there."""
        for read in (self._link_loss, self._patience):
            if read is not None:
                read.receive(message)
        if message.get_type() == "STATUSTEXT":
            text = message.text.lower()
            self._is_missed |= any(complaint in text for complaint in _COMPLAINTS)

    def tick(self, now: float) -> list[Message]:
        """Say that we are there, once a second."""
        kind = (
            mavlink.MAV_TYPE_GCS if self.is_ground_station else mavlink.MAV_TYPE_ONBOARD_CONTROLLER
        )
        if self._observes:
            return self._heartbeat.tick(now)
        if not self._vehicle.is_identified:
            return self._heartbeat.tick(now, kind)
        family = self._vehicle.family
        if self._link_loss is None:
            self._link_loss = self._reading(family.link_loss_parameter)
        if self._patience is None and self._is_depended_on:
            self._patience = self._reading(family.link_patience_parameter)
        reads = [read for read in (self._link_loss, self._patience) if read is not None]
        asked = [message for read in reads for message in read.tick(now)]
        self._vehicle.lasting = self._borrowed()
        return [*asked, *self._heartbeat.tick(now, kind)]

    def _reading(self, name: str | None) -> ParameterRead | None:
        vehicle = self._vehicle
        if name is None:
            return None
        encoding = vehicle.parameter_encoding
        return ParameterRead(name, vehicle.route, vehicle.round_trip, encoding=encoding)

    def _borrowed(self) -> tuple[Loan, ...]:
        """What lets a vehicle that we attend to wait for us; nothing where it waits that long."""
        name = self._vehicle.family.link_patience_parameter
        waits_s = self._patience.value if self._patience else None
        if name is None or waits_s is None or not self._is_depended_on:
            return ()
        return ((Setting(name, AWAY_S),),) if waits_s <= AWAY_S else ()
