"""One connection to the broker over paho-mqtt, driven by one thread; what happens becomes events.

A session starts clean and ends with the connection, and each connection is a new paho client: what
was under way is in the outbox, and nothing else may send it again.
"""

import json
import logging
import re
import select
import socket
import ssl
import struct
import time
from hashlib import sha256
from hmac import compare_digest
from pathlib import Path
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

from edge_server.uplinks import mqtt_reasons
from edge_server.uplinks.mqtt_answers import MAXIMUM_ANSWER_BYTES
from edge_server.uplinks.mqtt_login import LoginError, read_login
from edge_server.uplinks.mqtt_messages import (
    ACCEPT_BATCH,
    IDEMPOTENCY_KEY,
    Accepted,
    Acknowledged,
    Answered,
    Event,
    Limits,
    Lost,
    RecordPacket,
    Refused,
    Subscribed,
)
from edge_server.uplinks.mqtt_topics import MqttAddress

LOG = logging.getLogger(__name__)
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
"""What paho's decoder raises for bytes that are no MQTT 5; it checks few lengths itself."""


class BrokerSettings(NamedTuple):
    """What a connection needs to know."""

    address: MqttAddress
    client_id: str
    hears_answers: bool
    login_file: Path | None
    ca_file: Path | None
    fingerprint: str | None
    certificate_file: Path | None
    connect_timeout_s: float
    packet_timeout_s: float  # From the first byte of a packet to its last one
    keep_alive_s: int


class Connection:
    """A connection from its opening to its end; `events` fill up as it is stepped."""

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
        # The session counts what is under way by the broker's own limit.
        self._client.max_inflight_messages_set(0)
        self._client.on_connect = self._on_connect
        self._client.on_subscribe = self._on_subscribe
        self._client.on_publish = self._on_publish
        self._client.on_message = self._on_message
        self._client.on_disconnect = self._on_disconnect

    def open(self) -> None:
        """Connect and greet the broker; its answer comes as an event.

        Raises:
            LoginError: if a file with user and password or with certificates cannot be used.
            OSError: if the broker cannot be reached, or is not the one we trust.
        """
        settings = self._settings
        if settings.login_file is not None:
            login = read_login(settings.login_file)
            self._client.username_pw_set(login.user, login.password)
        if settings.address.tls:
            self._client.tls_set_context(_trust(settings))
        self._client.will_set(self._presence_topic, _presence("offline"), _QOS, retain=True)
        hello = _properties(PacketTypes.CONNECT)
        hello.SessionExpiryInterval = 0
        hello.MaximumPacketSize = MAXIMUM_ANSWER_BYTES + _HEADROOM_BYTES
        self._client.connect(
            settings.address.host,
            settings.address.port,
            keepalive=settings.keep_alive_s,
            clean_start=True,
            properties=hello,
        )
        opened = self._client.socket()
        if isinstance(opened, socket.socket):
            # A record is small and waits for nothing (RFC 896 would have it wait).
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            _acknowledge_at_once(opened)

    def subscribe(self) -> None:
        """Ask for the cloud's answers to this gateway."""
        topic = self._settings.address.answers_topic(self._settings.client_id)
        self._client.subscribe(topic, qos=_QOS)

    def announce(self) -> int:
        """Tell that this gateway is online; the Will tells when it is not any more.

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
        """Read and write what is due; returns when something has happened, or in time."""
        sock = self._client.socket()
        if sock is None:
            self.events.append(Lost("the connection is gone"))
            return
        if isinstance(sock, ssl.SSLSocket) and sock.pending():
            timeout_s = 0.0  # Bytes that select does not see any more
        writers = [sock] if self._client.want_write() else []
        readable, writable, _ = select.select([wake, sock], writers, [], timeout_s)
        try:
            if sock in readable or (isinstance(sock, ssl.SSLSocket) and sock.pending()):
                self._client.loop_read()
                _acknowledge_at_once(sock)
            if writable:
                self._client.loop_write()
            self._client.loop_misc()
        except _UNDECODABLE as error:
            LOG.debug("what the broker sends cannot be decoded", exc_info=error)
            self.events.append(Lost(f"the broker sends no MQTT 5 ({type(error).__name__})"))
        self._check_packet(time.monotonic())

    def _check_packet(self, now: float) -> None:
        """Give up a connection whose packet is too large, or takes too long to its last byte.

        The greeting names our maximum packet size, but a broker may not keep to it, and paho keeps
        whatever part of a packet it has.
        """
        packet = self._client._in_packet  # noqa: SLF001  # paho offers no other way to see a part
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
        """Go in order: the broker publishes the Will, as we are offline from now on."""
        self._client.disconnect(ReasonCode(PacketTypes.DISCONNECT, "Disconnect with will message"))

    def cut(self) -> None:
        """Close without ceremony, and leave nothing open."""
        sock = self._client.socket()
        if sock is not None:
            sock.close()
        # The client holds us by its callbacks; without them it goes when we go, sockets and all.
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
            self.events.append(Refused(mqtt_reasons.QOS_NOT_SUPPORTED, text))
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
            self.events.append(Lost(f"the broker has closed: {reason}", reason.value))
        elif reason.value == mqtt_reasons.PROTOCOL_ERROR:
            self.events.append(Lost("the broker says what is no MQTT 5", reason.value))
        else:
            self.events.append(Lost("the connection to the broker broke"))


def _properties(packet_type: int) -> Any:
    """Properties of a packet; paho tells no types for them."""
    return Properties(packet_type)  # type: ignore[no-untyped-call]


def _count(text: str | None) -> int | None:
    """A number of records; None for nothing, and for what is no number."""
    return int(text) if text is not None and re.fullmatch(r"[0-9]{1,6}", text) else None


def _presence(status: str) -> str:
    return json.dumps({"status": status})


def _acknowledge_at_once(sock: Any) -> None:
    """Where the kernel can, spare us its delayed acknowledgement.

    A broker that does not set TCP_NODELAY, as Mosquitto does not by itself, keeps an answer
    back until its PUBACK, sent just before, is acknowledged: 40 ms for each record.
    """
    is_open = isinstance(sock, socket.socket) and sock.fileno() >= 0
    if is_open and hasattr(socket, "TCP_QUICKACK"):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)


def _trust(settings: BrokerSettings) -> ssl.SSLContext:
    """TLS 1.2 or newer with a verified peer; our own certificate if there is one.

    Raises:
        LoginError: if a file of certificates cannot be used.
    """
    try:
        context = ssl.create_default_context(cafile=settings.ca_file)
        if settings.certificate_file is not None:
            context.load_cert_chain(settings.certificate_file)
    except OSError as error:  # An SSLError is one
        raise LoginError(f"certificates cannot be used: {error.strerror or error}") from None
    context.sslsocket_class = _checking(settings.fingerprint)
    return context


def _checking(fingerprint: str | None) -> type[ssl.SSLSocket]:
    """Sockets that look for the pin before anything is said, our password above all."""

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
