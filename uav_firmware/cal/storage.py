"""Files that survive a restart, written whole or not at all."""

from typing import Protocol


class Storage(Protocol):
    """Named blobs."""

    def load(self, name: str) -> bytes | None:
        """Contents stored under `name`, or None."""

    def save(self, name: str, contents: bytes) -> None:
        """Replace the contents atomically.

        Raises:
            OSError: if the medium refuses; the former contents stay.
        """

    def remove(self, name: str) -> None:
        """Forget the contents; nothing stored is no fault.

        Raises:
            OSError: if the medium refuses; the contents stay.
        """
