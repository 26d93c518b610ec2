"""Forwards frames between vehicles and ground stations.

A ground station's heartbeat is not forwarded, because a vehicle that has received one may return
home when the laptop is closed. It is forwarded only if ground stations may command at all times.

Ground stations measure the loss of a link by gaps in the sequence numbers. Frames that the broker
withholds must not look lost, and frames that it inserts in a vehicle's name must not look like 255
lost ones. So numbers are shifted by the count of withheld and inserted frames; real losses between
vehicle and broker stay visible.

Refused messages are counted, and logged periodically.

`GroundStations` keeps which ground stations are connected, accepted and sent to. On the loopback
frames are unsigned in both directions, so that any ground station connects without a key. On other
links, if vehicles must sign, ground stations must too: with the key of system 255, the id that they
use. Frames to them are signed with it. Without that key nothing is forwarded.
"""

import logging
from collections import Counter, deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final, Protocol

from mavlink_broker.config import Config
from mavlink_broker.links.url import Address, LinkKind
from mavlink_broker.mavlink.codec import (
    SEQUENCES,
    Decoder,
    encoded_as,
    sender,
    sequence,
    unsigned,
    with_sequence,
)
from mavlink_broker.mavlink.dialect import Message, Source, mavlink, name_in, source_of
from mavlink_broker.mavlink.signing import KeyRing, SignatureCheck
from mavlink_broker.microservices.message_rates import STREAMS
from mavlink_broker.routing.policy import (
    Answer,
    BrokerControl,
    Drop,
    Forward,
    Refuse,
    answering_source,
    decide,
    is_message_id,
    target_of,
)

GCS_SYSTEM_ID: Final = 255
STATIONS_KEPT: Final = 16
"""Per program; further ones are ignored until one has timed out."""
REQUIRED_INTERVALS_US: Final = {stream.message_id: 1e6 / stream.rate_hz for stream in STREAMS}
"""Intervals [us] of the messages that the broker requires, by message id."""
GCS_TIMEOUT_S: Final = 10.0
"""A ground station counts as connected until so long after its last message."""
REQUESTS_KEPT: Final = 500
"""Message ids per vehicle; no vehicle sends more."""
TIME_REQUESTS_KEPT: Final = 64
"""Requests of TIMESYNC, whose answers come within seconds."""
LOG_INTERVAL_S: Final = 10.0
"""Interval of log lines and of STATUSTEXTs: MANUAL_CONTROL may be refused at 25 Hz."""
CHUNK_BYTES: Final = 50
"""Longest text of one STATUSTEXT."""
TEXT_IDS: Final = 0xFFFF
"""Ids of STATUSTEXTs in several chunks, from 1 on."""
KINDS_LOGGED: Final = 8
KINDS_KEPT: Final = 500
"""Further kinds are counted as one: endless unknown messages must not fill the memory."""
OTHERS: Final = "other messages"
UNKNOWN: Final = "unknown message"

_LOG = logging.getLogger(__name__)


class FrameSender(Protocol):
    """Sends frames to addresses."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send one frame."""

    def contact_addresses(self) -> Collection[Address]:
        """Addresses to which this side must send before it can receive."""


class GroundStations:
    """All ground stations."""

    def __init__(
        self,
        config: Config,
        link: FrameSender,
        ring: KeyRing | None,
        utc: Callable[[], datetime],
        control: Callable[[int], BrokerControl],
    ) -> None:
        """Use the links after the vehicles' ones; `ring` holds the ground stations' key."""
        self._link = link
        self._first = len(config.vehicle_links)
        self._urls = config.traffic.forward
        self._gateway = Gateway(
            config.system_id, control, may_command=config.traffic.forward_commands
        )
        self._signature_check = SignatureCheck(None if ring is None else _GcsKeyRing(ring), (), utc)
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
        frame = self._gateway.from_vehicle(message, now)
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
                message, now, address=address
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


class SequenceNumbers:
    """Shifts sequence numbers by inserted and withheld frames, per sender."""

    def __init__(self) -> None:
        self._offset: dict[Source, int] = {}
        self._newest: dict[Source, int] = {}

    def forwarded(self, frame: bytes) -> bytes:
        """Return an unsigned frame with its sequence number for ground stations."""
        source = Source(*sender(frame))
        moved = self._offset.get(source, 0)
        number = (sequence(frame) + moved) % SEQUENCES
        self._newest[source] = number
        return with_sequence(frame, number) if moved else frame

    def withheld(self, source: Source) -> None:
        """Count a frame that is not forwarded."""
        self._offset[source] = (self._offset.get(source, 0) - 1) % SEQUENCES

    def inserted(self, source: Source) -> int:
        """Return the sequence number of an inserted frame."""
        self._offset[source] = (self._offset.get(source, 0) + 1) % SEQUENCES
        self._newest[source] = (self._newest.get(source, -1) + 1) % SEQUENCES
        return self._newest[source]


class Refusals:
    """Refused messages of ground stations, counted by kind since the start and logged at times."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()
        self._logged: Counter[str] = Counter()
        self._log_at = 0.0
        self._explained_at: dict[tuple[int, str], float] = {}

    def add(self, message: Message, system: int, now: float) -> str | None:
        """Count a refusal; returns a text for the ground station unless it got one recently."""
        name = name_of(message)
        if name not in self.count and len(self.count) >= KINDS_KEPT:
            name = OTHERS
        self.count[name] += 1
        if now - self._explained_at.get((system, name), now - LOG_INTERVAL_S) < LOG_INTERVAL_S:
            return None
        self._explained_at[system, name] = now
        return f"Denied during a broker mission: {name}"

    def log_new(self, now: float) -> None:
        """Log the new counts when it is due."""
        new = self.count - self._logged
        if not new or now < self._log_at:
            return
        self._log_at = now + LOG_INTERVAL_S
        self._logged = self.count.copy()
        what = ", ".join(f"{number} {name}" for name, number in new.most_common(KINDS_LOGGED))
        what += f", and {len(new) - KINDS_LOGGED} more kinds" if len(new) > KINDS_LOGGED else ""
        _LOG.warning("refused to ground stations: %s", what)


def name_of(message: Message) -> str:
    """Name of a message in the counts; a command by the name of its MAV_CMD."""
    kind: str = message.get_type()
    if isinstance(message, mavlink.MAVLink_unknown):
        return UNKNOWN
    if kind not in {"COMMAND_LONG", "COMMAND_INT"}:
        return kind
    return name_in("MAV_CMD", message.command) or f"command {message.command}"


@dataclass(slots=True)
class ForwardedFrames:
    """The frames that one message of a ground station causes."""

    to_vehicles: list[tuple[Source, bytes]] = field(default_factory=list)  # Component 0: autopilot
    to_ground_stations: list[bytes] = field(default_factory=list)  # Unsigned, for each of them


class Gateway:
    """Forwards between the vehicles of one broker and all ground stations."""

    def __init__(
        self,
        own_system: int,
        control: Callable[[int], BrokerControl],
        *,
        may_command: bool,
    ) -> None:
        """Start with the broker's system id and its use of each vehicle.

        `may_command`: ground stations may command at all times.
        """
        self._own_system = own_system
        self._control_of = control
        self._may_command = may_command
        self._sequence_numbers = SequenceNumbers()
        self._received_at: float | None = None
        self._requested: dict[int, set[int]] = {}
        self._log_read_of: set[int] = set()  # Systems
        self._time_requests: deque[int] = deque(maxlen=TIME_REQUESTS_KEPT)  # ts1 of TIMESYNCs
        self._text_id = 0  # Of the last text in several chunks
        self.refusals = Refusals()

    def has_ground_station(self, now: float) -> bool:
        """Whether a ground station has sent something within `GCS_TIMEOUT_S`."""
        return self._received_at is not None and now - self._received_at <= GCS_TIMEOUT_S

    def requested_messages(self, system: int, now: float) -> Collection[int] | None:
        """Message ids that ground stations have requested; None without a ground station."""
        if not self.has_ground_station(now):
            self._requested.clear()
            return None
        return self._requested.get(system, ())

    def from_vehicle(self, message: Message, now: float) -> bytes | None:
        """Return the unsigned copy of a vehicle's frame; None if it is for the broker only.

        The data of logs and the answers to TIMESYNC have no addressee: they are forwarded while
        ground stations request some. Another system's request has another clock.
        """
        is_unread_log = message.get_type() == "LOG_DATA" and not self._is_log_read(message, now)
        is_our_time = message.get_type() == "TIMESYNC" and not self._is_time_wanted(message)
        if target_of(message) == self._own_system or is_unread_log or is_our_time:
            self._sequence_numbers.withheld(source_of(message))
            return None
        return self._sequence_numbers.forwarded(unsigned(bytes(message.get_msgbuf())))

    def from_ground_station(
        self, message: Message, vehicles: Collection[int], now: float
    ) -> ForwardedFrames:
        """Decide on a ground station's message for every vehicle that it addresses."""
        forwarded_frames = ForwardedFrames()
        source = source_of(message)
        if source.system in vehicles or source.system in {0, self._own_system}:
            return forwarded_frames  # A sender must not pose as a vehicle or the broker
        self._received_at = now
        self.refusals.log_new(now)
        if message.get_type() == "HEARTBEAT" and not self._may_command:
            return forwarded_frames
        target = target_of(message)
        for system in vehicles:
            if target in {0, system}:
                self._forward(message, system, forwarded_frames, now)
        return forwarded_frames

    def _forward(
        self, message: Message, system: int, forwarded_frames: ForwardedFrames, now: float
    ) -> None:
        control = BrokerControl.FREE if self._may_command else self._control_of(system)
        answerer = Source(system, answering_source(message).component)
        destination = Source(system, getattr(message, "target_component", 0))
        match decide(message, control, REQUIRED_INTERVALS_US):
            case Forward():
                self._note_request(message, system)
                forwarded_frames.to_vehicles.append((destination, bytes(message.get_msgbuf())))
            case Answer(answer):
                forwarded_frames.to_ground_stations.append(self._framed_as(answerer, answer))
            case Drop():
                return
            case Refuse(answer, instead):
                if answer is not None:
                    forwarded_frames.to_ground_stations.append(self._framed_as(answerer, answer))
                if instead is not None:
                    frame = encoded_as(instead, source_of(message), message.get_seq())
                    forwarded_frames.to_vehicles.append((destination, frame))
                self._send_explanation(message, answerer, forwarded_frames, now)

    def _is_log_read(self, message: Message, now: float) -> bool:
        if not self.has_ground_station(now):
            self._log_read_of.clear()
        return source_of(message).system in self._log_read_of

    def _is_time_wanted(self, message: Message) -> bool:
        """Whether a vehicle's TIMESYNC is a request, or the answer to a ground station's."""
        return message.tc1 == 0 or message.ts1 in self._time_requests

    def _note_request(self, message: Message, system: int) -> None:
        """Record what a ground station requests; it sets the rate of that message from now on."""
        if message.get_type() == "TIMESYNC" and message.tc1 == 0:
            self._time_requests.append(message.ts1)
        if message.get_type() == "LOG_REQUEST_DATA":
            self._log_read_of.add(system)
        elif message.get_type() == "LOG_REQUEST_END":
            self._log_read_of.discard(system)
        command = getattr(message, "command", None)
        if command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and is_message_id(message.param1):
            requested = self._requested.setdefault(system, set())
            if len(requested) < REQUESTS_KEPT:
                requested.add(int(message.param1))

    def _send_explanation(
        self, message: Message, answerer: Source, forwarded_frames: ForwardedFrames, now: float
    ) -> None:
        sentence = self.refusals.add(message, answerer.system, now)
        if sentence is not None:
            autopilot = answerer._replace(component=mavlink.MAV_COMP_ID_AUTOPILOT1)
            forwarded_frames.to_ground_stations += [
                self._framed_as(autopilot, chunk) for chunk in self._chunks(sentence)
            ]

    def _chunks(self, sentence: str) -> list[Message]:
        """Give a text as STATUSTEXTs; the first one of several that is not full ends it.

        Their ids count down: a vehicle, in whose name they are sent, counts its own up from 1.
        """
        text = sentence.encode("ascii", "replace")
        if len(text) <= CHUNK_BYTES:
            return [mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_WARNING, text)]
        self._text_id = self._text_id - 1 if self._text_id > 1 else TEXT_IDS
        return [
            mavlink.MAVLink_statustext_message(
                mavlink.MAV_SEVERITY_WARNING,
                text[start : start + CHUNK_BYTES],
                id=self._text_id,
                chunk_seq=number,
            )
            for number, start in enumerate(range(0, len(text) + 1, CHUNK_BYTES))
        ]

    def _framed_as(self, source: Source, message: Message) -> bytes:
        return encoded_as(message, source, self._sequence_numbers.inserted(source))
