"""What the session and the connection tell each other; the session knows no more of MQTT.

Reason codes are the numbers of MQTT 5.0 (OASIS standard, section 2.4).
"""

from typing import Final, NamedTuple, TypeAlias

IDEMPOTENCY_KEY: Final = "Idempotency-Key"
ACCEPT_BATCH: Final = "Accept-Batch"
_TOPIC_LENGTH_BYTES: Final = 2
_PACKET_ID_BYTES: Final = 2
_PROPERTY_BYTES: Final = 3  # Identifier and length before text and data
_PAYLOAD_FORMAT_BYTES: Final = 2


class Limits(NamedTuple):
    """What the broker is willing to take, as its CONNACK says."""

    receive_maximum: int = 65_535  # [-] Records that it has not acknowledged
    packet_bytes: int = 268_435_460  # [B] MQTT's own limit


class RecordPacket(NamedTuple):
    """A record, or a batch of them, as it is published at QoS 1."""

    key: str  # Correlation data and idempotency key: the message_id of a record
    lane: str  # Packets of one lane go one after the other
    topic: str
    payload: bytes
    content_type: str
    answers_topic: str | None  # None: the broker's word is enough

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
    """Bytes that a Variable Byte Integer takes (MQTT 5.0 section 1.5.5)."""
    return 1 + sum(length >= 128**digits for digits in (1, 2, 3))


class Accepted(NamedTuple):
    """The broker has let us in."""

    limits: Limits


class Refused(NamedTuple):
    """The broker does not let us in."""

    code: int
    text: str


class Subscribed(NamedTuple):
    """The broker's answer to our wish to hear answers."""

    code: int
    text: str


class Acknowledged(NamedTuple):
    """The broker has taken a packet, or not."""

    packet_id: int
    code: int


class Answered(NamedTuple):
    """The cloud has answered."""

    correlation: bytes
    payload: bytes
    accept_batch: int | None = None  # [-] So many records it takes in one packet, if it says so


class Lost(NamedTuple):
    """The connection is gone; `code` is the broker's own word about it, if it gave one."""

    reason: str
    code: int | None = None


Event: TypeAlias = Accepted | Refused | Subscribed | Acknowledged | Answered | Lost


class Open(NamedTuple):
    """Connect to the broker."""


class Subscribe(NamedTuple):
    """Ask for the cloud's answers."""


class Announce(NamedTuple):
    """Tell that this gateway is online."""


class Publish(NamedTuple):
    """Send a record."""

    packet: RecordPacket


class Cut(NamedTuple):
    """Close the connection without ceremony."""


Action: TypeAlias = Open | Subscribe | Announce | Publish | Cut
