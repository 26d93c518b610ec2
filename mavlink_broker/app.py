"""The broker's one loop: poll the link, take work, step the sessions, pass on what they say.

Everything that touches a clock, a socket or the edge server is handed in, so that tests can run
a day of it in a second.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, Protocol

from mavlink_broker.codec import Decoder, Encoder
from mavlink_broker.config import Config
from mavlink_broker.dialect import Message, Source, source_of
from mavlink_broker.effects import Acknowledgement, Effects, ForEdge
from mavlink_broker.guard import Guard
from mavlink_broker.inbox import Inbox, WorkError
from mavlink_broker.key_ring import KeyRing
from mavlink_broker.link import Address
from mavlink_broker.posts import post_for
from mavlink_broker.protocol.heartbeat import is_vehicle
from mavlink_broker.protocol.route import Route
from mavlink_broker.send_queue import Post
from mavlink_broker.session import Session
from mavlink_broker.translation.observables import OBSERVED
from mavlink_broker.vehicle import Vehicle
from mavlink_broker.work import EventWork, MissionWork, StateVectorWork

IDLE_WAIT_S: Final = 0.02
"""Longest sleep: what is overdue is noticed that late. Datagrams and work end it at once."""
AUTOPILOT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1."""
PEERS_KEPT: Final = 1024
PAYLOAD_WORDS: Final = frozenset({"COMMAND_ACK", "HEARTBEAT"}) | OBSERVED
"""What is taken from a vehicle's other components, such as its camera."""

_LOG = logging.getLogger(__name__)


class Link(Protocol):
    """Datagrams from and to addresses."""

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """Wait for datagrams at most so long."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send one."""


class Edge(Protocol):
    """The edge server: work comes from it, posts go to it."""

    def take_work(self) -> list[dict[str, Any]]:
        """Give new work as the edge server wrote it."""

    def post(self, post: Post) -> None:
        """Leave a post to be sent, in order, until it is answered."""


class Clock(Protocol):
    """Time, as the program needs it."""

    def monotonic(self) -> float:
        """Seconds that never go back."""

    def utc(self) -> datetime:
        """Time of day."""


@dataclass(slots=True)
class _Peer:
    """A session and the way to its vehicle; no address before it was heard."""

    session: Session
    encoder: Encoder
    component: int = AUTOPILOT
    address: Address | None = None


class App:
    """All vehicles of one broker."""

    def __init__(
        self,
        config: Config,
        link: Link,
        edge: Edge,
        clock: Clock,
        new_ulid: Callable[[], str],
    ) -> None:
        self._config = config
        self._link = link
        self._edge = edge
        self._clock = clock
        self._new_ulid = new_ulid
        self._inbox = Inbox()
        self._guard = _guard(config, clock)
        self._peers: dict[int, _Peer] = {}
        self._decoders: dict[Address, Decoder] = {}

    @property
    def sessions(self) -> dict[int, Session]:
        """Sessions by MAVLink system id."""
        return {system: peer.session for system, peer in self._peers.items()}

    def step(self, wait_s: float = IDLE_WAIT_S) -> None:
        """Go round once."""
        datagrams = self._link.receive(wait_s)
        now = self._clock.monotonic()
        for address, datagram in datagrams:
            for message in self._decoder(address).decode(datagram):
                if self._guard.admits(message, now):
                    self._dispatch(message, address, now)
        for raw in self._edge.take_work():
            self._take(raw, now)
        for peer in self._peers.values():
            effects = Effects()
            peer.session.step(now, effects)
            self._carry_out(effects, peer)

    def _decoder(self, address: Address) -> Decoder:
        if address not in self._decoders:
            if len(self._decoders) >= PEERS_KEPT:
                self._decoders.clear()
            self._decoders[address] = Decoder()
        return self._decoders[address]

    def _dispatch(self, message: Message, address: Address, now: float) -> None:
        """Hand a message to the session of its vehicle; a heartbeat may introduce a new one."""
        source = source_of(message)
        if message.get_type() == "HEARTBEAT" and is_vehicle(message):
            self._introduce(source, address)
        peer = self._peers.get(source.system)
        if peer is None or peer.address is None:
            return
        effects = Effects()
        if source.component == peer.component:
            peer.session.receive(message, now, effects)
        elif message.get_type() in PAYLOAD_WORDS:
            peer.session.receive_payload(message, now, effects)
        self._carry_out(effects, peer)

    def _introduce(self, source: Source, address: Address) -> None:
        vehicle_id = self._config.vehicle_id(source.system)
        if vehicle_id is None or source.system in {0, self._config.system_id}:
            return
        peer = self._peer(source.system, vehicle_id)
        if peer.address is None:
            _LOG.info("vehicle %d is heard from %s:%d", source.system, *address)
            peer.component = source.component
            route = peer.session.vehicle.route
            peer.session.vehicle.route = route._replace(target_component=source.component)
        if source.component == peer.component:
            peer.address = address

    def _peer(self, system: int, vehicle_id: int) -> _Peer:
        """Give the peer of a system, a new one if need be."""
        if system not in self._peers:
            config = self._config
            vehicle = Vehicle(
                vehicle_id,
                Route(config.system_id, config.component_id, system, AUTOPILOT),
            )
            session = Session(
                vehicle,
                new_session_id=self._new_ulid,
                state_vector_every_s=config.state_vector_every_s,
                battery_capacity_ah=config.battery_capacity_ah,
            )
            encoder = Encoder(config.system_id, config.component_id)
            self._peers[system] = _Peer(session, encoder)
        return self._peers[system]

    def _take(self, raw: dict[str, Any], now: float) -> None:
        try:
            work = self._inbox.read(raw, now, self._clock.utc())
        except WorkError as error:
            _LOG.warning("work refused: %s", error)
            if error.work_id is not None:
                self._tell(Acknowledgement(error.work_id, "refused", str(error)), 0)
            return
        match work:
            case MissionWork():
                self._take_mission(work)
            case EventWork():
                self._take_event(work, now)
            case StateVectorWork():
                self._answer_state_vector(work, now)

    def _take_mission(self, work: MissionWork) -> None:
        system = self._config.system_of(work.vehicle_id)
        if system is None:
            reason = f"no system is vehicle {work.vehicle_id}"
            self._tell(Acknowledgement(work.work_id, "refused", reason), work.vehicle_id)
            return
        peer = self._peer(system, work.vehicle_id)
        effects = Effects()
        peer.session.take_mission(work, effects)
        self._carry_out(effects, peer)

    def _take_event(self, work: EventWork, now: float) -> None:
        """Interrupt a vehicle; what has expired, or is for nobody, is refused."""
        system = self._config.system_of(work.vehicle_id)
        peer = None if system is None else self._peers.get(system)
        expired = work.expires_at is not None and now >= work.expires_at
        if peer is None or expired:
            reason = "expired" if expired else f"vehicle {work.vehicle_id} is not known"
            self._tell(Acknowledgement(work.work_id, "refused", reason), work.vehicle_id)
            return
        effects = Effects()
        peer.session.take_event(work, now, effects)
        self._carry_out(effects, peer)

    def _answer_state_vector(self, work: StateVectorWork, now: float) -> None:
        """Have one vehicle or all report; done if any of them could."""
        expired = work.expires_at is not None and now >= work.expires_at
        reason = "expired" if expired else "no such vehicle is heard"
        answered = False
        for peer in self._peers.values():
            if not expired and work.vehicle_id in {None, peer.session.vehicle.vehicle_id}:
                effects = Effects()
                answered |= peer.session.answer_state_vector(work, now, effects)
                self._carry_out(effects, peer)
        status, message = ("done", None) if answered else ("refused", reason)
        self._tell(Acknowledgement(work.work_id, status, message), work.vehicle_id or 0)

    def _carry_out(self, effects: Effects, peer: _Peer) -> None:
        if peer.address is not None:
            for message in effects.messages:
                self._link.send(peer.address, self._encoded(message, peer))
        for word in effects.for_edge:
            self._tell(word, peer.session.vehicle.vehicle_id)

    def _encoded(self, message: Message, peer: _Peer) -> bytes:
        system = peer.session.vehicle.route.target_system
        signing = self._guard.signing_for(system, self._clock.monotonic())
        return peer.encoder.encode(message, None if signing is None else signing.for_sending())

    def _tell(self, word: ForEdge, vehicle_id: int) -> None:
        post = post_for(
            word,
            vehicle_id=vehicle_id,
            recorded_at=self._clock.utc(),
            key=self._new_ulid(),
        )
        self._edge.post(post)


def _guard(config: Config, clock: Clock) -> Guard:
    """Ask for signatures if there is a folder of keys."""
    ring = None if config.signing_keys is None else KeyRing(config.signing_keys)
    if ring is None:
        _LOG.warning("MAVLink is unsigned: whoever reaches the port can speak for a vehicle")
    return Guard(ring, config.unsigned_systems, clock.utc)
