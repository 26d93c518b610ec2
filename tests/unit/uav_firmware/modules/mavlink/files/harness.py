"""A file server over a folder, and a client that sends one request at a time."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from uav_firmware.cal.files import Card
from uav_firmware.drivers.file_tree import FileTree
from uav_firmware.modules.mavlink.files.codec import Opcode
from uav_firmware.modules.mavlink.files.metadata_files import MetadataFiles
from uav_firmware.modules.mavlink.files.parameter_files import ParameterFiles
from uav_firmware.modules.mavlink.files.server import FileServer
from uav_firmware.modules.mavlink.files.service import vehicle_tree
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink, pack
from uav_firmware.modules.mavlink.wire.token_bucket import TokenBucket
from uav_firmware.parameters import Registry

SYSTEM: Final = 7
ALICE: Final = Sender(255, 190, ("192.0.2.2", 14550))
BOB: Final = Sender(254, 191, ("192.0.2.3", 14540))
TWIN: Final = Sender(255, 190, ("192.0.2.4", 14550))
"""Has the ids of ALICE, as two ground stations have that were not given their own."""
TICK_US: Final = 20_000
_HEADER: Final = struct.Struct("<HBBBBBBI")


class Answer(NamedTuple):
    """A reply, decoded without the firmware's codec."""

    seq: int
    session: int
    opcode: int
    request_opcode: int
    burst_complete: int
    offset: int
    data: bytes

    @property
    def acknowledged(self) -> bool:
        return self.opcode == 128

    @property
    def fault(self) -> int:
        assert self.opcode == 129
        return self.data[0]


def read_answer(outgoing: Outgoing) -> Answer:
    payload = pack(outgoing.message).body[3:].ljust(251, b"\x00")
    seq, session, opcode, size, requested, complete, _, offset = _HEADER.unpack_from(payload)
    return Answer(seq, session, opcode, requested, complete, offset, payload[12 : 12 + size])


class FileHarness:
    """Client of a file server; time advances only in `tick`."""

    def __init__(
        self,
        folder: Path,
        *,
        registry: Registry | None = None,
        bytes_max: int = 1_000_000_000,
        entries_max: int = 1000,
    ) -> None:
        self.files = folder / "files"
        self.logs = folder / "log"
        self.images = folder / "image"
        for place in (self.files, self.logs, self.images):
            place.mkdir(parents=True, exist_ok=True)
        self.busy: set[Path] = set()
        self.taken: list[str] = []
        self.status_texts: list[str] = []
        stores = Card(
            files=FileTree(self.files, bytes_max=bytes_max, entries_max=entries_max),
            logs=FileTree(self.logs, may_write=False, is_in_use=self.busy.__contains__),
            images=FileTree(self.images, may_write=False),
        )
        parameters = ParameterFiles(
            registry or Registry(), applied=self.taken.extend, refused=self.status_texts.append
        )
        self.server = FileServer(
            system_id=SYSTEM,
            store=vehicle_tree(stores, parameters, MetadataFiles(registry or Registry())),
            bucket=TokenBucket(),
        )
        self.now_us = 0
        self.seq = 100
        self.received: dict[Sender, list[Answer]] = {}

    def send(
        self,
        opcode: int,
        data: bytes | str = b"",
        *,
        session: int = 0,
        offset: int = 0,
        size: int | None = None,
        seq: int | None = None,
        sender: Sender = ALICE,
        target: tuple[int, int] = (SYSTEM, 1),
    ) -> list[Answer]:
        """Send a request; return the immediate replies."""
        raw = data.encode() if isinstance(data, str) else data
        if seq is None:
            self.seq += 1
            seq = self.seq
        length = len(raw) if size is None else size
        payload = _HEADER.pack(seq & 0xFFFF, session, opcode, length, 0, 0, 0, offset) + raw
        message = mavlink.MAVLink_file_transfer_protocol_message(
            0, *target, payload.ljust(251, b"\x00")
        )
        return self._read(self.server.handle(message, sender, self.now_us), sender)

    def request(
        self, opcode: int, data: bytes | str = b"", **options: int | Sender | None
    ) -> Answer:
        """Send a request that gets one reply."""
        (answer,) = self.send(opcode, data, **options)  # type: ignore[arg-type]
        return answer

    def tick(self, seconds: float = 0.02, sender: Sender = ALICE) -> list[Answer]:
        """Advance time; return the replies."""
        answers = []
        for _ in range(round(seconds * 1e6 / TICK_US)):
            self.now_us += TICK_US
            answers += self._read(self.server.tick(self.now_us), sender)
        return answers

    def open(self, path: str, opcode: int = Opcode.OPEN_FILE_RO, session: int = 0) -> int:
        """Open a file; return the session."""
        answer = self.request(opcode, path, session=session)
        assert answer.acknowledged, answer
        return answer.session

    def upload(self, path: str, contents: bytes) -> Answer:
        """Upload a file; return the answer to the end of the session."""
        session = self.open(path, Opcode.CREATE_FILE)
        for start in range(0, len(contents), 239):
            chunk = contents[start : start + 239]
            answer = self.request(Opcode.WRITE_FILE, chunk, session=session, offset=start)
            assert answer.acknowledged, answer
            self.tick()
        return self.request(Opcode.TERMINATE_SESSION, session=session)

    def download(self, path: str) -> bytes:
        """Download a file in pieces."""
        opened = self.request(Opcode.OPEN_FILE_RO, path)
        assert opened.acknowledged, opened
        contents = b""
        while (
            piece := self.request(
                Opcode.READ_FILE, session=opened.session, offset=len(contents), size=239
            )
        ).acknowledged:
            contents += piece.data
            self.tick()
        assert piece.fault == 6
        assert struct.unpack("<I", opened.data) == (len(contents),)
        assert self.request(Opcode.TERMINATE_SESSION, session=opened.session).acknowledged
        return contents

    def names(self, path: str) -> list[str]:
        """Entries of a folder, over all pages."""
        reported: list[str] = []
        while (
            page := self.request(Opcode.LIST_DIRECTORY, path, offset=len(reported))
        ).acknowledged:
            reported += page.data.decode().split("\x00")[:-1]
            self.tick()
        assert page.fault == 6
        return reported

    def _read(self, outgoing: Sequence[Outgoing], sender: Sender) -> list[Answer]:
        """Sort messages by recipient; return those to the sender."""
        answers: dict[Sender, list[Answer]] = {sender: []}
        for one in outgoing:
            to = next(who for who in (ALICE, BOB, TWIN) if who.address == one.to)
            assert one.message.target_system == to.system
            assert one.message.target_component == to.component
            answers.setdefault(to, []).append(read_answer(one))
        for to, received in answers.items():
            self.received.setdefault(to, []).extend(received)
        return answers[sender]
