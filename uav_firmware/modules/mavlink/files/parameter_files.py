"""`@PARAM/param.pck`: all parameters as one file, readable and writable.

The name may have a query: `?withdefaults=1`, `?start=10&count=20`. A read returns the values at the
time of opening, as PARAM_VALUE has them. A write takes effect when the file is closed: all values
are set, or none if one is invalid.
"""

import errno
from collections.abc import Callable, Sequence
from typing import Final
from urllib.parse import parse_qsl

from uav_firmware.cal.files import Entry, OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.files.parameter_pack import (
    PackedParameter,
    PackError,
    read_pack,
    write_pack,
)
from uav_firmware.modules.mavlink.files.tree import GeneratedFile, ReadOnlyStore, refusal
from uav_firmware.parameters import ParameterError, Registry

FILE_NAME: Final = "param.pck"
UPLOAD_BYTES_MAX: Final = 64 * 1024
"""No parameter takes more than 26 bytes."""
_QUERY_KEYS: Final = frozenset({"withdefaults", "start", "count"})


class ParameterFiles(ReadOnlyStore):
    """Implements `uav_firmware.cal.files.FileStore` with one file in it."""

    def __init__(
        self,
        registry: Registry,
        *,
        applied: Callable[[Sequence[str]], None],
        refused: Callable[[str], None],
    ) -> None:
        """Serve the parameters of a registry.

        Args:
            registry: The parameters.
            applied: Called with the names that an upload has set.
            refused: Called with a text when an upload is refused.
        """
        self._registry = registry
        self._applied = applied
        self._refused = refused

    def entries(self, place: Place) -> Sequence[Entry]:
        """The only file."""
        if place:
            raise refusal(errno.ENOENT)
        size = len(self._pack({}))
        return (Entry(FILE_NAME, is_folder=False, size=size, modified_s=0),)

    def open(self, place: Place, mode: OpenMode) -> OpenFile:
        """Open the file."""
        query = self._query(place, mode)
        if mode is OpenMode.READ:
            return GeneratedFile(self._pack(query))
        return ParameterUpload(self._apply)

    def _query(self, place: Place, mode: OpenMode) -> dict[str, int]:
        """Query of a file name: numbers by key."""
        name, _, text = "/".join(place).partition("?")
        if name != FILE_NAME:
            is_new = mode is not OpenMode.READ and len(place) == 1
            raise refusal(errno.EACCES if is_new else errno.ENOENT)
        try:
            query = {key: int(value) for key, value in parse_qsl(text, keep_blank_values=True)}
        except ValueError:
            raise refusal(errno.EINVAL) from None
        if not query.keys() <= _QUERY_KEYS or any(value < 0 for value in query.values()):
            raise refusal(errno.EINVAL)
        return query

    def _pack(self, query: dict[str, int]) -> bytes:
        names = self._registry.names()
        start = query.get("start", 0)
        selected = names[start : start + (query.get("count", 0) or len(names))]
        return write_pack(
            [self._packed(name) for name in selected],
            total=len(names),
            with_defaults=query.get("withdefaults", 0) != 0,
        )

    def _packed(self, name: str) -> PackedParameter:
        declaration = self._registry.declaration(name)
        return PackedParameter(
            name, self._registry.get(name), declaration.default, declaration.is_integer
        )

    def _apply(self, data: bytes) -> None:
        """Set all values of an upload, or none.

        Raises:
            OSError: EINVAL, if one of them is invalid.
        """
        before: dict[str, float] = {}
        try:
            for name, value in read_pack(data):
                before.setdefault(name, self._registry.get(name))
                self._registry.set(name, value)
        except (PackError, ParameterError) as error:
            for name, value in before.items():
                self._registry.set(name, value)
            self._refused(f"Parameter file refused: {error}")
            raise refusal(errno.EINVAL) from None
        self._applied(list(before))


class ParameterUpload:
    """Implements `uav_firmware.cal.files.OpenFile`; the contents take effect on close."""

    def __init__(self, apply: Callable[[bytes], None]) -> None:
        self._apply: Callable[[bytes], None] | None = apply
        self._data = bytearray()

    @property
    def size(self) -> int:
        """Length written so far [bytes]."""
        return len(self._data)

    def read(self, offset: int, count: int) -> bytes:
        """At most `count` of the written bytes."""
        return bytes(self._data[offset : offset + count])

    def write(self, offset: int, chunk: bytes) -> None:
        """Write a chunk; chunks may come in any order."""
        end = offset + len(chunk)
        if end > UPLOAD_BYTES_MAX:
            raise refusal(errno.EFBIG)
        if end > len(self._data):
            self._data.extend(bytes(end - len(self._data)))
        self._data[offset:end] = chunk

    def close(self) -> None:
        """Apply the contents; an empty file has no effect."""
        apply, self._apply = self._apply, None
        if apply is not None and self._data:
            apply(bytes(self._data))

    def abandon(self) -> None:
        """Discard the contents."""
        self._apply = None
