"""The payload of FILE_TRANSFER_PROTOCOL: 12 bytes of header and up to 239 of data.

Layout and numbers: MAVLink file transfer protocol, "Payload format", "OpCodes", "Error codes".
"""

import errno
import struct
from enum import IntEnum
from typing import Final, NamedTuple

DATA_MAX: Final = 239
PAYLOAD_BYTES: Final = 251
HEADER: Final = struct.Struct("<HBBBBBBI")


class Opcode(IntEnum):
    """What a client asks for, and the two kinds of reply."""

    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    LIST_DIRECTORY_WITH_TIME = 16
    ACK = 128
    NAK = 129


class Fault(IntEnum):
    """Why a request was refused: the first byte of a NAK."""

    FAIL = 1
    FAIL_ERRNO = 2  # The error number follows
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


_FAULTS: Final = {
    errno.ENOENT: Fault.FILE_NOT_FOUND,
    errno.EEXIST: Fault.FILE_EXISTS,
    errno.EACCES: Fault.FILE_PROTECTED,
    errno.EPERM: Fault.FILE_PROTECTED,
    errno.EROFS: Fault.FILE_PROTECTED,
    errno.ELOOP: Fault.FILE_PROTECTED,
}


class FileError(Exception):
    """A request that is refused; every one is answered by a NAK.

    FileError
      +- PlaceError    the path is none that can be served
    """

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.name)
        self.fault = fault


class Request(NamedTuple):
    """What a client sent."""

    seq: int
    session: int
    opcode: int
    size: int  # As written, also where it is larger than the data can be
    offset: int
    data: bytes  # `size` bytes, or all 239 where `size` is larger


class Reply(NamedTuple):
    """What the client gets."""

    seq: int
    session: int
    opcode: Opcode
    request_opcode: int
    offset: int
    data: bytes = b""
    burst_complete: bool = False

    def pack(self) -> bytes:
        """The payload, filled up with zeros."""
        header = HEADER.pack(
            self.seq,
            self.session,
            self.opcode,
            len(self.data),
            self.request_opcode,
            self.burst_complete,
            0,
            self.offset,
        )
        return (header + self.data).ljust(PAYLOAD_BYTES, b"\x00")


def read_request(payload: bytes) -> Request:
    """Read a payload of 251 bytes."""
    seq, session, opcode, size, _, _, _, offset = HEADER.unpack_from(payload)
    data = payload[HEADER.size : HEADER.size + min(size, DATA_MAX)]
    return Request(seq, session, opcode, size, offset, data)


def acknowledge(
    request: Request, data: bytes = b"", *, session: int | None = None, complete: bool = False
) -> Reply:
    """ACK of a request; it repeats the offset, by which clients tell their writes apart."""
    return Reply(
        (request.seq + 1) & 0xFFFF,
        request.session if session is None else session,
        Opcode.ACK,
        request.opcode,
        request.offset,
        data,
        complete,
    )


def refuse(request: Request, fault: Fault, error_number: int = 0) -> Reply:
    """NAK of a request."""
    data = bytes((fault, error_number & 0xFF)) if fault is Fault.FAIL_ERRNO else bytes((fault,))
    return Reply(
        (request.seq + 1) & 0xFFFF,
        request.session,
        Opcode.NAK,
        request.opcode,
        request.offset,
        data,
    )


def refuse_for(request: Request, error: OSError) -> Reply:
    """NAK that tells what the storage said."""
    fault = _FAULTS.get(error.errno or 0)
    if fault is not None:
        return refuse(request, fault)
    if error.errno is None:
        return refuse(request, Fault.FAIL)
    return refuse(request, Fault.FAIL_ERRNO, error.errno)
