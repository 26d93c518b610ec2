"""The broker's heartbeat to a vehicle: as a companion, or as the ground station that it needs.

A vehicle may return home when its last ground station falls silent. The broker is a companion (type
18) to it, so that a mission survives a broker that ends. PX4 with NAV_DLL_ACT above 0, as in its
simulation, does not arm before it has received a ground station (type 6), and without another one
the broker is its ground station. Whoever set the parameter wants an unattended vehicle to return,
but a broker that is restarted within a minute must find it in flight. So the vehicle waits longer
than that while a mission flies (COM_DL_LOSS_T, 10 s by default).

PX4 up to 1.16 sends its status texts to ground stations only. Where NAV_DLL_ACT is 0 it does
nothing when one falls silent, and the broker is one for the status texts.
"""

from typing import Final

from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.config_overrides import ParameterOverride
from mavlink_broker.microservices.link_state import OwnHeartbeat
from mavlink_broker.microservices.parameter import ParameterRead, Setting
from mavlink_broker.vehicle.vehicle import Vehicle

AWAY_S: Final = 90.0
"""A minute in which the broker may be restarted, and the time to connect again."""


class GcsHeartbeat:
    """The broker's heartbeats to one vehicle."""

    def __init__(self, vehicle: Vehicle, *, observes: bool = False) -> None:
        """Begin; a broker that only observes is never a ground station, because it soon leaves."""
        self._vehicle = vehicle
        self._observes = observes
        self._heartbeat = OwnHeartbeat()
        self._link_loss: ParameterRead | None = None
        self._loss_timeout: ParameterRead | None = None
        self._is_requested = False

    @property
    def is_ground_station(self) -> bool:
        """Whether the broker is a ground station to the vehicle."""
        return self._is_required or self._needs_status_texts

    @property
    def _action(self) -> float | None:
        """What the vehicle does without a ground station, once received; 0: nothing."""
        return self._link_loss.value if self._link_loss else None

    @property
    def _is_required(self) -> bool:
        return self._is_requested or (self._action is not None and self._action > 0)

    @property
    def _needs_status_texts(self) -> bool:
        """Whether it sends status texts to ground stations only, and does nothing without one."""
        return self._action == 0 and self._vehicle.family.status_texts_to_gcs_only

    def renew(self) -> None:
        """Read the parameters again: the vehicle was restarted."""
        self._link_loss = self._loss_timeout = None

    def receive(self, message: Message) -> None:
        """Handle a parameter of the vehicle."""
        for read in (self._link_loss, self._loss_timeout):
            if read is not None:
                read.receive(message)

    def receive_text(self, text: str) -> None:
        """Handle a STATUSTEXT of the vehicle, which may say that it has no ground station."""
        self._is_requested |= means(text, TextMeaning.NO_GROUND_STATION)

    def tick(self, now: float) -> list[Message]:
        """Send a heartbeat once a second."""
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
        if self._loss_timeout is None and self._is_required:
            self._loss_timeout = self._reading(family.link_timeout_parameter)
        reads = [read for read in (self._link_loss, self._loss_timeout) if read is not None]
        asked = [message for read in reads for message in read.tick(now)]
        self._vehicle.override_during_missions(self._overrides())
        return [*asked, *self._heartbeat.tick(now, kind)]

    def _reading(self, name: str | None) -> ParameterRead | None:
        vehicle = self._vehicle
        if name is None:
            return None
        encoding = vehicle.parameter_encoding
        return ParameterRead(name, vehicle.route, vehicle.round_trip, encoding=encoding)

    def _overrides(self) -> tuple[ParameterOverride, ...]:
        """What makes the vehicle wait for the broker; nothing where it waits that long anyway."""
        name = self._vehicle.family.link_timeout_parameter
        waits_s = self._loss_timeout.value if self._loss_timeout else None
        if name is None or waits_s is None or not self._is_required:
            return ()
        return ((Setting(name, AWAY_S),),) if waits_s <= AWAY_S else ()
