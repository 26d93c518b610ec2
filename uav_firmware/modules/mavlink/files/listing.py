r"""ListDirectory: one page of entries, from an index on.

An entry is `F<name>\t<size>`, `D<name>` or `S` (skip: counted, not shown); with times every one
but `S` is `<kind><name>\t<size>\t<seconds since 1970>`. Entries are separated by NUL.
"""

from collections.abc import Sequence

from uav_firmware.cal.files import Entry
from uav_firmware.modules.mavlink.files.codec import DATA_MAX, Fault, FileError

_SKIP = b"S\x00"


def page(entries: Sequence[Entry], first: int, *, with_time: bool) -> bytes:
    """As many entries as fit into one reply.

    Raises:
        FileError: END_OF_FILE, if there is no entry of that index.
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
    """One entry with its NUL; one that cannot be told is skipped, so that the count stays."""
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
