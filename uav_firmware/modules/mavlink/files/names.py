"""Paths as clients write them, to places of a file store.

`/fs/microsd/log`, `fs/microsd/log/` and `fs//microsd/./log` are the same place, and so are
`@PARAM/param.pck` and `/@PARAM/param.pck`. The way up (`..`) is refused, wherever it leads.
"""

from typing import Final

from uav_firmware.cal.files import Place
from uav_firmware.modules.mavlink.files.codec import Fault, FileError

_FIRST_PRINTABLE: Final = " "
_DELETE: Final = "\x7f"


class PlaceError(FileError):
    """A path with `..`, a control character, or bytes that are no UTF-8."""

    def __init__(self) -> None:
        super().__init__(Fault.FILE_PROTECTED)


def read_place(data: bytes) -> Place:
    """Read a path; what follows a NUL is no part of it.

    Raises:
        PlaceError: if it is none that can be served.
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
    """Read the two paths of a rename, with a NUL in between.

    Raises:
        FileError: if the second is missing.
        PlaceError: if either is none that can be served.
    """
    first, _, second = data.partition(b"\x00")
    places = read_place(first), read_place(second)
    if not all(places):
        raise FileError(Fault.INVALID_DATA_SIZE)
    return places
