"""Several file stores as one tree: each is mounted at a place.

A folder above a mount, which no store has, is there and cannot be changed. Where a mount lies
within another store, it hides what that store has under its name.
"""

import errno
from collections.abc import Mapping, Sequence

from uav_firmware.cal.files import Entry, FileStore, OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.files.generated import refusal


class MountedTree:
    """Implements `uav_firmware.cal.files.FileStore` over the stores that are mounted."""

    def __init__(self, mounts: Mapping[Place, FileStore]) -> None:
        """Take the stores by place."""
        self._mounts = mounts

    def entries(self, place: Place) -> Sequence[Entry]:
        """What a folder holds, the mounts in it included."""
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
        store, rest = self._inner(place)
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
        store, rest = self._find(place)
        store.make_folder(rest)

    def remove_folder(self, place: Place) -> None:
        """Remove an empty folder."""
        store, rest = self._inner(place)
        store.remove_folder(rest)

    def rename(self, place: Place, new_place: Place) -> None:
        """Give a file or folder another name or place in the same store."""
        store, rest = self._inner(place)
        new_store, new_rest = self._inner(new_place)
        if store is not new_store:
            raise refusal(errno.EXDEV)
        store.rename(rest, new_rest)

    def _inner(self, place: Place) -> tuple[FileStore, Place]:
        """Store of something that is no folder of the tree itself."""
        if self._is_above_mount(place) or place in self._mounts:
            raise refusal(errno.EACCES)
        return self._find(place)

    def _find(self, place: Place) -> tuple[FileStore, Place]:
        """The store that a place lies in, and the place within it."""
        for length in range(len(place), -1, -1):
            store = self._mounts.get(place[:length])
            if store is not None:
                return store, place[length:]
        raise refusal(errno.ENOENT)

    def _is_above_mount(self, place: Place) -> bool:
        return any(
            len(mount) > len(place) and mount[: len(place)] == place for mount in self._mounts
        )
