"""Files out of an untrusted zip archive: never more of them, nor larger, than they may be. Pure."""

import io
import struct
import zipfile
import zlib
from typing import Final

from afarcloud.faults import Fault, InvalidError

MOST_MEMBERS: Final = 200
_OF_MACOS: Final = "__MACOSX/"
"""Folder with attributes of the other files, which bear their names."""
_SIGNATURE: Final = b"PK\x03\x04"
_BROKEN: Final = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
)
"""What the library raises over broken archives: the last three also for what it cannot do."""
_KNOWN_PACKING: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def is_zip(raw: bytes) -> bool:
    """Whether bytes begin as such an archive does."""
    return raw.startswith(_SIGNATURE)


class Archive:
    """An archive in memory; `kind` names it in messages, as in "is no whole KMZ".

    Raises:
        InvalidError: from each method, if the archive is broken or holds too much.
    """

    def __init__(self, raw: bytes, kind: str) -> None:
        self._raw = raw
        self._kind = kind
        try:
            with zipfile.ZipFile(io.BytesIO(raw)) as archive:
                members = archive.infolist()
        except _BROKEN as error:
            raise self._refusal(f"is no whole {kind}: {error}") from None
        if len(members) > MOST_MEMBERS:
            raise self._refusal(f"holds more than {MOST_MEMBERS} files")
        self._members = {
            one.filename: one
            for one in members
            if not (one.is_dir() or one.filename.startswith(_OF_MACOS))
        }

    def names(self, suffix: str) -> list[str]:
        """List the files whose names end so, whatever their case."""
        return [name for name in self._members if name.lower().endswith(suffix)]

    def read(self, name: str, largest_bytes: int, path: str = "") -> bytes:
        """Unpack a file, whatever size the archive states; `path` names it in a fault."""
        member = self._members[name]
        if member.flag_bits & 1 or member.compress_type not in _KNOWN_PACKING:
            text = f"is a {self._kind} that is encrypted, or packed in an unusual way"
            raise self._refusal(text, path)
        try:
            with (
                zipfile.ZipFile(io.BytesIO(self._raw)) as archive,
                archive.open(member) as file,
            ):
                content = file.read(largest_bytes + 1)
        except _BROKEN as error:
            raise self._refusal(f"is no whole {self._kind}: {error}", path) from None
        if len(content) > largest_bytes:
            raise self._refusal(f"unpacks to more than {largest_bytes} bytes", path)
        return content

    @staticmethod
    def _refusal(message: str, path: str = "") -> InvalidError:
        return InvalidError((Fault(path, message),))
