"""How much a folder may hold: a count that is kept, and made anew when it says that it is full."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

REFUSALS_PER_LOOK: Final = 64
"""To look a large folder through takes a while; who asks in vain shall not make it often."""


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
        self._refusals = 0

    @property
    def taken(self) -> Content:
        """What is there now."""
        if self._taken is None:
            self._taken = self._content()
        return self._taken

    def demand(self, size: int = 0, entries: int = 0) -> None:
        """Make sure that so much more fits.

        Raises:
            OSError: ENOSPC, if it does not. Now and then the folder is looked through again
                first, since others may have removed something.
        """
        if self._fits(size, entries):
            return
        self._refusals += 1
        if self._refusals % REFUSALS_PER_LOOK == 1:
            self._taken = None
            if self._fits(size, entries):
                return
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
