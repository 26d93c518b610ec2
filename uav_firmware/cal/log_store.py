"""Where flight logs go: files that grow, on a medium that may be full."""

from typing import Protocol


class LogFile(Protocol):
    """One file, written from front to back."""

    def write(self, chunk: bytes) -> None:
        """Append; what was written outlives a crash of this process.

        Raises:
            OSError: if the medium refuses; the chunk may be there in part.
        """

    def sync(self) -> None:
        """Make sure that what was written outlives a loss of power; may take long.

        Raises:
            OSError: if the medium refuses.
        """

    def close(self) -> None:
        """Write no more."""


class LogStore(Protocol):
    """Keeps the newest logs, as many as there is room for."""

    def free_bytes(self) -> int:
        """Room that is left on the medium [bytes].

        Raises:
            OSError: if the medium does not report it.
        """

    def create(self, time_utc_us: int) -> LogFile:
        """Begin a file named after a time [us since 1970]; the oldest files make room for it.

        Raises:
            OSError: if the medium refuses.
        """
