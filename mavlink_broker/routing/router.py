"""Routes frames between the links, the sessions and the ground stations, by each active link.

A received frame is accepted by its signature and its link, logged, forwarded to ground stations and
returned for the sessions. A sent frame gets a sequence number per peer address and is signed with
the vehicle's key.
"""

import logging
import struct
from collections.abc import Callable, Collection, Iterable, Sequence
from datetime import datetime
from typing import Final, Protocol

from mavlink_broker.config import Config
from mavlink_broker.links.frame_log import FrameLog
from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.codec import Decoder, Encoder, unsigned
from mavlink_broker.mavlink.dialect import (
    ONBOARD_COMPUTER,
    Message,
    Source,
    is_vehicle,
    mavlink,
    replaces_autopilot,
    source_of,
)
from mavlink_broker.mavlink.signing import KeyRing, SignatureCheck
from mavlink_broker.microservices.link_state import (
    HEARTBEAT_EVERY_S,
    own_heartbeat,
)
from mavlink_broker.routing.gateway import FrameSender, GroundStations
from mavlink_broker.routing.link_selection import (
    REPLACED_AFTER_S,
    DuplicateSystemIds,
    LinkSelection,
)
from mavlink_broker.routing.policy import BrokerControl
from mavlink_broker.supervision import InternalErrors

PEERS_KEPT: Final = 1024
OWN_ID_WARNING_INTERVAL_S: Final = 60.0
COMPONENTS_KEPT: Final = 32
"""Per system; messages of further components are ignored."""
SILENT_COMPONENT_S: Final = 5.0
"""After this silence a camera is reached at its autopilot's address: its link may be lost."""
CONTACT_AFTER_S: Final = 3.0
"""A system that is silent for so long gets heartbeats on links where this side sends first."""

_LOG = logging.getLogger(__name__)


class Link(FrameSender, Protocol):
    """Receives from addresses too."""

    def receive(self, timeout_s: float) -> Sequence[tuple[Address, bytes]]:
        """Wait for data, at most `timeout_s`."""

    def radio_status(self, address: Address, free_percent: int) -> None:
        """Follow RADIO_STATUS.txbuf of the radio at an address: the free part of its buffer."""


class Clock(Protocol):
    """The clocks of the program."""

    def monotonic(self) -> float:
        """Monotonic time [s]."""

    def utc(self) -> datetime:
        """Time of day."""


class Router:
    """Routes the frames of all vehicles."""

    def __init__(
        self,
        config: Config,
        link: Link,
        clock: Clock,
        control: Callable[[int], BrokerControl],
        internal_errors: InternalErrors | None = None,
    ) -> None:
        """Use the links; `control` gives how the broker uses a system, for ground stations.

        Errors that a datagram causes are counted in `internal_errors`.
        """
        self._internal_errors = InternalErrors() if internal_errors is None else internal_errors
        self._config = config
        self._link = link
        self._clock = clock
        self._control = control
        ring = None if config.signing_keys is None else KeyRing(config.signing_keys)
        if ring is None:
            _LOG.warning("MAVLink is unsigned: anybody who reaches the port can pose as a vehicle")
        elif not ring.systems():
            _LOG.warning(
                "%s has no signing-<system id>.key: no vehicle can be received on a link that is "
                "not trusted until it has",
                ring.folder,
            )
        self._signature_check = SignatureCheck(ring, config.unsigned_systems, clock.utc)
        self._ground_stations = GroundStations(config, link, ring, clock.utc, control)
        self._frame_log = _new_frame_log(config)
        self._links_of: dict[int, dict[int, LinkSelection]] = {}
        self._autopilots: dict[int, int] = {}
        self._decoders: dict[Address, Decoder] = {}
        self._encoders: dict[Address, Encoder] = {}
        self._duplicates = DuplicateSystemIds()
        self._replaced: set[int] = set()
        self._unproven: set[int] = set()
        self._is_trusted = [url.is_trusted for url in config.vehicle_links]
        self._contact_at = 0.0
        self._warn_own_id_at = 0.0

    def receive(self, wait_s: float) -> list[Message]:
        """Wait at most `wait_s` and return the vehicles' messages, each once."""
        arrivals = self._link.receive(wait_s)
        now = self._clock.monotonic()
        messages: list[Message] = []
        for address, data in arrivals:
            try:
                messages += self._receive_datagram(address, data, now)
            except Exception as error:  # noqa: BLE001  # the boundary of one datagram
                self._internal_errors.record("a datagram", error, now)
        if now >= self._contact_at:
            self._contact_at = now + HEARTBEAT_EVERY_S
            self._send_first_heartbeats(now)
        return messages

    def _receive_datagram(self, address: Address, data: bytes, now: float) -> list[Message]:
        if not self._ground_stations.is_at(address):
            return self._receive_vehicles(address, data, now)
        for target, frame in self._ground_stations.receive(
            address, data, self._links_of.keys(), now
        ):
            self._forward(target, frame, now)
        return []

    def send(self, system: int, messages: Iterable[Message]) -> list[Exception]:
        """Send to a vehicle; nothing is sent to one that has not been received yet.

        A message whose fields do not fit their wire types is skipped; returns the errors of those.
        """
        now = self._clock.monotonic()
        errors: list[Exception] = []
        for message in messages:
            address = self._address_of(system, getattr(message, "target_component", 0), now)
            if address is None:
                break
            signing = self._signature_check.signing_for(system, now)
            marks = None if signing is None else signing.next_signature()
            try:
                frame = self._encoder(address).encode(message, marks)
            except (struct.error, TypeError, ValueError, OverflowError) as error:
                errors.append(error)
            else:
                self._send(address, frame)
        return errors

    def requested_messages(self, system: int, now: float) -> Collection[int] | None:
        """Message ids that ground stations have requested; None without a ground station."""
        return self._ground_stations.requested_messages(system, now)

    def take_replaced(self) -> set[int]:
        """Systems in whose place another vehicle is received since the last call."""
        replaced, self._replaced = self._replaced, set()
        return replaced

    def take_unproven(self) -> set[int]:
        """Systems that another link has become active for since the last call, without a clock.

        That they are the vehicles of before is not known until their clocks are received.
        """
        unproven, self._unproven = self._unproven, set()
        return unproven

    def warning_of(self, system: int, now: float) -> str | None:
        """Warning about the links of a system for the operator; None if there is none."""
        return self._duplicates.warning(system, now)

    def forget(self, system: int) -> None:
        """Forget a system that has been silent for long."""
        self._links_of.pop(system, None)
        self._autopilots.pop(system, None)
        self._duplicates.forget(system)

    def close(self) -> None:
        """Write the rest of the frame log."""
        if self._frame_log is not None:
            self._frame_log.close()

    def _receive_vehicles(self, address: Address, data: bytes, now: float) -> list[Message]:
        messages: list[Message] = []
        is_trusted = self._is_trusted[address.link]
        for message in self._decoder(address).decode(data):
            check = self._signature_check
            if not check.accepts(message, now, address=address, is_trusted=is_trusted):
                continue
            if message.get_type() == "RADIO_STATUS":
                self._link.radio_status(address, message.txbuf)
                self._ground_stations.forward_from_vehicle(message, now)
            elif self._is_on_active_link(message, address, now):
                self._ground_stations.forward_from_vehicle(message, now)
                if not isinstance(message, mavlink.MAVLink_unknown):
                    messages.append(message)
            self._log_frame(bytes(message.get_msgbuf()))
        return messages

    def _is_on_active_link(self, message: Message, address: Address, now: float) -> bool:
        """Whether a message is of a vehicle and was received on the active link."""
        source = source_of(message)
        components = self._links_of.get(source.system)
        if components is None:
            if not self._is_new_vehicle(message, source):
                return False
            _LOG.info("system %d: receiving from %s", source.system, address)
            components = self._links_of[source.system] = {}
        self._choose_autopilot(message, source)
        if source.component not in components:
            if len(components) >= COMPONENTS_KEPT:
                return False
            components[source.component] = LinkSelection()
        links = components[source.component]
        before = links.active
        may_lead = before in {None, address} or self._may_lead(message, address, links, now)
        counts = links.receive(address, now, may_lead=may_lead)
        is_autopilot = source.component == self._autopilots.get(source.system)
        if before not in {None, links.active}:
            _LOG.info("%s: active link is now %s, was %s", source, links.active, before)
            self._note_switch(source.system, address, is_autopilot=is_autopilot)
        if is_autopilot:
            self._check_duplicate(message, address, now, counts=counts)
        return counts

    def _may_lead(
        self, message: Message, address: Address, links: LinkSelection, now: float
    ) -> bool:
        """Whether another link may become active: during a mission that of the same vehicle.

        Another vehicle takes its place when it has been silent for `REPLACED_AFTER_S`.
        """
        source = source_of(message)
        is_free = self._control(source.system) is BrokerControl.FREE
        is_autopilot = source.component == self._autopilots.get(source.system)
        is_same = self._duplicates.is_same(message, address, now, is_autopilot=is_autopilot)
        return is_same or is_free or links.is_silent(now, REPLACED_AFTER_S)

    def _note_switch(self, system: int, address: Address, *, is_autopilot: bool) -> None:
        """Note what the clock behind the new active link shows: another vehicle, or nothing yet."""
        if self._duplicates.is_another(system, address):
            self._replaced.add(system)
        elif is_autopilot and self._duplicates.lacks_clock(system, address):
            self._unproven.add(system)

    def _check_duplicate(
        self, message: Message, address: Address, now: float, *, counts: bool
    ) -> None:
        """Detect another vehicle with the same system id."""
        if counts:
            if self._duplicates.receive_active(message, address, now):
                self._replaced.add(source_of(message).system)
        elif self._duplicates.receive_other(message, address, now):
            _LOG.warning("%s", self._duplicates.warning(source_of(message).system, now))

    def _choose_autopilot(self, message: Message, source: Source) -> None:
        before = self._autopilots.get(source.system)
        is_one = message.get_type() == "HEARTBEAT" and is_vehicle(message)
        if is_one and replaces_autopilot(source.component, before):
            self._autopilots[source.system] = source.component

    def _is_new_vehicle(self, message: Message, source: Source) -> bool:
        if message.get_type() != "HEARTBEAT" or not is_vehicle(message):
            return False
        if source.system == self._config.system_id:
            self._warn_own_system_id(source.system)
        is_named = self._config.vehicle_id(source.system) is not None
        return is_named and source.system not in {0, self._config.system_id}

    def _warn_own_system_id(self, system: int) -> None:
        """Log that a vehicle has the broker's own system id and is therefore ignored."""
        now = self._clock.monotonic()
        if now < self._warn_own_id_at:
            return
        self._warn_own_id_at = now + OWN_ID_WARNING_INTERVAL_S
        _LOG.warning(
            "a vehicle has system id %d, which is the broker's own, and is ignored; give one of "
            "them another system id (MAVLINK_SYSTEM_ID for the broker)",
            system,
        )

    def _address_of(self, system: int, component: int, now: float) -> Address | None:
        """Address of a component; its autopilot's if the component has been silent."""
        components = self._links_of.get(system)
        if components is None:
            return None
        autopilot = components[self._autopilots[system]]
        links = components.get(component, autopilot)
        return autopilot.active if links.is_silent(now, SILENT_COMPONENT_S) else links.active

    def _forward(self, target: Source, frame: bytes, now: float) -> None:
        """Send a ground station's frame to a vehicle, signed with the vehicle's key."""
        address = self._address_of(*target, now)
        if address is not None:
            signing = self._signature_check.signing_for(target.system, now)
            self._send(address, unsigned(frame) if signing is None else signing.sign(frame))

    def _send_first_heartbeats(self, now: float) -> None:
        """Send heartbeats to addresses that wait for the first message."""
        for address in self._link.contact_addresses():
            if self._ground_stations.is_at(address):
                continue
            signings = self._signature_check.signings_for_contact(
                lambda system: self._is_received(system, now), now
            )
            if self._is_trusted[address.link] and None not in signings:
                signings.append(None)
            for signing in signings:
                if signing is None and self._has_vehicle(address, now):
                    continue
                marks = None if signing is None else signing.next_signature()
                self._send(address, self._encoder(address).encode(own_heartbeat(), marks))

    def _is_received(self, system: int, now: float) -> bool:
        components = self._links_of.get(system)
        if components is None:
            return False
        return not components[self._autopilots[system]].is_silent(now, CONTACT_AFTER_S)

    def _has_vehicle(self, address: Address, now: float) -> bool:
        return any(
            self._is_received(system, now) and self._address_of(system, 0, now) == address
            for system in self._links_of
        )

    def _send(self, address: Address, frame: bytes) -> None:
        self._link.send(address, frame)
        self._log_frame(frame)

    def _log_frame(self, frame: bytes) -> None:
        if self._frame_log is not None:
            self._frame_log.write(frame, self._clock.utc())

    def _decoder(self, address: Address) -> Decoder:
        if address not in self._decoders:
            if len(self._decoders) >= PEERS_KEPT:
                self._decoders.clear()
            self._decoders[address] = Decoder(keeps_unknown=True)
        return self._decoders[address]

    def _encoder(self, address: Address) -> Encoder:
        """One series of sequence numbers per address, which several vehicles on a radio share."""
        if address not in self._encoders:
            if len(self._encoders) >= PEERS_KEPT:
                self._encoders.clear()
            self._encoders[address] = Encoder(self._config.system_id, ONBOARD_COMPUTER)
        return self._encoders[address]


def _new_frame_log(config: Config) -> FrameLog | None:
    traffic = config.traffic
    if traffic.tlog_dir is None:
        return None
    return FrameLog(traffic.tlog_dir, file_bytes=traffic.tlog_mib << 20, files=traffic.tlog_files)
