"""A disk that loses what was not synced, tears pages, fills up, is read-only, slow, or dies.

SQLite writes through a VFS (sqlite.org/vfs.html), a table of C functions. While a world runs, the
default VFS is a copy of the machine's own one in which the functions that write, sync, truncate,
delete and sleep are replaced by those of this file. What they write goes to the real file at once,
as every other process sees it in the page cache; the disk notes how to take it back until the file
is synced. A loss of power takes all of it back, then repeats a random part, sector by sector, as a
disk that has written some of it. Reads, locks and shared memory stay the machine's own.

Files that SQLite does not write (keys, lock files, the relay's pipe) are not on this disk. Programs
that ask how large it is, and how much of it is free, always get the same answer.

StillOpenError  a process has left a file open
"""

import _sqlite3
import ctypes
import math
import os
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_int, c_int64, c_void_p
from pathlib import Path
from random import Random
from typing import Any, ClassVar, Final, NamedTuple
from unittest.mock import patch

SECTOR_BYTES: Final = 512
"""What a disk writes as a whole, or not at all."""
BLOCK_BYTES: Final = 4096
BLOCKS: Final = 64 << 30 >> 12
"""How large each disk is; half of it is free."""
_OK: Final = 0
_FULL: Final = 13
_IOERR_WRITE: Final = 778
_IOERR_SYNC: Final = 1034
_IOERR_TRUNCATE: Final = 1546
_IOERR_DELETE: Final = 2570
_CANNOT_OPEN: Final = 14
_JOURNAL_OR_LOG: Final = 0x800 | 0x4000 | 0x80000
"""Flags of `xOpen`: main journal, super-journal, write-ahead log."""

_Close = CFUNCTYPE(c_int, c_void_p)
_Transfer = CFUNCTYPE(c_int, c_void_p, c_void_p, c_int, c_int64)
_Truncate = CFUNCTYPE(c_int, c_void_p, c_int64)
_Sync = CFUNCTYPE(c_int, c_void_p, c_int)
_FileSize = CFUNCTYPE(c_int, c_void_p, POINTER(c_int64))
_Open = CFUNCTYPE(c_int, c_void_p, c_void_p, c_void_p, c_int, POINTER(c_int))
_Delete = CFUNCTYPE(c_int, c_void_p, c_char_p, c_int)
_Sleep = CFUNCTYPE(c_int, c_void_p, c_int)


class StillOpenError(Exception):
    """A process has left a file open."""


class _Methods(Structure):
    """`sqlite3_io_methods`, version 3."""

    _fields_: ClassVar = [
        ("version", c_int),
        ("close", _Close),
        ("read", _Transfer),
        ("write", _Transfer),
        ("truncate", _Truncate),
        ("sync", _Sync),
        ("file_size", _FileSize),
        *((name, c_void_p) for name in ("lock", "unlock", "reserved", "control", "sector")),
        *((name, c_void_p) for name in ("device", "map", "shm_lock", "barrier", "unmap")),
        *((name, c_void_p) for name in ("fetch", "unfetch")),
    ]


class _Vfs(Structure):
    """`sqlite3_vfs`, version 3."""

    _fields_: ClassVar = [
        ("version", c_int),
        ("file_size", c_int),
        ("longest_path", c_int),
        ("next", c_void_p),
        ("name", c_char_p),
        ("data", c_void_p),
        ("open", _Open),
        ("delete", _Delete),
        *((name, c_void_p) for name in ("access", "path", "dl_open", "dl_error", "dl_sym")),
        *((name, c_void_p) for name in ("dl_close", "randomness")),
        ("sleep", _Sleep),
        *((name, c_void_p) for name in ("time", "last_error", "time_int64")),
        *((name, c_void_p) for name in ("set_call", "get_call", "next_call")),
    ]


class _Change(NamedTuple):
    """A change of a file that was not synced: what it wrote where, or to which size it cut."""

    offset: int
    new: bytes | None
    """None: the file was cut off at `offset`."""
    old: bytes
    """What stood there, or was cut off."""
    old_size: int


class Disk:
    """The databases in one folder, which one machine's processes use."""

    def __init__(self, folder: Path, random: Random) -> None:
        """Keep everything; `random` decides what survives a loss of power."""
        self.folder = folder
        self.is_read_only = False
        self.is_full = False
        self.sync_s = 0.0
        """How long a sync takes [s]."""
        self.waited_s = 0.0
        """Sum of the time that its processes have waited for syncs and for locks [s]."""
        self.is_dead = False
        """The machine has no power: nothing is written, nothing answered."""
        self.troubled_s = -math.inf
        """When it last refused or delayed a change [s]; infinite while it does."""
        self._random = random
        self._dies_after: int | None = None  # So many changes
        self._on_death: Callable[[], None] = lambda: None
        self._changes: dict[str, list[_Change]] = {}  # By path: since its last sync
        self._deleted: dict[str, bytes] = {}  # By path: names that may come back
        self._created: set[str] = set()  # Paths whose first sync syncs the folder too

    def die_after(self, changes: int, on_death: Callable[[], None] = lambda: None) -> None:
        """Lose power after so many changes, in the middle of whatever is done then."""
        self._dies_after = changes
        self._on_death = on_death

    def survive(self) -> None:
        """Do not lose power after all."""
        self._dies_after = None

    def lose_power(self) -> None:
        """Write and sync nothing any more; call it before the processes end."""
        self.is_dead = True
        self._dies_after = None

    def restore_power(self) -> int:
        """Give the files what the disk has of them; returns how many changes were lost.

        Call it when every process on this disk has ended.
        """
        lost = sum(self._settle(Path(path), changes) for path, changes in self._changes.items())
        for name, content in self._deleted.items():
            if not Path(name).exists() and self._random.random() < 0.5:
                Path(name).write_bytes(content)
        for path in self.folder.rglob("*-shm"):
            path.unlink()
        for known in (self._changes, self._deleted, self._created):
            known.clear()
        self.is_dead = False
        return lost

    def _settle(self, path: Path, changes: list[_Change]) -> int:
        """Take back the changes of a file, then repeat some; gives how many are lost or torn."""
        if not changes or not path.exists():
            return 0
        kept_share = self._random.choice((0.0, 0.5, 0.9))
        lost = 0
        with path.open("r+b") as file:
            for change in reversed(changes):
                file.seek(change.offset)
                file.write(change.old)
                file.truncate(change.old_size)
            for change in changes:
                if self._random.random() >= kept_share:
                    lost += 1
                elif change.new is None:
                    file.truncate(change.offset)
                else:
                    lost += self._write_sectors(file, change.offset, change.new)
        return lost

    def _write_sectors(self, file: Any, offset: int, data: bytes) -> bool:
        """Write some sectors of a change, mostly all; gives whether one is missing."""
        is_torn = self._random.random() < 0.3
        is_missing = False
        end = offset + len(data)
        start = offset
        while start < end:
            stop = min(end, (start // SECTOR_BYTES + 1) * SECTOR_BYTES)
            if is_torn and self._random.random() < 0.5:
                is_missing = True
            else:
                file.seek(start)
                file.write(data[start - offset : stop - offset])
            start = stop
        return is_missing

    def statistics(self) -> os.statvfs_result:
        """Give how large it is and how much of it is free."""
        free, names = BLOCKS // 2, 1 << 20
        block_bytes = BLOCK_BYTES, BLOCK_BYTES
        return os.statvfs_result((*block_bytes, BLOCKS, free, free, names, names, names, 0, 255))

    # What the VFS asks.

    def refusal(self, code: int) -> int:
        """Give the result code of a change that is not made; 0 if it is made."""
        if self._dies_after is not None:
            self._dies_after -= 1
            if self._dies_after < 0:
                self.lose_power()
                self._on_death()
        return code if self.is_dead or self.is_read_only else _OK

    def note(self, path: str, change: _Change) -> None:
        """Note a change that was made."""
        self._changes.setdefault(path, []).append(change)

    def created(self, path: str) -> None:
        """Note that a file is new: SQLite syncs the folder when it syncs the file first."""
        self._created.add(path)
        self._deleted.pop(path, None)

    def synced(self, path: str) -> None:
        """Note that everything in a file is on the disk."""
        self._changes.pop(path, None)
        self.waited_s += self.sync_s
        if path in self._created:
            self._created.discard(path)
            self._deleted.clear()

    def deleted(self, path: str, content: bytes, *, syncs_folder: bool) -> None:
        """Note that a name was deleted, which a loss of power may undo before the next sync."""
        self._changes.pop(path, None)
        self._created.discard(path)
        self._deleted[path] = content
        if syncs_folder:
            self._deleted.clear()


class _File(NamedTuple):
    """An open file on a disk."""

    disk: Disk
    path: str
    real: Any  # Its `_Methods` of the machine's VFS


class _Layer:
    """The VFS between SQLite and the machine's own; one for all disks of this process."""

    def __init__(self) -> None:
        # Symbols of the library that this Python's sqlite3 uses, whichever that is
        library = ctypes.CDLL(_sqlite3.__file__)
        library.sqlite3_vfs_find.restype = POINTER(_Vfs)
        library.sqlite3_vfs_find.argtypes = [c_char_p]
        library.sqlite3_vfs_register.argtypes = [POINTER(_Vfs), c_int]
        self._library = library
        self._real = library.sqlite3_vfs_find(None)
        self._files: dict[int, _File] = {}  # By address
        self._tables: dict[int, _Methods] = {}  # By address of the table that each replaces
        self._hooks = {
            "close": _Close(self._close),
            "write": _Transfer(self._write),
            "truncate": _Truncate(self._truncate),
            "sync": _Sync(self._sync),
        }
        self.disks: list[Disk] = []
        self._real_statistics = os.statvfs
        self._vfs = _Vfs()
        ctypes.memmove(ctypes.byref(self._vfs), self._real, ctypes.sizeof(_Vfs))
        self._vfs.name = b"simulated"
        self._vfs.open = _Open(self._open)
        self._vfs.delete = _Delete(self._delete)
        self._vfs.sleep = _Sleep(self._sleep)

    def install(self) -> None:
        """Have new connections use it."""
        self._library.sqlite3_vfs_register(ctypes.byref(self._vfs), 1)

    def remove(self) -> None:
        """Have new connections use the machine's own VFS again."""
        self._library.sqlite3_vfs_register(self._real, 1)

    def _disk_of(self, path: str) -> Disk | None:
        path = f"{path}/"  # It may be the folder itself
        return next((one for one in self.disks if path.startswith(f"{one.folder}/")), None)

    def statistics(self, path: Any) -> os.statvfs_result:
        """Take the place of `os.statvfs`, which gives those of the machine that simulates."""
        disk = None if isinstance(path, int) else self._disk_of(os.fspath(path))
        return self._real_statistics(path) if disk is None else disk.statistics()

    def open_files(self, disks: Collection[Disk]) -> list[str]:
        """Give the files of some disks that are open."""
        return [one.path for one in self._files.values() if one.disk in disks]

    def _open(self, vfs: int, name: int | None, file: int, flags: int, out: Any) -> int:
        # The machine's VFS keeps the address of the name, so it has to be SQLite's own
        path = None if name is None else os.fsdecode(ctypes.string_at(name))
        disk = None if path is None else self._disk_of(path)
        if disk is not None and disk.is_dead:
            c_void_p.from_address(file).value = None
            return _CANNOT_OPEN
        is_new = path is not None and not os.path.exists(path)  # noqa: PTH110  # at each opening
        result = int(self._real.contents.open(vfs, name, file, flags, out))
        if result == _OK and disk is not None and path is not None:
            if is_new and flags & _JOURNAL_OR_LOG:
                disk.created(path)
            methods = c_void_p.from_address(file)
            real = methods.value or 0
            self._files[file] = _File(disk, path, _Methods.from_address(real))
            methods.value = ctypes.addressof(self._table(real))
        return result

    def _table(self, real: int) -> _Methods:
        """Give the machine's table of functions with those of this layer in it."""
        table = self._tables.get(real)
        if table is None:
            table = self._tables[real] = _Methods()
            size = ctypes.sizeof(_Methods)
            ctypes.memmove(ctypes.byref(table), real, size)
            for name, hook in self._hooks.items():
                setattr(table, name, hook)
        return table

    def _close(self, file: int) -> int:
        return int(self._files.pop(file).real.close(file))

    def _size(self, file: int, real: Any) -> int:
        size = c_int64()
        real.file_size(file, ctypes.byref(size))
        return size.value

    def _write(self, file: int, data: int, count: int, offset: int) -> int:
        disk, path, real = self._files[file]
        size = self._size(file, real)
        refusal = disk.refusal(_IOERR_WRITE)
        if refusal == _OK and disk.is_full and offset + count > size:
            refusal = _FULL
        if refusal != _OK:
            return refusal
        old_count = max(0, min(count, size - offset))
        old = ctypes.create_string_buffer(max(1, old_count))
        if old_count:
            real.read(file, ctypes.addressof(old), old_count, offset)
        change = _Change(offset, ctypes.string_at(data, count), old.raw[:old_count], size)
        disk.note(path, change)
        return int(real.write(file, data, count, offset))

    def _truncate(self, file: int, size: int) -> int:
        disk, path, real = self._files[file]
        refusal = disk.refusal(_IOERR_TRUNCATE)
        if refusal != _OK:
            return refusal
        old_size = self._size(file, real)
        old = ctypes.create_string_buffer(max(1, old_size - size))
        if old_size > size:
            real.read(file, ctypes.addressof(old), old_size - size, size)
        cut = old.raw[: max(0, old_size - size)]
        disk.note(path, _Change(size, None, cut, old_size))
        return int(real.truncate(file, size))

    def _sync(self, file: int, _flags: int) -> int:
        disk, path, _ = self._files[file]
        refusal = disk.refusal(_IOERR_SYNC)
        if refusal == _OK:
            disk.synced(path)
        return refusal

    def _delete(self, vfs: int, name: bytes, syncs_folder: int) -> int:
        path = os.fsdecode(name)
        disk = self._disk_of(path)
        if disk is None:
            return int(self._real.contents.delete(vfs, name, syncs_folder))
        refusal = disk.refusal(_IOERR_DELETE)
        if refusal != _OK:
            return refusal
        content = Path(path).read_bytes() if Path(path).exists() else b""
        result = int(self._real.contents.delete(vfs, name, syncs_folder))
        if result == _OK:
            disk.deleted(path, content, syncs_folder=bool(syncs_folder))
        return result

    def _sleep(self, _vfs: int, microseconds: int) -> int:
        """Let nobody sleep: SQLite adds up by itself how long it has waited for a lock."""
        for disk in self.disks:
            disk.waited_s += microseconds * 1e-6
        return microseconds


_LAYER: Final[list[_Layer]] = []
"""The layer of this process, once it was needed: SQLite keeps its address."""


@contextmanager
def attached(*disks: Disk) -> Iterator[None]:
    """Have SQLite write the files in these disks' folders through them.

    Raises:
        StillOpenError: if a file is open at the end, which Python would close when it collects it.
    """
    if not _LAYER:
        _LAYER.append(_Layer())
        # SQLite calls it until the process has ended, also after Python has cleared this module
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(_LAYER[0]))
    [layer] = _LAYER
    layer.disks.extend(disks)
    layer.install()
    try:
        with patch.object(os, "statvfs", layer.statistics):
            yield
        if left := layer.open_files(disks):
            raise StillOpenError(f"files that are still open: {left}")
    finally:
        for disk in disks:
            layer.disks.remove(disk)
        if not layer.disks:
            layer.remove()
