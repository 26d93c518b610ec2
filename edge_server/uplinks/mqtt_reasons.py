"""What MQTT's reason codes mean for a record, said in the relay's own classes; pure tables.

Source: MQTT 5.0 (OASIS standard, 2019), table 2-6 and sections 3.2.2.2, 3.4.2.1 and 3.14.2.1.
"""

from collections.abc import Mapping
from typing import Final

from edge_server.outbox.answers import Answer, Reply, Unreachable

SUCCESS: Final = 0x00
NO_MATCHING_SUBSCRIBERS: Final = 0x10
FAILURE: Final = 0x80  # From here on
PROTOCOL_ERROR: Final = 0x82
BAD_LOGIN: Final = 0x86
PACKET_TOO_LARGE: Final = 0x95
QOS_NOT_SUPPORTED: Final = 0x9B

_OF_A_RECORD: Final[Mapping[int, Reply]] = {
    SUCCESS: Answer(200),
    NO_MATCHING_SUBSCRIBERS: Unreachable("the broker has nobody who takes it"),
    0x83: Answer(500),  # Implementation specific
    0x87: Answer(403),  # Not authorized
    0x90: Answer(400),  # Topic name invalid
    0x91: Answer(503),  # Packet identifier in use
    PACKET_TOO_LARGE: Answer(413),
    0x97: Answer(429),  # Quota exceeded
    0x99: Answer(422),  # Payload format invalid
}

_PASSING: Final[Mapping[int, str]] = {
    0x80: "it failed",
    0x83: "it failed",
    0x88: "it is not available",
    0x89: "it is busy",
    0x97: "its quota is used up",
    0x9C: "it names another broker, which is not followed",
    0x9D: "it has moved, which is not followed",
    0x9F: "we connect too often",
}
"""Refusals that are not about who we are: the same connection may be welcome later."""


SUSPICIOUS: Final = frozenset({0x81, PROTOCOL_ERROR, 0x99})
"""Ends of a connection (malformed, protocol error, payload format) that a record may have caused.

Mosquitto 2.0 answers a payload over its message_size_limit with a PUBACK of 0x95, a code which that
packet cannot carry; to us that is a protocol error, each time that the record is sent.
"""


def of_record(code: int) -> Reply:
    """What the broker's acknowledgement means; a code that is unknown here confirms nothing."""
    return _OF_A_RECORD.get(code, Answer(500))


def of_refusal(code: int, text: str) -> Reply:
    """What it means that the broker does not let us in: wait, or an operator's work."""
    if code in _PASSING:
        return Unreachable(f"the broker refuses: {_PASSING[code]}")
    return Answer(401, "text/plain", text.encode())
