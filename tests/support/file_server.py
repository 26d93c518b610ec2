"""A file server of MAVFTP with faults that a script chooses: messages in, messages out.

It shares no code with either program but the codec; it answers at once and keeps no clock.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from tests.support.vehicle_wire import Message, mavlink

TERMINATE, RESET, OPEN, READ, CHECKSUM, BURST = 1, 2, 4, 5, 14, 15
ACK, NAK = 128, 129
FAIL, INVALID_SESSION, NO_SESSIONS, END_OF_FILE, UNKNOWN, NOT_FOUND = 1, 4, 5, 6, 7, 10
DATA_MAX: Final = 239
_HEADER: Final = struct.Struct("<HBBBBBBI")


@dataclass
class ScriptedFiles:
    """Files by path, and what the server does wrong."""

    files: Mapping[str, bytes] = field(default_factory=dict)
    unknown: frozenset[int] = frozenset()  # Opcodes that it does not know
    busy_for: int = 0  # Openings that it refuses for lack of sessions
    silent: frozenset[int] = frozenset()  # Opcodes that it never answers
    piece: int = DATA_MAX  # Bytes per packet, whatever is asked for
    burst_packets: int = 20
    wrong_checksums: int = 0
    sends_nothing: bool = False
    session: int = 3
    asked: list[int] = field(default_factory=list)  # Opcodes, in order
    _open: str | None = None

    def restart(self) -> None:
        """Forget what is open."""
        self._open = None

    def answers(self, message: Message) -> Iterator[Message]:
        """Give the answers to a request."""
        if message.get_type() != "FILE_TRANSFER_PROTOCOL":
            return
        seq, session, opcode, size, _, _, _, offset = _HEADER.unpack_from(bytes(message.payload))
        data = bytes(message.payload)[_HEADER.size : _HEADER.size + size]
        self.asked.append(opcode)
        if opcode in self.silent:
            return
        replies = list(self._replies(opcode, session, offset, size, data))
        for number, (kind, at, body) in enumerate(replies, start=1):
            complete = opcode == BURST and number == len(replies)
            header = _HEADER.pack(
                (seq + number) & 0xFFFF, self.session, kind, len(body), opcode, complete, 0, at
            )
            payload = (header + body).ljust(251, b"\x00")
            yield mavlink.MAVLink_file_transfer_protocol_message(0, 254, 191, payload)

    def _replies(
        self, opcode: int, session: int, offset: int, size: int, data: bytes
    ) -> Iterator[tuple[int, int, bytes]]:
        if opcode in self.unknown:
            yield NAK, offset, bytes([UNKNOWN])
        elif opcode == OPEN:
            yield self._opened(data.decode())
        elif opcode == CHECKSUM:
            yield ACK, 0, struct.pack("<I", self._checksum(self.files[data.decode()]))
        elif opcode in {TERMINATE, RESET}:
            self._open = None
            self.busy_for = 0 if opcode == RESET else self.busy_for
            yield ACK, 0, b""
        elif self._open is None or session != self.session:
            yield NAK, offset, bytes([INVALID_SESSION])
        else:
            yield from self._data(opcode, offset, size)

    def _opened(self, path: str) -> tuple[int, int, bytes]:
        if self.busy_for:
            self.busy_for -= 1
            return NAK, 0, bytes([NO_SESSIONS])
        if path not in self.files:
            return NAK, 0, bytes([NOT_FOUND])
        self._open = path
        return ACK, 0, struct.pack("<I", len(self.files[path]))

    def _data(self, opcode: int, offset: int, size: int) -> Iterator[tuple[int, int, bytes]]:
        contents = self.files[self._open or ""]
        if offset >= len(contents):
            yield NAK, offset, bytes([END_OF_FILE])
            return
        count = self.burst_packets if opcode == BURST else 1
        step = min(self.piece, size or DATA_MAX)
        for at in range(offset, min(offset + count * step, len(contents)), step):
            yield ACK, at, b"" if self.sends_nothing else contents[at : at + step]

    def _checksum(self, contents: bytes) -> int:
        right = zlib.crc32(contents, 0xFFFFFFFF) ^ 0xFFFFFFFF
        if self.wrong_checksums:
            self.wrong_checksums -= 1
            return right ^ 1
        return right
