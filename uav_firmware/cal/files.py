"""Files that peers may read and write by name: a card, a folder, or something generated.

A place is a tuple of names from the store's root, `("log", "2026-03-01")`; `()` is the root
itself. Every method reports a refusal by an `OSError` with its `errno` set.
"""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple, Protocol, TypeAlias

Place: TypeAlias = tuple[str, ...]
"""Names from the root; none of them is empty, `.` or `..`, or holds `/` or NUL."""


class Entry(NamedTuple):
    """What a folder holds under one name."""

    name: str
    is_folder: bool
    size: int  # [bytes] 0 for a folder
    modified_s: int  # [s since 1970] 0 where it is not known
    is_plain: bool = True  # False for what is neither file nor folder: a link, a device


class OpenMode(Enum):
    """What a file is opened for."""

    READ = "read"
    CREATE = "create"  # Write from nothing; what was there is gone
    WRITE = "write"  # Write into what is there, or from nothing


class OpenFile(Protocol):
    """An open file."""

    @property
    def size(self) -> int:
        """Present length [bytes].

        Raises:
            OSError: if the medium refuses.
        """

    def read(self, offset: int, count: int) -> bytes:
        """At most `count` bytes from `offset`; fewer only at the end.

        Raises:
            OSError: if the medium refuses.
        """

    def write(self, offset: int, chunk: bytes) -> None:
        """Write all of `chunk` at `offset`.

        Raises:
            OSError: if the file is not open for writing, the medium is full or refuses.
        """

    def close(self) -> None:
        """End the work on the file; a second call does nothing.

        Raises:
            OSError: if what was written cannot be used after all.
        """

    def abandon(self) -> None:
        """Close without using what was written where it is used only when it is whole."""


class FileStore(Protocol):
    """A tree of files."""

    def entries(self, place: Place) -> Sequence[Entry]:
        """What a folder holds, sorted by name.

        Raises:
            OSError: if there is no such folder, or it cannot be read.
        """

    def open(self, place: Place, mode: OpenMode) -> OpenFile:
        """Open a file.

        Raises:
            OSError: if it is not there, is protected, or there is no room.
        """

    def truncate(self, place: Place, size: int) -> None:
        """Make a file `size` bytes long.

        Raises:
            OSError: as `open`.
        """

    def remove(self, place: Place) -> None:
        """Remove a file.

        Raises:
            OSError: if it is not there or is protected.
        """

    def make_folder(self, place: Place) -> None:
        """Make a folder in one that is there.

        Raises:
            OSError: if the name is taken, the place is protected, or there is no room.
        """

    def remove_folder(self, place: Place) -> None:
        """Remove an empty folder.

        Raises:
            OSError: if it is not there, is protected, or is not empty.
        """

    def rename(self, place: Place, new_place: Place) -> None:
        """Give a file or folder another name or place; never takes the place of another.

        Raises:
            OSError: if it is not there, the new name is taken, or either is protected.
        """


class Card(NamedTuple):
    """The folders of the vehicle's storage card."""

    files: FileStore  # Written by clients
    logs: FileStore  # Flight logs: to read and to remove
    images: FileStore  # Pictures and video: to read and to remove
