"""The payload of FILE_TRANSFER_PROTOCOL(110): 12 bytes of header, up to 239 of data.

Layout and numbers: MAVLink's file transfer protocol, "Payload format", "OpCodes", "NAK errors".
"""

import struct
from typing import Final, NamedTuple

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink

DATA_MAX: Final = 239
_PAYLOAD_BYTES: Final = 251
_HEADER: Final = struct.Struct("<HBBBBBBI")

TERMINATE, RESET, OPEN, READ, CHECKSUM, BURST = 1, 2, 4, 5, 14, 15
ACK, NAK = 128, 129

FAIL_ERRNO, INVALID_SESSION, NO_SESSIONS, END_OF_FILE, UNKNOWN = 2, 4, 5, 6, 7
NAK_REASONS: Final = {
    1: "failure",
    FAIL_ERRNO: "failure of its storage",
    3: "invalid size",
    INVALID_SESSION: "invalid session",
    NO_SESSIONS: "too many files are open",
    END_OF_FILE: "end of file",
    UNKNOWN: "unknown command",
    8: "the file exists",
    9: "the file is protected",
    10: "file not found",
}


class Packet(NamedTuple):
    """One payload in either direction."""

    seq: int
    session: int
    opcode: int
    size: int  # [bytes] Of the data, or requested
    requested: int  # In an answer: the opcode of the request
    is_complete: bool  # In an answer to a burst: it is the last packet
    offset: int
    data: bytes

    @property
    def error(self) -> int:
        """Error code of a NAK; 0 if it has none."""
        return self.data[0] if self.data else 0


def encode_request(route: Route, packet: Packet) -> Message:
    """FILE_TRANSFER_PROTOCOL to one component of the vehicle."""
    header = _HEADER.pack(
        packet.seq, packet.session, packet.opcode, packet.size, 0, 0, 0, packet.offset
    )
    return mavlink.MAVLink_file_transfer_protocol_message(
        0,
        route.target_system,
        route.target_component,
        (header + packet.data).ljust(_PAYLOAD_BYTES, b"\x00"),
    )


def answer_of(message: Message) -> Packet | None:
    """Decode an answer; None for other payloads, such as requests of other clients."""
    payload = bytes(message.payload)
    seq, session, opcode, size, requested, complete, _, offset = _HEADER.unpack_from(payload)
    if opcode not in {ACK, NAK}:
        return None
    size = min(size, DATA_MAX)
    data = payload[_HEADER.size : _HEADER.size + size]
    return Packet(seq, session, opcode, size, requested, bool(complete), offset, data)
