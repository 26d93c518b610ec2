"""Quota of a folder: a count of its contents, measured again when the quota seems exhausted."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

REFUSALS_PER_MEASUREMENT: Final = 64
"""Refusals per new measurement, because measuring a large folder takes long."""


class Content(NamedTuple):
    """Contents of a folder, subfolders included."""

    bytes: int
    entries: int


def measure(folder: Path) -> Content:
    """Add up the plain files of a folder; links are counted, not followed."""
    size = entries = 0
    for place, folders, files in os.walk(folder):
        entries += len(folders) + len(files)
        for name in files:
            try:
                size += os.lstat(Path(place, name)).st_size
            except FileNotFoundError:
                continue  # Removed meanwhile
    return Content(size, entries)


class Room:
    """The limits of a folder and how much of them is used."""

    def __init__(self, bytes_max: int, entries_max: int, content: Callable[[], Content]) -> None:
        """Set the limits, and a function that measures the folder."""
        if bytes_max < 1 or entries_max < 1:
            raise ValueError(f"room for {entries_max} entries of {bytes_max} bytes holds nothing")
        self.bytes_max = bytes_max
        self._entries_max = entries_max
        self._content = content
        self._taken: Content | None = None
        self._refusals = 0

    @property
    def taken(self) -> Content:
        """Current contents."""
        if self._taken is None:
            self._taken = self._content()
        return self._taken

    def demand(self, size: int = 0, entries: int = 0) -> None:
        """Check that so much more fits.

        Raises:
            OSError: ENOSPC, if it does not. At some refusals the folder is measured again
                first, since others may have removed files.
        """
        if self._fits(size, entries):
            return
        self._refusals += 1
        if self._refusals % REFUSALS_PER_MEASUREMENT == 1:
            self._taken = None
            if self._fits(size, entries):
                return
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def take(self, size: int = 0, entries: int = 0) -> None:
        """Count what has been added, or removed; before the first measurement there is no count."""
        if self._taken is not None:
            self._taken = Content(
                max(self._taken.bytes + size, 0), max(self._taken.entries + entries, 0)
            )

    def _fits(self, size: int, entries: int) -> bool:
        taken = self.taken
        return taken.bytes + size <= self.bytes_max and taken.entries + entries <= self._entries_max
