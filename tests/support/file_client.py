"""A MAVFTP client as the protocol's text describes it: sans-IO, with nothing of the firmware.

Every request is repeated with its number until it is answered; of a burst, what is missing in
the end is read piece by piece.

    client = FileClient(transfer)
    out = client.start(now_us); out += client.take(payload, now_us); out += client.tick(now_us)
"""

import struct
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

OPEN, READ, CREATE, WRITE, TERMINATE, BURST = 4, 5, 6, 7, 1, 15
ACK, NAK = 128, 129
END_OF_FILE: Final = 6
REPEAT_US: Final = 500_000
TRIES: Final = 40
DATA_MAX: Final = 239
_HEADER: Final = struct.Struct("<HBBBBBBI")


class Packet(NamedTuple):
    """One payload in either direction."""

    seq: int
    session: int
    opcode: int
    asked: int
    complete: int
    offset: int
    data: bytes

    def pack(self, size: int | None = None) -> bytes:
        length = len(self.data) if size is None else size
        header = _HEADER.pack(
            self.seq, self.session, self.opcode, length, self.asked, self.complete, 0, self.offset
        )
        return (header + self.data).ljust(251, b"\x00")


def unpack(payload: bytes) -> Packet:
    seq, session, opcode, size, asked, complete, _, offset = _HEADER.unpack_from(payload)
    return Packet(seq, session, opcode, asked, complete, offset, payload[12 : 12 + size])


class RefusedError(Exception):
    """The server has refused a request."""


@dataclass
class Ask:
    """What is to be asked next; `size` where it is not the length of the data."""

    opcode: int
    data: bytes = b""
    session: int = 0
    offset: int = 0
    size: int | None = None


Steps = Generator[Ask, list[Packet], None]
"""Asks, and gets the answers: one, or the packets of a burst until it is silent."""


@dataclass
class FileClient:
    """Carries out the steps of a transfer."""

    steps: Steps
    done: bool = False
    _seq: int = 0
    _ask: Ask = field(default_factory=lambda: Ask(0))
    _payload: bytes = b""
    _answers: list[Packet] = field(default_factory=list)
    _repeat_us: int = 0
    _tries: int = 0

    def start(self, now_us: int) -> list[bytes]:
        return self._advance(None, now_us)

    def take(self, payload: bytes, now_us: int) -> list[bytes]:
        """Take what the server sent."""
        packet = unpack(payload)
        distance = (packet.seq - self._seq - 1) & 0xFFFF
        is_burst = self._ask.opcode == BURST
        if self.done or packet.asked != self._ask.opcode or distance > (500 if is_burst else 0):
            return []
        self._answers.append(packet)
        self._repeat_us = now_us + REPEAT_US
        if is_burst and not packet.complete and packet.opcode == ACK:
            return []
        return self._advance(self._answers, now_us)

    def tick(self, now_us: int) -> list[bytes]:
        """Repeat what is not answered; a burst that stays silent is over."""
        if self.done or now_us < self._repeat_us:
            return []
        if self._answers:
            return self._advance(self._answers, now_us)
        self._tries += 1
        assert self._tries < TRIES, "the server does not answer"
        self._repeat_us = now_us + REPEAT_US
        return [self._payload]

    def _advance(self, answers: list[Packet] | None, now_us: int) -> list[bytes]:
        try:
            self._ask = next(self.steps) if answers is None else self.steps.send(answers)
        except StopIteration:
            self.done = True
            return []
        advance = max([(a.seq - self._seq) & 0xFFFF for a in answers or []], default=0)
        self._seq = (self._seq + max(advance, 1)) & 0xFFFF
        ask = self._ask
        packet = Packet(self._seq, ask.session, ask.opcode, 0, 0, ask.offset, ask.data)
        self._payload = packet.pack(ask.size)
        self._answers, self._tries = [], 0
        self._repeat_us = now_us + REPEAT_US
        return [self._payload]


def expect(answers: list[Packet]) -> Packet:
    """The one answer, which must be a yes."""
    answer = answers[-1]
    if answer.opcode != ACK:
        raise RefusedError(answer.data)
    return answer


def upload(path: str, contents: bytes) -> Steps:
    """Put a file, block by block."""
    session = expect((yield Ask(CREATE, path.encode()))).session
    for offset in range(0, len(contents), DATA_MAX):
        chunk = contents[offset : offset + DATA_MAX]
        expect((yield Ask(WRITE, chunk, session, offset)))
    expect((yield Ask(TERMINATE, session=session)))


def download(path: str, into: bytearray) -> Steps:
    """Get a file by bursts; gaps are read after."""
    opened = expect((yield Ask(OPEN, path.encode())))
    (size,) = struct.unpack("<I", opened.data)
    session, missing = opened.session, set(range(0, size, DATA_MAX))
    into.extend(bytes(size))
    position = 0
    while position < size:
        answers = yield Ask(BURST, session=session, offset=position, size=DATA_MAX)
        for answer in answers:
            expect([answer])
            into[answer.offset : answer.offset + len(answer.data)] = answer.data
            missing.discard(answer.offset)
            position = max(position, answer.offset + len(answer.data))
    for offset in sorted(missing):
        answer = expect((yield Ask(READ, session=session, offset=offset, size=DATA_MAX)))
        into[offset : offset + len(answer.data)] = answer.data
    expect((yield Ask(TERMINATE, session=session)))
