"""Counters that outlive their process: a small file, written in place, read by other processes.

Server and relay are two processes and each may be killed at any instruction, yet the metrics need
counters that never decrease. Each process has a file of its own in the state folder; the metrics
read both. The file is mapped into memory: counting costs no system call, and the counts survive a
kill (not a power cut, after which they may start again).

A file is a row of slots of 128 bytes: 120 bytes of name, then the value as a double.
"""

import logging
import mmap
import os
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Final, TypeAlias

LOG = logging.getLogger(__name__)
Labels: TypeAlias = tuple[str, ...]
"""Values of the labels of a metric, in the order of its label names."""

PART_DEATHS: Final = "fm_part_deaths"
"""Name of the supervisor's count: by part, how often its process has ended by itself."""
_SLOT_BYTES: Final = 128
_NAME_BYTES: Final = 120
_SLOTS: Final = 512
_FILE_BYTES: Final = _SLOT_BYTES * _SLOTS
_VALUE: Final = struct.Struct("=d")
_BETWEEN: Final = "\x1f"
_LABEL_LENGTH: Final = 40


class Tally:
    """The counters of one process; safe to use from several threads."""

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._slots: dict[tuple[str, Labels], int] = {}
        self._memory = _map(path)
        for slot, (name, labels, _) in enumerate(_slots(self._memory)):
            self._slots[name, labels] = slot

    def add(self, name: str, *labels: str, amount: float = 1.0) -> None:
        """Add to a counter; one for which the file has no slot is left out."""
        with self._lock:
            if (place := self._place(name, labels)) is not None:
                (value,) = _VALUE.unpack_from(self._memory, place)
                _VALUE.pack_into(self._memory, place, value + amount)

    def put(self, name: str, *labels: str, value: float) -> None:
        """Set a value."""
        with self._lock:
            if (place := self._place(name, labels)) is not None:
                _VALUE.pack_into(self._memory, place, value)

    def close(self) -> None:
        """Close the file."""
        self._memory.close()

    def _place(self, name: str, labels: Labels) -> int | None:
        """Return the offset of a value, None if there is no slot left."""
        labels = tuple(label[:_LABEL_LENGTH] for label in labels)
        slot = self._slots.get((name, labels))
        if slot is None:
            slot = len(self._slots)
            raw = _BETWEEN.join((name, *labels)).encode("ascii", "replace")
            if slot == _SLOTS or len(raw) > _NAME_BYTES:
                return None
            start = slot * _SLOT_BYTES
            self._memory[start : start + len(raw)] = raw
            self._slots[name, labels] = slot
        return slot * _SLOT_BYTES + _NAME_BYTES


def _map(path: Path) -> mmap.mmap:
    """Map the file; if the disk has no room for it, the counters are only in memory.

    Its blocks are allocated now: a page that finds no room when it is written kills the process.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        LOG.warning("counts are not kept: %s", error)
        return mmap.mmap(-1, _FILE_BYTES)
    try:
        os.posix_fallocate(descriptor, 0, _FILE_BYTES)
        return mmap.mmap(descriptor, _FILE_BYTES)
    except OSError as error:
        LOG.warning("counts are not kept: %s: %s", path, error)
        return mmap.mmap(-1, _FILE_BYTES)
    finally:
        os.close(descriptor)


def read(path: Path) -> dict[str, dict[Labels, float]]:
    """Return the counters of a process by name and labels; none if it never ran."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    found: dict[str, dict[Labels, float]] = {}
    for name, labels, value in _slots(content):
        found.setdefault(name, {})[labels] = value
    return found


def _slots(content: bytes | mmap.mmap) -> Iterator[tuple[str, Labels, float]]:
    for start in range(0, len(content) - _SLOT_BYTES + 1, _SLOT_BYTES):
        raw = content[start : start + _NAME_BYTES].rstrip(b"\0")
        if not raw:
            return
        name, *labels = raw.decode("ascii", "replace").split(_BETWEEN)
        (value,) = _VALUE.unpack_from(content, start + _NAME_BYTES)
        yield name, tuple(labels), value
