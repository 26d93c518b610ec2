"""Files that survive a restart, written whole or not at all.

The control loop saves in flight, and a medium may take seconds. So a save only begins; its
outcome is a `Write`, which the loop polls and never waits for.
"""

from typing import Final, Protocol


class Write(Protocol):
    """A save or a removal that has begun; a `concurrent.futures.Future` is one."""

    def done(self) -> bool:
        """Whether it has ended."""

    def result(self, timeout: float | None = None) -> None:
        """Its outcome, once it is done; before that this waits, `timeout` [s] at most.

        Raises:
            OSError: if the write has failed; the previous contents stay.
            TimeoutError: if the write has not ended in time; it may still end later.
        """


class Written:
    """A `Write` that has succeeded already."""

    def done(self) -> bool:
        """Always."""
        return True

    def result(self, timeout: float | None = None) -> None:
        """Success."""


WRITTEN: Final = Written()


class Storage(Protocol):
    """Named blobs; writes end in the order in which they began."""

    def load(self, name: str) -> bytes | None:
        """Contents stored under `name`, or None; called before the loop begins."""

    def save(self, name: str, contents: bytes) -> Write:
        """Begin to replace the contents atomically.

        Raises:
            OSError: if the write cannot begin; the previous contents stay.
        """

    def remove(self, name: str) -> Write:
        """Begin to remove the contents; nothing stored is no error.

        Raises:
            OSError: if the removal cannot begin; the contents stay.
        """
