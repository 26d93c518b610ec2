"""Folders of this machine as the vehicle's storage card: peers reach nothing outside them.

Each name is opened relative to the folder before it, without following links, so that neither
`..` nor a link in the tree leads out of it.
"""

import errno
import os
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from uav_firmware.cal.files import Card, Entry, OpenMode, Place
from uav_firmware.drivers.file_room import Room, measure
from uav_firmware.drivers.log_folder import LogFolder

BYTES_MAX: Final = 256 * 1024 * 1024  # 256 MiB
ENTRIES_MAX: Final = 2000

_FOLDER_FLAGS: Final = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_FILE_FLAGS: Final[dict[OpenMode, int]] = {
    OpenMode.READ: os.O_RDONLY,
    OpenMode.CREATE: os.O_RDWR | os.O_CREAT | os.O_TRUNC,
    OpenMode.WRITE: os.O_RDWR | os.O_CREAT,
}
_NO_FOLLOW: Final = os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK


def refusal(code: int) -> OSError:
    """The OSError of an error number, with its sentence."""
    return OSError(code, os.strerror(code))


class FileTree:
    """Implements `uav_firmware.cal.files.FileStore`; makes its folder when it is first used."""

    def __init__(
        self,
        folder: Path,
        *,
        bytes_max: int = BYTES_MAX,
        entries_max: int = ENTRIES_MAX,
        may_write: bool = True,
        is_in_use: Callable[[Path], bool] = lambda _path: False,
    ) -> None:
        """Serve a folder.

        Args:
            folder: The root of the tree.
            bytes_max: Together no file may grow beyond it [bytes].
            entries_max: So many files and folders at most.
            may_write: Whether files may be made and changed; removing is always allowed.
            is_in_use: Whether a file must not be removed now.
        """
        self._folder = folder
        self._may_write = may_write
        self._is_in_use = is_in_use
        self._room = Room(bytes_max, entries_max, lambda: measure(folder))

    @property
    def room(self) -> Room:
        """How much space there is, and how much of it is taken."""
        return self._room

    def entries(self, place: Place) -> Sequence[Entry]:
        """What a folder holds, sorted by name."""
        with self._folder_of((*place, "")) as (folder, _), os.scandir(folder) as found:
            return sorted(filter(None, map(_entry, found)))

    def open(self, place: Place, mode: OpenMode) -> "TreeFile":
        """Open a file."""
        if mode is not OpenMode.READ:
            self._demand_writable()
        with self._folder_of(place) as (folder, name):
            before = _size_of(name, folder)
            if before is None and mode is not OpenMode.READ:
                self._room.demand(entries=1)
            descriptor = _open_plain(name, _FILE_FLAGS[mode], folder)
        if mode is not OpenMode.READ and before is None:
            self._room.take(entries=1)
        elif mode is OpenMode.CREATE:
            self._room.take(-(before or 0))
        return TreeFile(descriptor, None if mode is OpenMode.READ else self._room)

    def truncate(self, place: Place, size: int) -> None:
        """Make a file `size` bytes long."""
        self._demand_writable()
        with self._folder_of(place) as (folder, name):
            file = TreeFile(_open_plain(name, os.O_RDWR, folder), self._room)
        try:
            file.resize(size)
        finally:
            file.close()

    def remove(self, place: Place) -> None:
        """Remove a file."""
        self._demand_unused(place)
        with self._folder_of(place) as (folder, name):
            size = _size_of(name, folder) or 0
            os.unlink(name, dir_fd=folder)
        self._room.take(-size, -1)

    def make_folder(self, place: Place) -> None:
        """Make a folder in one that is there."""
        self._demand_writable()
        with self._folder_of(place) as (folder, name):
            if _size_of(name, folder) is not None:
                raise refusal(errno.EEXIST)
            self._room.demand(entries=1)
            os.mkdir(name, dir_fd=folder)
        self._room.take(entries=1)

    def remove_folder(self, place: Place) -> None:
        """Remove an empty folder."""
        with self._folder_of(place) as (folder, name):
            os.rmdir(name, dir_fd=folder)
        self._room.take(entries=-1)

    def rename(self, place: Place, new_place: Place) -> None:
        """Give a file or folder another name or place."""
        self._demand_writable()
        self._demand_unused(place)
        with (
            self._folder_of(place) as (folder, name),
            self._folder_of(new_place) as (new_folder, new_name),
        ):
            if _size_of(name, folder) is None:
                raise refusal(errno.ENOENT)
            if _size_of(new_name, new_folder) is not None and place != new_place:
                raise refusal(errno.EEXIST)
            os.rename(name, new_name, src_dir_fd=folder, dst_dir_fd=new_folder)

    def _demand_writable(self) -> None:
        if not self._may_write:
            raise refusal(errno.EROFS)

    def _demand_unused(self, place: Place) -> None:
        if self._is_in_use(self._folder.joinpath(*place)):
            raise refusal(errno.EACCES)

    @contextmanager
    def _folder_of(self, place: Place) -> Iterator[tuple[int, str]]:
        """Open the folder that holds a place's last name; gives it and that name."""
        if not place:
            raise refusal(errno.EISDIR)
        self._folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self._folder, _FOLDER_FLAGS)
        try:
            for name in place[:-1]:
                following = os.open(name, _FOLDER_FLAGS, dir_fd=descriptor)
                os.close(descriptor)
                descriptor = following
            yield descriptor, place[-1]
        finally:
            os.close(descriptor)


class TreeFile:
    """Implements `uav_firmware.cal.files.OpenFile`; writes count against the tree's room."""

    def __init__(self, descriptor: int, room: Room | None) -> None:
        self._descriptor = descriptor
        self._room = room
        self._closed = False

    @property
    def size(self) -> int:
        """Present length [bytes]."""
        return os.fstat(self._descriptor).st_size

    def read(self, offset: int, count: int) -> bytes:
        """At most `count` bytes from `offset`."""
        return os.pread(self._descriptor, count, offset)

    def write(self, offset: int, chunk: bytes) -> None:
        """Write all of `chunk` at `offset`; what lies between is zero."""
        room = self._writable()
        growth = offset + len(chunk) - self.size if chunk else 0
        if growth > 0:
            room.demand(growth)
        rest = memoryview(chunk)
        while rest:
            done = os.pwrite(self._descriptor, rest, offset)
            rest, offset = rest[done:], offset + done
        room.take(max(growth, 0))

    def resize(self, size: int) -> None:
        """Make the file `size` bytes long."""
        room = self._writable()
        growth = size - self.size
        if growth > 0:
            room.demand(growth)
        os.ftruncate(self._descriptor, size)
        room.take(growth)

    def close(self) -> None:
        """Close the file."""
        if not self._closed:
            self._closed = True
            os.close(self._descriptor)

    def abandon(self) -> None:
        """Close the file; what was written stays."""
        self.close()

    def _writable(self) -> Room:
        if self._room is None:
            raise refusal(errno.EACCES)
        return self._room


def _open_plain(name: str, flags: int, folder: int) -> int:
    """Open a plain file; a link, a device or a pipe is refused without being touched."""
    descriptor = os.open(name, flags | _NO_FOLLOW, 0o644, dir_fd=folder)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return descriptor
    os.close(descriptor)
    raise refusal(errno.EISDIR if stat.S_ISDIR(mode) else errno.EACCES)


def _size_of(name: str, folder: int) -> int | None:
    """Size [bytes] of what has a name, None where nothing has."""
    try:
        return os.stat(name, dir_fd=folder, follow_symlinks=False).st_size
    except FileNotFoundError:
        return None


def _entry(found: "os.DirEntry[str]") -> Entry | None:
    """An entry of a folder; None for one that has just gone."""
    try:
        status = found.stat(follow_symlinks=False)
    except FileNotFoundError:
        return None
    is_folder = stat.S_ISDIR(status.st_mode)
    is_file = stat.S_ISREG(status.st_mode)
    return Entry(
        found.name,
        is_folder,
        status.st_size if is_file else 0,
        int(status.st_mtime),
        is_plain=is_folder or is_file,
    )


FILES_FOLDER: Final = "files"
IMAGE_FOLDER: Final = "image"


def image_folder(folder: Path) -> Path:
    """The folder in which a vehicle's camera stores its pictures."""
    return folder / IMAGE_FOLDER


def image_tree(folder: Path) -> FileTree:
    """The pictures of a vehicle, to read and to remove."""
    return FileTree(image_folder(folder), may_write=False)


def storage_card(folder: Path, logs: LogFolder, images: FileTree) -> Card:
    """The card in a vehicle's folder; a log that is being written cannot be removed."""
    return Card(
        files=FileTree(folder / FILES_FOLDER),
        logs=FileTree(logs.folder, may_write=False, is_in_use=logs.is_being_written),
        images=images,
    )
