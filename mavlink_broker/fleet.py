"""The vehicles of one broker by MAVLink system id: a session for each that is heard or has work."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.config import Config
from mavlink_broker.effects import ForEdge
from mavlink_broker.live.follow_target_source import read_leads
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, Source, source_of
from mavlink_broker.microservices.heartbeat import is_elected, is_vehicle
from mavlink_broker.session import Session
from mavlink_broker.vehicle.vehicle import Vehicle
from mavlink_broker.vehicle_records import Bookkeeping

AUTOPILOT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1."""

_LOG = logging.getLogger(__name__)


@dataclass(slots=True)
class Peer:
    """A session and the component that it is held with; none before it was heard."""

    session: Session
    component: int | None = None
    untold: list[ForEdge] = field(default_factory=list)  # Until what they follow from is noted

    @property
    def system(self) -> int:
        """The vehicle's MAVLink system id."""
        return self.session.vehicle.route.target_system


class Fleet:
    """Who is there."""

    def __init__(
        self, config: Config, books: Bookkeeping, new_session_id: Callable[[], str]
    ) -> None:
        self._config = config
        self._books = books
        self._new_session_id = new_session_id
        self._peers: dict[int, Peer] = {}
        self._leads = read_leads(config.follow_targets, self.vehicle)

    def __iter__(self) -> Iterator[Peer]:
        return iter(tuple(self._peers.values()))

    def find(self, system: int | None) -> Peer | None:
        """Give the peer of a system, if it has one."""
        return None if system is None else self._peers.get(system)

    def session(self, system: int) -> Session | None:
        """Give the session of a system, if it has one."""
        peer = self.find(system)
        return None if peer is None else peer.session

    def vehicle(self, vehicle_id: int) -> Vehicle | None:
        """Give a vehicle that has been heard, by its own number."""
        peer = self.find(self._config.system_of(vehicle_id))
        return None if peer is None else peer.session.vehicle

    def speaker(self, message: Message) -> Peer | None:
        """Give whose message it is; a heartbeat may introduce a new one."""
        source = source_of(message)
        if message.get_type() == "HEARTBEAT" and is_vehicle(message):
            self._introduce(source)
        peer = self.find(source.system)
        return None if peer is None or peer.component is None else peer

    def _introduce(self, source: Source) -> None:
        vehicle_id = self._config.vehicle_id(source.system)
        if vehicle_id is None:
            return
        peer = self.enlist(source.system, vehicle_id)
        if is_elected(source.component, peer.component):
            _LOG.info("vehicle %d is heard, component %d", vehicle_id, source.component)
            if peer.component is not None:
                peer.session.change_autopilot()
            peer.component = source.component
            route = peer.session.vehicle.route
            peer.session.vehicle.route = route._replace(target_component=source.component)

    def enlist(self, system: int, vehicle_id: int) -> Peer:
        """Give the peer of a system, a new one if need be."""
        if system not in self._peers:
            config = self._config
            vehicle = Vehicle(
                vehicle_id,
                Route(config.system_id, config.component_id, system, AUTOPILOT),
            )
            session = Session(
                vehicle,
                new_session_id=self._new_session_id,
                state_vector_every_s=config.state_vector_every_s,
                observations_every_s=config.observations_every_s,
                battery_capacity_ah=config.battery_capacity_ah,
                observes=config.observes,
            )
            vehicle.lead = self._leads.get(vehicle_id)
            vehicle.diary = self._books.new_diary()
            self._peers[system] = Peer(session)
        return self._peers[system]

    def forget_strangers(self, now: float) -> list[int]:
        """Drop what has sent a heartbeat and nothing else, such as somebody's scan; gives whom."""
        strangers = [s for s, peer in self._peers.items() if peer.session.is_stranger(now)]
        for system in strangers:
            del self._peers[system]
        return strangers
