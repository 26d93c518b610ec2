"""The vehicles of one broker by MAVLink system id, with a session for each."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.config import Config
from mavlink_broker.effects import EdgeMessage
from mavlink_broker.live.follow_target import read_target_sources
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, Source, source_of
from mavlink_broker.microservices.heartbeat import is_vehicle, replaces_autopilot
from mavlink_broker.session import Session
from mavlink_broker.vehicle.recovery_state import RecoveryState
from mavlink_broker.vehicle.vehicle import Vehicle
from mavlink_broker.vehicle_records import VehicleRecords

AUTOPILOT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1."""

_LOG = logging.getLogger(__name__)


@dataclass(slots=True)
class FleetMember:
    """A vehicle's session; `component` is its autopilot's, None before the first heartbeat."""

    session: Session
    component: int | None = None
    unsent: list[EdgeMessage] = field(default_factory=list)  # Until the record is on the disk

    @property
    def system(self) -> int:
        """The vehicle's MAVLink system id."""
        return self.session.vehicle.route.target_system


class Fleet:
    """All vehicles that are received or have work."""

    def __init__(
        self, config: Config, records: VehicleRecords, new_session_id: Callable[[], str]
    ) -> None:
        self._config = config
        self._records = records
        self._new_session_id = new_session_id
        self._members: dict[int, FleetMember] = {}
        self._target_sources = read_target_sources(config.follow_targets, self.vehicle)

    def __iter__(self) -> Iterator[FleetMember]:
        return iter(tuple(self._members.values()))

    def find(self, system: int | None) -> FleetMember | None:
        """Return the member with a system id; None if there is none."""
        return None if system is None else self._members.get(system)

    def session(self, system: int) -> Session | None:
        """Return the session of a system id; None if there is none."""
        member = self.find(system)
        return None if member is None else member.session

    def vehicle(self, vehicle_id: int) -> Vehicle | None:
        """Return a vehicle by its vehicle id; None if there is none."""
        member = self.find(self._config.system_of(vehicle_id))
        return None if member is None else member.session.vehicle

    def sender_of(self, message: Message) -> FleetMember | None:
        """Return the sender of a message; the first heartbeat adds a member."""
        source = source_of(message)
        if message.get_type() == "HEARTBEAT" and is_vehicle(message):
            self._register(source)
        member = self.find(source.system)
        return None if member is None or member.component is None else member

    def _register(self, source: Source) -> None:
        vehicle_id = self._config.vehicle_id(source.system)
        if vehicle_id is None:
            return
        member = self.get_or_add(source.system, vehicle_id)
        if replaces_autopilot(source.component, member.component):
            _LOG.info("vehicle %d: connected, component %d", vehicle_id, source.component)
            member.component = source.component
            member.session.change_autopilot(source.component)

    def get_or_add(self, system: int, vehicle_id: int) -> FleetMember:
        """Return the member with a system id; adds it if it is new."""
        if system not in self._members:
            config = self._config
            vehicle = Vehicle(
                vehicle_id,
                Route(config.system_id, config.component_id, system, AUTOPILOT),
                recovery=RecoveryState(self._records.new_tracker()),
                target_source=self._target_sources.get(vehicle_id),
            )
            session = Session(
                vehicle,
                new_session_id=self._new_session_id,
                state_vector_every_s=config.state_vector_every_s,
                observations_every_s=config.observations_every_s,
                battery_capacity_ah=config.battery_capacity_ah,
                observes=config.observes,
            )
            self._members[system] = FleetMember(session)
        return self._members[system]

    def remove_strangers(self, now: float) -> list[int]:
        """Remove systems that have sent only heartbeats, such as a scan; returns their ids."""
        strangers = [s for s, member in self._members.items() if member.session.is_stranger(now)]
        for system in strangers:
            del self._members[system]
        return strangers
