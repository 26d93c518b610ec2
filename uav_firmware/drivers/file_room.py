"""How much a folder may hold: a count that is kept, and made anew when it says that it is full."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


class Content(NamedTuple):
    """What a folder holds, all folders in it included."""

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
                continue  # Removed while we look
    return Content(size, entries)


class Room:
    """The limits of a folder and what is taken of them."""

    def __init__(self, bytes_max: int, entries_max: int, content: Callable[[], Content]) -> None:
        """Take the limits, and a way to look the folder through."""
        if bytes_max < 1 or entries_max < 1:
            raise ValueError(f"room for {entries_max} entries of {bytes_max} bytes holds nothing")
        self.bytes_max = bytes_max
        self._entries_max = entries_max
        self._content = content
        self._taken: Content | None = None

    @property
    def taken(self) -> Content:
        """What is there now."""
        if self._taken is None:
            self._taken = self._content()
        return self._taken

    def demand(self, size: int = 0, entries: int = 0) -> None:
        """Make sure that so much more fits.

        Raises:
            OSError: ENOSPC, if it does not, also after looking the folder through again.
        """
        if not self._fits(size, entries):
            self._taken = None
            if not self._fits(size, entries):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def take(self, size: int = 0, entries: int = 0) -> None:
        """Count what has been added, or removed; before the first look there is no count."""
        if self._taken is not None:
            self._taken = Content(
                max(self._taken.bytes + size, 0), max(self._taken.entries + entries, 0)
            )

    def _fits(self, size: int, entries: int) -> bool:
        taken = self.taken
        return taken.bytes + size <= self.bytes_max and taken.entries + entries <= self._entries_max
