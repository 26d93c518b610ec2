"""One connection to the broker over paho-mqtt, driven by one thread; it collects events.

A session starts clean and ends with the connection, and each connection is a new paho client: the
records in flight are in the outbox, and only the relay may send them again.

LoginError  a file with our credentials or with certificates cannot be used
"""

import json
import logging
import os
import re
import socket
import ssl
import stat
import struct
import time
from hashlib import sha256
from hmac import compare_digest
from pathlib import Path
from secrets import token_hex
from typing import Any, Final, NamedTuple

from paho.mqtt.client import (
    Client,
    ConnectFlags,
    DisconnectFlags,
    MQTTMessage,
    MQTTv5,
)
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.exception import MQTTException
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from edge_server.outbox import wakeup
from edge_server.uplinks import mqtt_protocol
from edge_server.uplinks.mqtt_protocol import (
    ACCEPT_BATCH,
    IDEMPOTENCY_KEY,
    MAXIMUM_ANSWER_BYTES,
    Limits,
    MqttAddress,
    RecordPacket,
)
from edge_server.uplinks.mqtt_session import (
    Accepted,
    Acknowledged,
    Answered,
    Event,
    Lost,
    Refused,
    Subscribed,
)

LOG = logging.getLogger(__name__)
MAXIMUM_LOGIN_BYTES: Final = 32_768
_HEADROOM_BYTES: Final = 1024  # Topic and properties beside an answer's payload
_QOS: Final = 1
_UNDECODABLE: Final = (
    MQTTException,
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
    struct.error,
)
"""What paho's decoder raises for bytes that are not MQTT 5; it checks few lengths itself."""


class LoginError(Exception):
    """A file with user and password or with certificates cannot be used; never quotes it."""


class Login(NamedTuple):
    """Our credentials at the broker."""

    user: str
    password: str


def read_login(path: Path) -> Login:
    """Read `user:password` from a file that only its owner may read.

    It is read for each connection, since it may be replaced while the relay runs.

    Raises:
        LoginError: if the file cannot be read, others may access it, or it holds no
            `user:password`.
    """
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            text = file.read(MAXIMUM_LOGIN_BYTES + 1).decode().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise LoginError(f"{path.name} cannot be read ({type(error).__name__})") from None
    if stat.S_IMODE(mode) & 0o077:
        raise LoginError(f"{path.name} is open to others: chmod 600 it")
    user, colon, password = text.partition(":")
    if not user or not colon or len(text) > MAXIMUM_LOGIN_BYTES:
        raise LoginError(f"{path.name} does not hold user:password")
    return Login(user, password)


def own_client_id(path: Path) -> str:
    """Return this gateway's client id, drawn once and kept in the state folder.

    Of two gateways with one client id, each would end the other's connection.
    """
    try:
        kept = path.read_text(encoding="ascii").strip()
    except (FileNotFoundError, UnicodeDecodeError):
        kept = ""
    if kept.isalnum():
        return kept
    drawn = f"edge{token_hex(8)}"  # Every broker accepts up to 23 letters and digits
    try:
        path.write_text(f"{drawn}\n", encoding="ascii")
    except OSError as error:
        LOG.warning("the client id %s is used for this run only: %s", drawn, error)
    return drawn


class BrokerSettings(NamedTuple):
    """Settings of a connection."""

    address: MqttAddress
    client_id: str
    reads_answers: bool  # False: the broker's acknowledgement confirms
    login_file: Path | None
    ca_file: Path | None
    fingerprint: str | None
    certificate_file: Path | None
    connect_timeout_s: float
    packet_timeout_s: float  # From the first byte of a packet to its last one
    keep_alive_s: int


class Connection:
    """A connection from its opening to its end; each `step` adds to `events`."""

    def __init__(self, settings: BrokerSettings) -> None:
        self._settings = settings
        self.events: list[Event] = []
        self._incomplete_since: float | None = None
        self._client = Client(
            CallbackAPIVersion.VERSION2,
            client_id=settings.client_id,
            protocol=MQTTv5,
            reconnect_on_failure=False,
        )
        self._client.connect_timeout = settings.connect_timeout_s
        # The session limits the packets in flight to the broker's receive maximum.
        self._client.max_inflight_messages_set(0)
        self._client.on_connect = self._on_connect
        self._client.on_subscribe = self._on_subscribe
        self._client.on_publish = self._on_publish
        self._client.on_message = self._on_message
        self._client.on_disconnect = self._on_disconnect

    def open(self) -> None:
        """Connect and send CONNECT; the broker's answer comes as an event.

        Raises:
            LoginError: if a file with user and password or with certificates cannot be used.
            OSError: if the broker cannot be reached, or its certificate is not accepted.
        """
        settings = self._settings
        if settings.login_file is not None:
            login = read_login(settings.login_file)
            self._client.username_pw_set(login.user, login.password)
        if settings.address.tls:
            self._client.tls_set_context(_tls_context(settings))
        self._client.will_set(self._presence_topic, _presence("offline"), _QOS, retain=True)
        connect = _properties(PacketTypes.CONNECT)
        connect.SessionExpiryInterval = 0
        connect.MaximumPacketSize = MAXIMUM_ANSWER_BYTES + _HEADROOM_BYTES
        self._client.connect(
            settings.address.host,
            settings.address.port,
            keepalive=settings.keep_alive_s,
            clean_start=True,
            properties=connect,
        )
        opened = self._client.socket()
        if isinstance(opened, socket.socket):
            # A small record is sent at once; Nagle's algorithm (RFC 896) would delay it.
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            _acknowledge_at_once(opened)

    def subscribe(self) -> None:
        """Subscribe to the cloud's answers to this gateway."""
        topic = self._settings.address.answers_topic(self._settings.client_id)
        self._client.subscribe(topic, qos=_QOS)

    def announce(self) -> int:
        """Publish that this gateway is online; the Will publishes that it no longer is.

        Returns the packet identifier.
        """
        return self._client.publish(
            self._presence_topic, _presence("online"), _QOS, retain=True
        ).mid

    def publish(self, packet: RecordPacket) -> int:
        """Send a record; returns its packet identifier."""
        properties = _properties(PacketTypes.PUBLISH)
        properties.PayloadFormatIndicator = 1  # UTF-8
        properties.ContentType = packet.content_type
        properties.UserProperty = (IDEMPOTENCY_KEY, packet.key)
        if packet.answers_topic is not None:
            properties.ResponseTopic = packet.answers_topic
            properties.CorrelationData = packet.key.encode()
        return self._client.publish(
            packet.topic, packet.payload, qos=_QOS, properties=properties
        ).mid

    def step(self, wake: int, timeout_s: float) -> None:
        """Read and write what is due; returns after an event or the timeout."""
        sock = self._client.socket()
        if sock is None:
            self.events.append(Lost("the connection is closed"))
            return
        if isinstance(sock, ssl.SSLSocket) and sock.pending():
            timeout_s = 0.0  # Bytes that TLS has read already, which a poll does not see
        own = sock.fileno()
        writers = [own] if self._client.want_write() else []
        ready = wakeup.wait([wake, own], timeout_s, writers=writers)
        try:
            if own in ready.readable or (isinstance(sock, ssl.SSLSocket) and sock.pending()):
                self._client.loop_read()
                _acknowledge_at_once(sock)
            if ready.writable:
                self._client.loop_write()
            self._client.loop_misc()
        except _UNDECODABLE as error:
            LOG.debug("cannot decode a packet of the broker", exc_info=error)
            self.events.append(Lost(f"the broker does not send MQTT 5 ({type(error).__name__})"))
        self._check_packet(time.monotonic())

    def _check_packet(self, now: float) -> None:
        """End a connection whose incoming packet is too large or takes too long.

        CONNECT states our maximum packet size, but a broker may exceed it, and paho keeps whatever
        part of a packet it has.
        """
        packet = self._client._in_packet  # noqa: SLF001  # paho has no other access to a partial packet
        if not packet["command"]:
            self._incomplete_since = None
            return
        if self._incomplete_since is None:
            self._incomplete_since = now
        if packet["remaining_length"] > MAXIMUM_ANSWER_BYTES + _HEADROOM_BYTES:
            self.events.append(Lost("a packet of the broker is too large"))
        elif now - self._incomplete_since > self._settings.packet_timeout_s:
            self.events.append(Lost("a packet of the broker took too long"))

    def leave(self) -> None:
        """Disconnect in order; the broker publishes the Will, since we are offline from now on."""
        self._client.disconnect(ReasonCode(PacketTypes.DISCONNECT, "Disconnect with will message"))

    def cut(self) -> None:
        """Close the socket without a DISCONNECT and release everything."""
        sock = self._client.socket()
        if sock is not None:
            sock.close()
        # The client refers to us by its callbacks; without them both are freed, sockets included.
        self._client.on_connect = self._client.on_subscribe = self._client.on_publish = None
        self._client.on_message = self._client.on_disconnect = None

    @property
    def _presence_topic(self) -> str:
        return self._settings.address.presence_topic(self._settings.client_id)

    def _on_connect(
        self, _: Client, __: Any, ___: ConnectFlags, reason: ReasonCode, properties: Any
    ) -> None:
        if reason.is_failure:
            self.events.append(Refused(reason.value, str(reason)))
        elif getattr(properties, "MaximumQoS", _QOS) < _QOS:
            text = "the broker acknowledges nothing (maximum QoS 0)"
            self.events.append(Refused(mqtt_protocol.QOS_NOT_SUPPORTED, text))
        else:
            default = Limits()
            maximum = getattr(properties, "ReceiveMaximum", default.receive_maximum)
            size = getattr(properties, "MaximumPacketSize", default.packet_bytes)
            self.events.append(Accepted(Limits(maximum, size)))

    def _on_subscribe(
        self, _: Client, __: Any, ___: int, reasons: list[ReasonCode], ____: Any
    ) -> None:
        self.events.append(Subscribed(reasons[0].value, str(reasons[0])))

    def _on_publish(self, _: Client, __: Any, mid: int, reason: ReasonCode, ___: Any) -> None:
        self.events.append(Acknowledged(mid, reason.value))

    def _on_message(self, _: Client, __: Any, message: MQTTMessage) -> None:
        correlation = getattr(message.properties, "CorrelationData", b"")
        accept_batch = dict(getattr(message.properties, "UserProperty", ())).get(ACCEPT_BATCH)
        self.events.append(Answered(correlation, bytes(message.payload), _count(accept_batch)))

    def _on_disconnect(
        self, _: Client, __: Any, flags: DisconnectFlags, reason: ReasonCode, ___: Any
    ) -> None:
        if flags.is_disconnect_packet_from_server:
            self.events.append(Lost(f"the broker closed the connection: {reason}", reason.value))
        elif reason.value == mqtt_protocol.PROTOCOL_ERROR:
            self.events.append(Lost("the broker violates MQTT 5", reason.value))
        else:
            self.events.append(Lost("the connection to the broker broke"))


def _properties(packet_type: int) -> Any:
    """Properties of a packet; paho declares no types for them."""
    return Properties(packet_type)  # type: ignore[no-untyped-call]


def _count(text: str | None) -> int | None:
    """Return a number of records; None if there is no text or it is not a number."""
    return int(text) if text is not None and re.fullmatch(r"[0-9]{1,6}", text) else None


def _presence(status: str) -> str:
    return json.dumps({"status": status})


def _acknowledge_at_once(sock: Any) -> None:
    """Switch off the kernel's delayed TCP acknowledgement where it allows that.

    A broker that does not set TCP_NODELAY, as Mosquitto does not by default, delays an answer until
    its PUBACK, sent just before, is acknowledged: 40 ms for each record.
    """
    is_open = isinstance(sock, socket.socket) and sock.fileno() >= 0
    if is_open and hasattr(socket, "TCP_QUICKACK"):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)


def _tls_context(settings: BrokerSettings) -> ssl.SSLContext:
    """Return TLS 1.2 or newer with a verified peer, and our own certificate if there is one.

    Raises:
        LoginError: if a file of certificates cannot be used.
    """
    try:
        context = ssl.create_default_context(cafile=settings.ca_file)
        if settings.certificate_file is not None:
            context.load_cert_chain(settings.certificate_file)
    except OSError as error:  # An SSLError is one
        raise LoginError(f"certificates cannot be used: {error.strerror or error}") from None
    context.sslsocket_class = _pinned_socket(settings.fingerprint)
    return context


def _pinned_socket(fingerprint: str | None) -> type[ssl.SSLSocket]:
    """Return sockets that check the pinned certificate before they send anything."""

    class CheckedSocket(ssl.SSLSocket):
        def do_handshake(self, block: bool = False) -> None:  # noqa: FBT001, FBT002  # as the base
            try:
                super().do_handshake(block)
                certificate = self.getpeercert(binary_form=True) or b""
                seen = sha256(certificate).hexdigest()
                if fingerprint is not None and not compare_digest(seen, fingerprint):
                    raise ssl.SSLCertVerificationError("another certificate than the pinned one")
            except OSError:
                self.close()
                raise

    return CheckedSocket
