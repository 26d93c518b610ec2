"""Ground stations on the forwarding links: who is there, who of them is believed, what they get.

On the loopback frames are unsigned both ways, so that any ground station connects without a key.
Elsewhere, where vehicles must sign, so must ground stations: with the key of system 255, the
number that they go by; and what they get is signed with it. Without that key nothing goes over.
"""

import logging
from collections.abc import Callable, Collection
from datetime import datetime
from typing import Final, Protocol

from mavlink_broker.config import Config
from mavlink_broker.forwarding.gateway import WATCHED_S, Gateway
from mavlink_broker.forwarding.verdict import Tenure
from mavlink_broker.links.url import Address, LinkKind
from mavlink_broker.mavlink.codec import Decoder
from mavlink_broker.mavlink.dialect import Message, Source
from mavlink_broker.mavlink.key_ring import KeyRing
from mavlink_broker.mavlink.signature_check import Guard
from mavlink_broker.microservices.message_rates import STREAMS

GROUND_SYSTEM: Final = 255
STATIONS_KEPT: Final = 16
"""At one listening port; more are not listened to until one has gone."""
LIVED_ON_US: Final = {stream.message_id: 1e6 / stream.rate_hz for stream in STREAMS}
"""Intervals of the messages that the broker lives on, by message id."""

_LOG = logging.getLogger(__name__)


class Link(Protocol):
    """Where frames go."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send one."""

    def greeted(self) -> Collection[Address]:
        """Who has to be spoken to first."""


class Clock(Protocol):
    """Time, as it is needed here."""

    def utc(self) -> datetime:
        """Time of day."""


class Ground:
    """All ground stations."""

    def __init__(
        self,
        config: Config,
        link: Link,
        ring: KeyRing | None,
        clock: Clock,
        tenure: Callable[[int], Tenure],
    ) -> None:
        """Use the links behind the vehicles'; `ring` holds the ground stations' key."""
        self._link = link
        self._first = len(config.vehicle_links)
        self._urls = config.traffic.forward
        self._gateway = Gateway(
            config.system_id, tenure, LIVED_ON_US, may_command=config.traffic.forward_commands
        )
        self._guard = Guard(None if ring is None else _GroundKey(ring), (), clock.utc)
        self._is_told = False
        self._stations: dict[Address, tuple[Decoder, float]] = {}

    def is_at(self, address: Address) -> bool:
        """Whether an address is on a forwarding link."""
        return address.link >= self._first

    def asked_of(self, system: int, now: float) -> Collection[int] | None:
        """Messages that ground stations have asked a vehicle for; None: nobody watches."""
        return self._gateway.asked_of(system, now)

    def show(self, message: Message, now: float) -> None:
        """Let every ground station have a vehicle's message."""
        if not self._urls:
            return
        frame = self._gateway.from_vehicle(message)
        if frame is not None:
            self._send(frame, now)

    def take(
        self, address: Address, data: bytes, vehicles: Collection[int], now: float
    ) -> list[tuple[Source, bytes]]:
        """Take what a ground station has said; gives what goes to which vehicle."""
        decoder = self._decoder(address, now)
        to_vehicles: list[tuple[Source, bytes]] = []
        if decoder is None:
            return to_vehicles
        for message in decoder.decode(data):
            if not self._is_open(address) and not self._guard.admits(message, now):
                continue
            self._stations[address] = decoder, now
            crossing = self._gateway.from_ground(message, vehicles, now)
            to_vehicles += crossing.to_vehicles
            for frame in crossing.to_ground:
                self._send(frame, now)
        return to_vehicles

    def _send(self, frame: bytes, now: float) -> None:
        for address in self._present(now):
            if self._is_open(address):
                self._link.send(address, frame)
            elif (key := self._guard.signing_for(GROUND_SYSTEM, now)) is not None:
                self._link.send(address, key.mark(frame))
            else:
                self._tell_that_there_is_no_key(address)

    def _tell_that_there_is_no_key(self, address: Address) -> None:
        if not self._is_told:
            _LOG.warning("%s gets nothing: there is no signing-%d.key", address, GROUND_SYSTEM)
        self._is_told = True

    def _present(self, now: float) -> list[Address]:
        """Those that links were made for, and those that have called at a listening port."""
        called = [a for a in self._stations if self._is_called(a) and self._is_fresh(a, now)]
        return [*filter(self.is_at, self._link.greeted()), *called]

    def _decoder(self, address: Address, now: float) -> Decoder | None:
        if address in self._stations:
            return self._stations[address][0]
        if len(self._stations) >= STATIONS_KEPT:
            self._stations = {a: s for a, s in self._stations.items() if self._is_fresh(a, now)}
        if len(self._stations) >= STATIONS_KEPT:
            return None
        return Decoder(keeps_unknown=True)

    def _is_fresh(self, address: Address, now: float) -> bool:
        return now - self._stations[address][1] <= WATCHED_S

    def _is_called(self, address: Address) -> bool:
        return self._urls[address.link - self._first].kind is LinkKind.UDP_IN

    def _is_open(self, address: Address) -> bool:
        """Whether nobody unknown can be there, or nothing at all is signed."""
        url = self._urls[address.link - self._first]
        return self._guard.is_open or url.is_loopback or url.is_trusted


class _GroundKey(KeyRing):
    """One key, whatever system id a ground station goes by."""

    def __init__(self, ring: KeyRing) -> None:
        super().__init__(ring.folder)

    def key_of(self, system: int, now: float) -> bytes | None:
        """Key of the ground stations."""
        del system
        return super().key_of(GROUND_SYSTEM, now)
