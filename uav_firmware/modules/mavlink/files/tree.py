"""Mounts several file stores in one tree, and read-only generated files.

A folder above a mount exists and is read-only. A mount within another store hides that store's
entry of the same name.
"""

import errno
import os
from collections.abc import Mapping, Sequence

from uav_firmware.cal.files import Entry, FileStore, OpenFile, OpenMode, Place


class MountedTree:
    """Implements `uav_firmware.cal.files.FileStore` over the stores that are mounted."""

    def __init__(self, mounts: Mapping[Place, FileStore]) -> None:
        """`mounts` are the stores by place."""
        self._mounts = mounts

    def entries(self, place: Place) -> Sequence[Entry]:
        """Entries of a folder, including mounts."""
        mounted = {
            mount[len(place)]
            for mount in self._mounts
            if len(mount) > len(place) and mount[: len(place)] == place
        }
        found = {name: Entry(name, is_folder=True, size=0, modified_s=0) for name in mounted}
        try:
            store, rest = self._find(place)
            own = store.entries(rest)
        except FileNotFoundError:
            if not mounted:
                raise
            own = ()
        return sorted([*found.values(), *(entry for entry in own if entry.name not in found)])

    def open(self, place: Place, mode: OpenMode) -> OpenFile:
        """Open a file."""
        find = self._inner if mode is OpenMode.READ else self._inner_for_new
        store, rest = find(place)
        return store.open(rest, mode)

    def truncate(self, place: Place, size: int) -> None:
        """Make a file `size` bytes long."""
        store, rest = self._inner(place)
        store.truncate(rest, size)

    def remove(self, place: Place) -> None:
        """Remove a file."""
        store, rest = self._inner(place)
        store.remove(rest)

    def make_folder(self, place: Place) -> None:
        """Make a folder."""
        if self._is_above_mount(place) or place in self._mounts:
            raise refusal(errno.EEXIST)
        store, rest = self._inner_for_new(place)
        store.make_folder(rest)

    def remove_folder(self, place: Place) -> None:
        """Remove an empty folder."""
        store, rest = self._inner(place)
        store.remove_folder(rest)

    def rename(self, place: Place, new_place: Place) -> None:
        """Rename or move a file or folder within a store."""
        store, rest = self._inner(place)
        new_store, new_rest = self._inner_for_new(new_place)
        if store is not new_store:
            raise refusal(errno.EXDEV)
        store.rename(rest, new_rest)

    def _inner(self, place: Place) -> tuple[FileStore, Place]:
        """The store of a place that is not a folder of the tree itself."""
        if self._is_above_mount(place) or place in self._mounts:
            raise refusal(errno.EACCES)
        return self._find(place)

    def _inner_for_new(self, place: Place) -> tuple[FileStore, Place]:
        """The store that a place is made in; folders of the tree itself are read-only."""
        try:
            return self._inner(place)
        except FileNotFoundError:
            if self._is_above_mount(place[:-1]):
                raise refusal(errno.EACCES) from None
            raise

    def _find(self, place: Place) -> tuple[FileStore, Place]:
        """The store of a place, and the place within it."""
        for length in range(len(place), -1, -1):
            store = self._mounts.get(place[:length])
            if store is not None:
                return store, place[length:]
        raise refusal(errno.ENOENT)

    def _is_above_mount(self, place: Place) -> bool:
        return any(
            len(mount) > len(place) and mount[: len(place)] == place for mount in self._mounts
        )


def refusal(code: int) -> OSError:
    """Return the OSError of an error number."""
    return OSError(code, os.strerror(code))


class ReadOnlyStore:
    """Base of read-only stores: refuses every change of `uav_firmware.cal.files.FileStore`."""

    def truncate(self, place: Place, size: int) -> None:
        """Refused."""
        del place, size
        raise refusal(errno.EACCES)

    def remove(self, place: Place) -> None:
        """Refused."""
        del place
        raise refusal(errno.EACCES)

    def make_folder(self, place: Place) -> None:
        """Refused."""
        del place
        raise refusal(errno.EACCES)

    def remove_folder(self, place: Place) -> None:
        """Refused."""
        del place
        raise refusal(errno.EACCES)

    def rename(self, place: Place, new_place: Place) -> None:
        """Refused."""
        del place, new_place
        raise refusal(errno.EACCES)


class GeneratedFile:
    """Implements `uav_firmware.cal.files.OpenFile` on constant bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return len(self._data)

    def read(self, offset: int, count: int) -> bytes:
        """At most `count` bytes from `offset`."""
        return self._data[offset : offset + count]

    def write(self, offset: int, chunk: bytes) -> None:
        """Refused."""
        del offset, chunk
        raise refusal(errno.EACCES)

    def close(self) -> None:
        """Nothing to release."""

    def abandon(self) -> None:
        """Nothing to release."""
