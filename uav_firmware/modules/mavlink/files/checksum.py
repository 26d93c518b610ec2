"""The checksum of a file, piece by piece, so that a long one does not hold the control loop up.

CRC32 with the polynomial of IEEE 802.3, begun at zero and not inverted at the end, as PX4,
MAVSDK and pymavlink compute it.
"""

import zlib
from typing import Final

from uav_firmware.cal.files import OpenFile

PIECE_BYTES: Final = 256 * 1024
_ALL_ONES: Final = 0xFFFFFFFF


def checksum_of(data: bytes) -> int:
    """Checksum of bytes that are at hand."""
    return zlib.crc32(data, _ALL_ONES) ^ _ALL_ONES


class Checksum:
    """A checksum that is being computed."""

    def __init__(self, file: OpenFile) -> None:
        """Take an open file, and close it in the end."""
        self._file = file
        self._offset = 0
        self._state = _ALL_ONES  # zlib inverts at both ends; starting inverted undoes the first

    def advance(self) -> int | None:
        """Read the next piece; gives the checksum at the end of the file.

        Raises:
            OSError: if the medium refuses.
        """
        piece = self._file.read(self._offset, PIECE_BYTES)
        self._offset += len(piece)
        self._state = zlib.crc32(piece, self._state)
        if len(piece) == PIECE_BYTES:
            return None
        self._file.close()
        return self._state ^ _ALL_ONES

    def stop(self) -> None:
        """Give up."""
        self._file.abandon()
