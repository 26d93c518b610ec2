"""STATUSTEXT: texts for the operator, split into chunks.

A text of more than 50 bytes is sent in chunks with a common id and a sequence number; the last
chunk is shorter than 50 bytes, which marks the end (MAVLink common.xml, STATUSTEXT).
"""

from typing import Final

from uav_firmware.modules.mavlink.wire.addressing import Outgoing
from uav_firmware.modules.mavlink.wire.dialect import mavlink

CHUNK_BYTES: Final = 50
MAX_CHUNKS: Final = 8
_CUT: Final = b"..."


class StatusTexts:
    """Encodes texts as STATUSTEXTs to every peer; assigns ids to long ones."""

    def __init__(self) -> None:
        self._last_id = 0

    def encode(self, severity: int, text: str) -> list[Outgoing]:
        """Return the messages of one text; `severity` is a MAV_SEVERITY."""
        encoded = text.encode("ascii", errors="replace").replace(b"\x00", b" ")
        if len(encoded) <= CHUNK_BYTES:
            return [_chunk(severity, encoded, 0, 0)]
        if len(encoded) >= MAX_CHUNKS * CHUNK_BYTES:
            encoded = encoded[: MAX_CHUNKS * CHUNK_BYTES - 1 - len(_CUT)] + _CUT
        self._last_id = self._last_id % 0xFFFF + 1
        starts = range(0, len(encoded) + 1, CHUNK_BYTES)
        return [
            _chunk(severity, encoded[start : start + CHUNK_BYTES], self._last_id, i)
            for i, start in enumerate(starts)
        ]


def _chunk(severity: int, text: bytes, identifier: int, sequence: int) -> Outgoing:
    return Outgoing(
        mavlink.MAVLink_statustext_message(
            severity=severity, text=text, id=identifier, chunk_seq=sequence
        )
    )
