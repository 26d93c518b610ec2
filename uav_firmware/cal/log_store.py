"""Storage of flight logs: files that grow, on a medium that may be full."""

from typing import Protocol


class LogFile(Protocol):
    """One file, written sequentially."""

    def write(self, chunk: bytes) -> None:
        """Append; written data survive a crash of this process.

        Raises:
            OSError: if the write fails; the chunk may be written in part.
        """

    def sync(self) -> None:
        """Sync written data to the medium, so that they survive a loss of power; may take long.

        Raises:
            OSError: if the medium reports an error.
        """

    def close(self) -> None:
        """Write no more."""


class LogStore(Protocol):
    """Keeps the newest logs; the oldest are removed when space is short."""

    def free_bytes(self) -> int:
        """Free space of the medium [bytes].

        Raises:
            OSError: if the medium does not report it.
        """

    def create(self, time_utc_us: int) -> LogFile:
        """Begin a file named after a time [us since 1970]; the oldest files are removed for it.

        Raises:
            OSError: if the medium reports an error.
        """
