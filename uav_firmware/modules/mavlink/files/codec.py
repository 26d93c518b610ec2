"""Codec of FILE_TRANSFER_PROTOCOL: requests, replies, paths and directory listings.

A payload has a header of 12 bytes and up to 239 bytes of data. Layout and numbers: MAVLink file
transfer protocol, "Payload format", "OpCodes", "Error codes".
"""

import errno
import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from uav_firmware.cal.files import Entry, Place

DATA_MAX: Final = 239
PAYLOAD_BYTES: Final = 251
HEADER: Final = struct.Struct("<HBBBBBBI")
_FIRST_PRINTABLE: Final = " "
_DELETE: Final = "\x7f"
_SKIP = b"S\x00"


class Opcode(IntEnum):
    """Request opcodes, and the two reply opcodes."""

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
    """Error code: the first byte of a NAK."""

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
    """A refused request, which is answered with a NAK.

    FileError
      +- PlaceError    the path is not allowed
    """

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.name)
        self.fault = fault


class Request(NamedTuple):
    """A request."""

    seq: int
    session: int
    opcode: int
    size: int  # As sent, may exceed the data
    offset: int
    data: bytes  # `size` bytes, at most 239


class Reply(NamedTuple):
    """A reply."""

    seq: int
    session: int
    opcode: Opcode
    request_opcode: int
    offset: int
    data: bytes = b""
    burst_complete: bool = False

    def pack(self) -> bytes:
        """Encode the payload, padded with zeros."""
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
    """Decode a payload of 251 bytes."""
    seq, session, opcode, size, _, _, _, offset = HEADER.unpack_from(payload)
    data = payload[HEADER.size : HEADER.size + min(size, DATA_MAX)]
    return Request(seq, session, opcode, size, offset, data)


def acknowledge(
    request: Request, data: bytes = b"", *, session: int | None = None, complete: bool = False
) -> Reply:
    """ACK of a request; it has the same offset, by which clients match their writes."""
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
    """NAK with the error of the storage."""
    fault = _FAULTS.get(error.errno or 0)
    if fault is not None:
        return refuse(request, fault)
    if error.errno is None:
        return refuse(request, Fault.FAIL)
    return refuse(request, Fault.FAIL_ERRNO, error.errno)


class PlaceError(FileError):
    """A path with `..`, a control character, or invalid UTF-8."""

    def __init__(self) -> None:
        super().__init__(Fault.FILE_PROTECTED)


def read_place(data: bytes) -> Place:
    """Decode a path up to the first NUL.

    `/fs/microsd/log`, `fs/microsd/log/` and `fs//microsd/./log` are the same place, and so are
    `@PARAM/param.pck` and `/@PARAM/param.pck`. A path with `..` is refused.

    Raises:
        PlaceError: if it is not allowed.
    """
    try:
        text = data.split(b"\x00", 1)[0].decode()
    except UnicodeDecodeError:
        raise PlaceError from None
    if any(letter < _FIRST_PRINTABLE or letter == _DELETE for letter in text):
        raise PlaceError
    names = tuple(name for name in text.split("/") if name not in {"", "."})
    if ".." in names:
        raise PlaceError
    return names


def read_two_places(data: bytes) -> tuple[Place, Place]:
    """Decode the two paths of a rename, separated by NUL.

    Raises:
        FileError: if the second is missing.
        PlaceError: if one of them is not allowed.
    """
    first, _, second = data.partition(b"\x00")
    places = read_place(first), read_place(second)
    if not all(places):
        raise FileError(Fault.INVALID_DATA_SIZE)
    return places


def page(entries: Sequence[Entry], first: int, *, with_time: bool) -> bytes:
    r"""Encode as many entries as fit into one reply of ListDirectory, from index `first`.

    An entry is `F<name>\t<size>`, `D<name>` or `S` (skip: counted, not shown); with times every one
    but `S` is `<kind><name>\t<size>\t<seconds since 1970>`. Entries are separated by NUL.

    Raises:
        FileError: END_OF_FILE, if there is no entry with that index.
    """
    if first >= len(entries):
        raise FileError(Fault.END_OF_FILE)
    data = b""
    for entry in entries[first:]:
        line = _line(entry, with_time=with_time)
        if len(data) + len(line) > DATA_MAX:
            break
        data += line
    return data


def _line(entry: Entry, *, with_time: bool) -> bytes:
    """Encode one entry with its NUL; an invalid name becomes `S`, which keeps the count."""
    try:
        name = entry.name.encode()
    except UnicodeEncodeError:
        return _SKIP
    if not entry.is_plain or any(byte < ord(" ") for byte in name):
        return _SKIP
    line = (b"D" if entry.is_folder else b"F") + name
    if with_time:
        line += b"\t%d\t%d" % (entry.size, entry.modified_s)
    elif not entry.is_folder:
        line += b"\t%d" % entry.size
    return line + b"\x00" if len(line) < DATA_MAX else _SKIP
