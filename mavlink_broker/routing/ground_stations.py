"""Ground stations on the forwarding links: which are connected, accepted and sent to.

On the loopback frames are unsigned in both directions, so that any ground station connects without
a key. On other links, if vehicles must sign, ground stations must too: with the key of system 255,
the id that they use. Frames to them are signed with it. Without that key nothing is forwarded.
"""

import logging
from collections.abc import Callable, Collection
from datetime import datetime
from typing import Final, Protocol

from mavlink_broker.config import Config
from mavlink_broker.links.url import Address, LinkKind
from mavlink_broker.mavlink.codec import Decoder
from mavlink_broker.mavlink.dialect import Message, Source
from mavlink_broker.mavlink.signing import KeyRing, SignatureCheck
from mavlink_broker.microservices.message_rates import STREAMS
from mavlink_broker.routing.gateway import GCS_TIMEOUT_S, Gateway
from mavlink_broker.routing.policy import BrokerControl

GCS_SYSTEM_ID: Final = 255
STATIONS_KEPT: Final = 16
"""Per program; further ones are ignored until one has timed out."""
REQUIRED_INTERVALS_US: Final = {stream.message_id: 1e6 / stream.rate_hz for stream in STREAMS}
"""Intervals [us] of the messages that the broker requires, by message id."""

_LOG = logging.getLogger(__name__)


class Link(Protocol):
    """Sends frames."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send one frame."""

    def contact_addresses(self) -> Collection[Address]:
        """Addresses to which this side must send before it can receive."""


class Clock(Protocol):
    """The time of day."""

    def utc(self) -> datetime:
        """Time of day."""


class GroundStations:
    """All ground stations."""

    def __init__(
        self,
        config: Config,
        link: Link,
        ring: KeyRing | None,
        clock: Clock,
        control: Callable[[int], BrokerControl],
    ) -> None:
        """Use the links after the vehicles' ones; `ring` holds the ground stations' key."""
        self._link = link
        self._first = len(config.vehicle_links)
        self._urls = config.traffic.forward
        self._gateway = Gateway(
            config.system_id,
            control,
            REQUIRED_INTERVALS_US,
            may_command=config.traffic.forward_commands,
        )
        self._signature_check = SignatureCheck(
            None if ring is None else _GcsKeyRing(ring), (), clock.utc
        )
        self._is_logged = False
        self._stations: dict[Address, tuple[Decoder, float]] = {}

    def is_at(self, address: Address) -> bool:
        """Whether an address is on a forwarding link."""
        return address.link >= self._first

    def requested_messages(self, system: int, now: float) -> Collection[int] | None:
        """Message ids that ground stations have requested; None without a ground station."""
        return self._gateway.requested_messages(system, now)

    def forward_from_vehicle(self, message: Message, now: float) -> None:
        """Forward a vehicle's message to every ground station."""
        if not self._urls:
            return
        frame = self._gateway.from_vehicle(message)
        if frame is not None:
            self._send(frame, now)

    def receive(
        self, address: Address, data: bytes, vehicles: Collection[int], now: float
    ) -> list[tuple[Source, bytes]]:
        """Handle data of a ground station; returns the frames for vehicles."""
        decoder = self._decoder(address, now)
        to_vehicles: list[tuple[Source, bytes]] = []
        if decoder is None:
            return to_vehicles
        for message in decoder.decode(data):
            if not self._needs_no_signature(address) and not self._signature_check.accepts(
                message, now
            ):
                continue
            self._stations[address] = decoder, now
            forwarded_frames = self._gateway.from_ground_station(message, vehicles, now)
            to_vehicles += forwarded_frames.to_vehicles
            for frame in forwarded_frames.to_ground_stations:
                self._send(frame, now)
        return to_vehicles

    def _send(self, frame: bytes, now: float) -> None:
        for address in self._present(now):
            if self._needs_no_signature(address):
                self._link.send(address, frame)
            elif (key := self._signature_check.signing_for(GCS_SYSTEM_ID, now)) is not None:
                self._link.send(address, key.sign(frame))
            else:
                self._log_missing_key(address)

    def _log_missing_key(self, address: Address) -> None:
        if not self._is_logged:
            _LOG.warning(
                "nothing is forwarded to %s: signing-%d.key is missing", address, GCS_SYSTEM_ID
            )
        self._is_logged = True

    def _present(self, now: float) -> list[Address]:
        """Targets of links that send first, and senders on listening links."""
        called = [a for a in self._stations if self._is_listening(a) and self._is_fresh(a, now)]
        return [*filter(self.is_at, self._link.contact_addresses()), *called]

    def _decoder(self, address: Address, now: float) -> Decoder | None:
        if address in self._stations:
            return self._stations[address][0]
        if len(self._stations) >= STATIONS_KEPT:
            self._stations = {a: s for a, s in self._stations.items() if self._is_fresh(a, now)}
        if len(self._stations) >= STATIONS_KEPT:
            return None
        return Decoder(keeps_unknown=True)

    def _is_fresh(self, address: Address, now: float) -> bool:
        return now - self._stations[address][1] <= GCS_TIMEOUT_S

    def _is_listening(self, address: Address) -> bool:
        return self._urls[address.link - self._first].kind is LinkKind.UDP_IN

    def _needs_no_signature(self, address: Address) -> bool:
        """Whether the link is trusted or on this machine, or signing is off."""
        url = self._urls[address.link - self._first]
        return self._signature_check.accepts_unsigned or url.is_loopback or url.is_trusted


class _GcsKeyRing(KeyRing):
    """One key for every system id that a ground station uses."""

    def __init__(self, ring: KeyRing) -> None:
        super().__init__(ring.folder)

    def key_of(self, system: int, now: float) -> bytes | None:
        """Return the ground stations' key."""
        del system
        return super().key_of(GCS_SYSTEM_ID, now)
