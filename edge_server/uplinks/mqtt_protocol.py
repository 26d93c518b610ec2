"""How this gateway uses MQTT 5: topics, packets, answers, reason codes; pure.

mqtts://broker.example:8883/afarcloud/north-farm
                            <root>

<root>/<kind>/<vehicle_id>   records, one topic per stream
<root>/answers/<client id>   the cloud's answers to one gateway
<root>/gateways/<client id>  whether that gateway is online (retained, Will)

The cloud answers a record with its message_id as correlation data. The payload is a JSON object
with the status that HTTP would have given, and optionally the seconds after which to retry. A batch
is answered with a status for the whole and the results of `edge_server/uplinks/batches.py`:

    {"message_id": "01K9Z4T1W8F6Q2M3N5P7R9S0VX", "status": 503, "retry_after_s": 30}
    {"status": 200, "results": [{"message_id": "01K9...", "status": 200}, ...]}

Reason codes: MQTT 5.0 (OASIS standard, 2019), table 2-6 and sections 3.2.2.2, 3.4.2.1, 3.14.2.1.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple
from urllib.parse import unquote, urlsplit

from afarcloud import wire
from afarcloud.faults import SyntaxFaultError
from edge_server.outbox.answers import Answer, Reply, Unreachable
from edge_server.outbox.queue import Stream
from edge_server.uplinks.batches import JSON

DEFAULT_ROOT: Final = "afarcloud/farm"
_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}

IDEMPOTENCY_KEY: Final = "Idempotency-Key"
ACCEPT_BATCH: Final = "Accept-Batch"
_TOPIC_LENGTH_BYTES: Final = 2
_PACKET_ID_BYTES: Final = 2
_PROPERTY_BYTES: Final = 3  # Identifier and length before text and data
_PAYLOAD_FORMAT_BYTES: Final = 2

MAXIMUM_ANSWER_BYTES: Final = 65_536
_UNREADABLE: Final = Unreachable("an answer that cannot be read")

SUCCESS: Final = 0x00
NO_MATCHING_SUBSCRIBERS: Final = 0x10
FAILURE: Final = 0x80  # This and every larger code
PROTOCOL_ERROR: Final = 0x82
BAD_LOGIN: Final = 0x86
PACKET_TOO_LARGE: Final = 0x95
QOS_NOT_SUPPORTED: Final = 0x9B


class MqttAddress(NamedTuple):
    """A broker, and the level under which a farm's topics are."""

    host: str
    port: int
    tls: bool
    root: str

    def record_topic(self, stream: Stream) -> str:
        """Topic of a stream's records."""
        return f"{self.root}/{stream.kind}/{stream.vehicle_id}"

    @property
    def batch_topic(self) -> str:
        """Topic of batches of records."""
        return f"{self.root}/batch"

    def answers_topic(self, client_id: str) -> str:
        """Topic on which the cloud answers a gateway."""
        return f"{self.root}/answers/{client_id}"

    def presence_topic(self, client_id: str) -> str:
        """Topic that shows whether a gateway is online."""
        return f"{self.root}/gateways/{client_id}"


def is_mqtt(url: str) -> bool:
    """Whether the cloud's address is one of MQTT."""
    return urlsplit(url).scheme in _PORTS


def read_address(url: str) -> MqttAddress:
    """Read `mqtt://` or `mqtts://`; an address that the configuration accepts cannot fail here."""
    parts = urlsplit(url)
    root = unquote(parts.path).strip("/") or DEFAULT_ROOT
    port = parts.port or _PORTS[parts.scheme]
    return MqttAddress(parts.hostname or "", port, parts.scheme == "mqtts", root)


class Limits(NamedTuple):
    """What the broker accepts, as its CONNACK states."""

    receive_maximum: int = 65_535  # [-] Packets that it has not acknowledged
    packet_bytes: int = 268_435_460  # [B] MQTT's own limit


class RecordPacket(NamedTuple):
    """A record, or a batch of records, as it is published at QoS 1."""

    key: str  # Correlation data and idempotency key: the message_id of a record
    order_key: str  # Packets with the same order key are sent one after the other
    topic: str
    payload: bytes
    content_type: str
    answers_topic: str | None  # None: the broker's acknowledgement confirms

    def size_bytes(self) -> int:
        """Size of the PUBLISH packet on the wire (MQTT 5.0 section 3.3)."""
        properties = _PAYLOAD_FORMAT_BYTES + _PROPERTY_BYTES + len(self.content_type)
        properties += _PROPERTY_BYTES + 2 + len(IDEMPOTENCY_KEY) + len(self.key)
        if self.answers_topic is not None:
            properties += _PROPERTY_BYTES + len(self.answers_topic.encode())
            properties += _PROPERTY_BYTES + len(self.key)
        rest = _TOPIC_LENGTH_BYTES + len(self.topic.encode()) + _PACKET_ID_BYTES
        rest += _length_bytes(properties) + properties + len(self.payload)
        return 1 + _length_bytes(rest) + rest


def _length_bytes(length: int) -> int:
    """Bytes of a Variable Byte Integer (MQTT 5.0 section 1.5.5)."""
    return 1 + sum(length >= 128**digits for digits in (1, 2, 3))


def read_answer(key: str, payload: bytes) -> Reply:
    """Read an answer; one that cannot be read, or is about another record, confirms nothing."""
    if len(payload) > MAXIMUM_ANSWER_BYTES:
        return Unreachable("an answer that is too long")
    try:
        answer = wire.parse_json(payload)
    except SyntaxFaultError:
        return _UNREADABLE
    if not isinstance(answer, dict) or answer.get("message_id", key) != key:
        return _UNREADABLE
    status = answer.get("status")
    if isinstance(status, bool) or not isinstance(status, int) or not 100 <= status <= 599:
        return _UNREADABLE
    return Answer(status, JSON, payload, _seconds(answer.get("retry_after_s")))


def _seconds(value: object) -> float | None:
    """Return a usable wait [s], else None; NaN fails the comparison."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
        return None
    return float(min(value, 1e9))


_RECORD_REPLIES: Final[Mapping[int, Reply]] = {
    SUCCESS: Answer(200),
    NO_MATCHING_SUBSCRIBERS: Unreachable("the broker has no subscriber for it"),
    0x83: Answer(500),  # Implementation specific
    0x87: Answer(403),  # Not authorized
    0x90: Answer(400),  # Topic name invalid
    0x91: Answer(503),  # Packet identifier in use
    PACKET_TOO_LARGE: Answer(413),
    0x97: Answer(429),  # Quota exceeded
    0x99: Answer(422),  # Payload format invalid
}

_TEMPORARY_REFUSALS: Final[Mapping[int, str]] = {
    0x80: "it failed",
    0x83: "it failed",
    0x88: "it is not available",
    0x89: "it is busy",
    0x97: "its quota is used up",
    0x9C: "it names another broker, which is not followed",
    0x9D: "it has moved, which is not followed",
    0x9F: "we connect too often",
}
"""Refusals that do not depend on our credentials: the broker may accept the connection later."""


SUSPICIOUS: Final = frozenset({0x81, PROTOCOL_ERROR, 0x99})
"""Ends of a connection (malformed, protocol error, payload format) that a record may have caused.

Mosquitto 2.0 answers a payload over its message_size_limit with a PUBACK of 0x95, a code which that
packet cannot carry; to us that is a protocol error, each time that the record is sent.
"""


def reply_to_record(code: int) -> Reply:
    """Return what the broker's acknowledgement means; an unknown code confirms nothing."""
    return _RECORD_REPLIES.get(code, Answer(500))


def reply_to_refusal(code: int, text: str) -> Reply:
    """Return what a refused connection means for records: wait, or an operator has to act."""
    if code in _TEMPORARY_REFUSALS:
        return Unreachable(f"the broker refuses: {_TEMPORARY_REFUSALS[code]}")
    return Answer(401, "text/plain", text.encode())
