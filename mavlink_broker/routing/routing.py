"""Frames between the links and the sessions: who is believed, by which way, and who else hears it.

What comes in is judged by its signature and by the way it came; what is left is written down,
shown to ground stations and given to the sessions. What goes out is numbered per correspondent
and signed with the vehicle's key.
"""

import logging
import struct
from collections.abc import Callable, Collection, Iterable, Sequence
from datetime import datetime
from typing import Final, Protocol

from mavlink_broker.config import Config
from mavlink_broker.forwarding.gcs_links import Ground
from mavlink_broker.forwarding.verdict import Tenure
from mavlink_broker.internal_errors import Faults
from mavlink_broker.links.tlog import FrameLog
from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of
from mavlink_broker.mavlink.frames import unsigned
from mavlink_broker.mavlink.key_ring import KeyRing
from mavlink_broker.mavlink.signature_check import Guard
from mavlink_broker.microservices.heartbeat import INTERVAL_S, is_elected, is_vehicle, own_heartbeat
from mavlink_broker.routing.duplicate_system_ids import Twins
from mavlink_broker.routing.link_selection import Ways

PEERS_KEPT: Final = 1024
NAMESAKE_EVERY_S: Final = 60.0
COMPONENTS_KEPT: Final = 32
"""Per system; what else speaks in its name is not listened to."""
SILENT_COMPONENT_S: Final = 5.0
"""A camera that was heard by wifi, which is gone, may still be reached where its autopilot is."""
GREETED_AFTER_S: Final = 3.0
"""Who has been silent for so long is spoken to where a link has to speak first."""

_LOG = logging.getLogger(__name__)


class Link(Protocol):
    """Datagrams from and to addresses."""

    def receive(self, timeout_s: float) -> Sequence[tuple[Address, bytes]]:
        """Wait for datagrams at most so long."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send one."""

    def radio(self, address: Address, free_percent: int) -> None:
        """Take the word of the radio at an address about how much of its buffer is free."""

    def greeted(self) -> Sequence[Address]:
        """Who has to be spoken to first."""


class Clock(Protocol):
    """Time, as the program needs it."""

    def monotonic(self) -> float:
        """Seconds that never go back."""

    def utc(self) -> datetime:
        """Time of day."""


class Traffic:
    """Everything that all vehicles' frames have in common."""

    def __init__(
        self,
        config: Config,
        link: Link,
        clock: Clock,
        tenure: Callable[[int], Tenure],
        faults: Faults | None = None,
    ) -> None:
        """Use the links; `tenure` tells whose a system is, for its ground stations.

        Errors that a datagram has caused are counted in `faults`.
        """
        self._faults = Faults() if faults is None else faults
        self._config = config
        self._link = link
        self._clock = clock
        ring = None if config.signing_keys is None else KeyRing(config.signing_keys)
        if ring is None:
            _LOG.warning("MAVLink is unsigned: whoever reaches the port can speak for a vehicle")
        self._guard = Guard(ring, config.unsigned_systems, clock.utc)
        self._ground = Ground(config, link, ring, clock, tenure)
        self._log = _frame_log(config)
        self._ways: dict[int, dict[int, Ways]] = {}
        self._autopilots: dict[int, int] = {}
        self._decoders: dict[Address, Decoder] = {}
        self._encoders: dict[Address, Encoder] = {}
        self._twins = Twins()
        self._is_trusted = [url.is_trusted for url in config.vehicle_links]
        self._greet_at = 0.0
        self._tell_namesake_at = 0.0

    def receive(self, wait_s: float) -> list[Message]:
        """Wait at most so long; gives what vehicles have said, each message once."""
        arrivals = self._link.receive(wait_s)
        now = self._clock.monotonic()
        heard: list[Message] = []
        for address, data in arrivals:
            try:
                heard += self._take(address, data, now)
            except Exception as error:  # noqa: BLE001  # the boundary of one datagram
                self._faults.note("a datagram", error, now)
        if now >= self._greet_at:
            self._greet_at = now + INTERVAL_S
            self._greet(now)
        return heard

    def _take(self, address: Address, data: bytes, now: float) -> list[Message]:
        """Take one datagram: of a ground station, or of vehicles."""
        if not self._ground.is_at(address):
            return self._from_vehicles(address, data, now)
        for target, frame in self._ground.take(address, data, self._ways.keys(), now):
            self._pass_on(target, frame, now)
        return []

    def send(self, system: int, messages: Iterable[Message]) -> list[Exception]:
        """Send to a vehicle; before it has been heard nobody knows where it is.

        A message whose fields do not fit the wire is left out; gives the errors of those.
        """
        now = self._clock.monotonic()
        errors: list[Exception] = []
        for message in messages:
            address = self._way_to(system, getattr(message, "target_component", 0), now)
            if address is None:
                break
            signing = self._guard.signing_for(system, now)
            marks = None if signing is None else signing.for_sending()
            try:
                frame = self._encoder(address).encode(message, marks)
            except (struct.error, TypeError, ValueError, OverflowError) as error:
                errors.append(error)
            else:
                self._send(address, frame)
        return errors

    def asked_of(self, system: int, now: float) -> Collection[int] | None:
        """Messages that ground stations have asked a vehicle for; None: nobody watches."""
        return self._ground.asked_of(system, now)

    def warning_of(self, system: int, now: float) -> str | None:
        """What somebody should know about the ways to a system."""
        return self._twins.warning(system, now)

    def forget(self, system: int) -> None:
        """Begin anew with a system that has long been silent."""
        self._ways.pop(system, None)
        self._autopilots.pop(system, None)
        self._twins.forget(system)

    def close(self) -> None:
        """Write down what has not been yet."""
        if self._log is not None:
            self._log.close()

    def _from_vehicles(self, address: Address, data: bytes, now: float) -> list[Message]:
        heard: list[Message] = []
        is_trusted = self._is_trusted[address.link]
        for message in self._decoder(address).decode(data):
            if not self._guard.admits(message, now, is_trusted=is_trusted):
                continue
            if message.get_type() == "RADIO_STATUS":
                self._link.radio(address, message.txbuf)
                self._ground.show(message, now)
            elif self._counts(message, address, now):
                self._ground.show(message, now)
                if not isinstance(message, mavlink.MAVLink_unknown):
                    heard.append(message)
            self._write_down(bytes(message.get_msgbuf()))
        return heard

    def _counts(self, message: Message, address: Address, now: float) -> bool:
        """Whether a message is of a vehicle, and came by the way that counts."""
        source = source_of(message)
        components = self._ways.get(source.system)
        if components is None:
            if not self._is_new_vehicle(message, source):
                return False
            _LOG.info("system %d is heard from %s", source.system, address)
            components = self._ways[source.system] = {}
        self._elect(message, source)
        if source.component not in components:
            if len(components) >= COMPONENTS_KEPT:
                return False
            components[source.component] = Ways()
        ways = components[source.component]
        before = ways.active
        counts = ways.hear(address, now)
        if before not in {None, ways.active}:
            _LOG.info("%s is now heard from %s, not %s", source, ways.active, before)
        if source.component == self._autopilots.get(source.system):
            self._compare_clocks(message, address, now, counts=counts)
        return counts

    def _compare_clocks(
        self, message: Message, address: Address, now: float, *, counts: bool
    ) -> None:
        """Notice another vehicle with the same system id."""
        if counts:
            self._twins.here(message, now)
        elif self._twins.elsewhere(message, address, now):
            _LOG.warning("%s", self._twins.warning(source_of(message).system, now))

    def _elect(self, message: Message, source: Source) -> None:
        """Take the component that says that it is the system's autopilot."""
        before = self._autopilots.get(source.system)
        is_one = message.get_type() == "HEARTBEAT" and is_vehicle(message)
        if is_one and is_elected(source.component, before):
            self._autopilots[source.system] = source.component

    def _is_new_vehicle(self, message: Message, source: Source) -> bool:
        if message.get_type() != "HEARTBEAT" or not is_vehicle(message):
            return False
        if source.system == self._config.system_id:
            self._tell_of_namesake(source.system)
        is_named = self._config.vehicle_id(source.system) is not None
        return is_named and source.system not in {0, self._config.system_id}

    def _tell_of_namesake(self, system: int) -> None:
        """Log that a vehicle has the broker's own number, and cannot be told from it."""
        now = self._clock.monotonic()
        if now < self._tell_namesake_at:
            return
        self._tell_namesake_at = now + NAMESAKE_EVERY_S
        _LOG.warning(
            "a vehicle has system id %d, which is the broker's own: it is not listened to; give "
            "one of them another number (MAVLINK_SYSTEM_ID for the broker)",
            system,
        )

    def _way_to(self, system: int, component: int, now: float) -> Address | None:
        """Where a component was heard lately; else where its autopilot was."""
        components = self._ways.get(system)
        if components is None:
            return None
        autopilot = components[self._autopilots[system]]
        ways = components.get(component, autopilot)
        return autopilot.active if ways.is_silent(now, SILENT_COMPONENT_S) else ways.active

    def _pass_on(self, target: Source, frame: bytes, now: float) -> None:
        """Send a ground station's frame to a vehicle, with the vehicle's signature."""
        address = self._way_to(*target, now)
        if address is not None:
            signing = self._guard.signing_for(target.system, now)
            self._send(address, unsigned(frame) if signing is None else signing.mark(frame))

    def _greet(self, now: float) -> None:
        """Speak first to those who wait for it."""
        for address in self._link.greeted():
            if self._ground.is_at(address):
                continue
            signings = self._guard.greetings(lambda system: self._is_heard(system, now), now)
            if self._is_trusted[address.link] and None not in signings:
                signings.append(None)
            for signing in signings:
                if signing is None and self._is_busy(address, now):
                    continue
                marks = None if signing is None else signing.for_sending()
                self._send(address, self._encoder(address).encode(own_heartbeat(), marks))

    def _is_heard(self, system: int, now: float) -> bool:
        components = self._ways.get(system)
        if components is None:
            return False
        return not components[self._autopilots[system]].is_silent(now, GREETED_AFTER_S)

    def _is_busy(self, address: Address, now: float) -> bool:
        """Whether somebody there is in conversation with us already."""
        return any(
            self._is_heard(system, now) and self._way_to(system, 0, now) == address
            for system in self._ways
        )

    def _send(self, address: Address, frame: bytes) -> None:
        self._link.send(address, frame)
        self._write_down(frame)

    def _write_down(self, frame: bytes) -> None:
        if self._log is not None:
            self._log.write(frame, self._clock.utc())

    def _decoder(self, address: Address) -> Decoder:
        if address not in self._decoders:
            if len(self._decoders) >= PEERS_KEPT:
                self._decoders.clear()
            self._decoders[address] = Decoder(keeps_unknown=True)
        return self._decoders[address]

    def _encoder(self, address: Address) -> Encoder:
        """One sequence of numbers per correspondent, who may be several vehicles on one radio."""
        if address not in self._encoders:
            if len(self._encoders) >= PEERS_KEPT:
                self._encoders.clear()
            self._encoders[address] = Encoder(self._config.system_id, self._config.component_id)
        return self._encoders[address]


def _frame_log(config: Config) -> FrameLog | None:
    traffic = config.traffic
    if traffic.tlog_dir is None:
        return None
    return FrameLog(traffic.tlog_dir, file_bytes=traffic.tlog_mib << 20, files=traffic.tlog_files)
