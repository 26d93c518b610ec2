"""Files of a bounded folder: they grow by whole records, rotate by size and are pruned by count."""

import logging
import os
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Final

SUFFIX: Final = ".tlog"
_NAME: Final = "%Y-%m-%d_%H-%M-%S"

_LOG = logging.getLogger(__name__)


class FrameFiles:
    """Appends to the newest file and deletes the oldest when there are too many."""

    def __init__(self, folder: Path, *, file_bytes: int, files: int) -> None:
        self._folder = folder
        self._file_bytes = file_bytes
        self._files = files
        self._descriptor: int | None = None
        self._size = 0

    def append(self, records: bytes, time: datetime) -> None:
        """Write whole records; all of them, or nothing.

        Raises:
            OSError: if the write fails; the file then ends as before.
        """
        descriptor = self._descriptor
        if descriptor is None or self._size >= self._file_bytes:
            descriptor = self._begin(time)
        written = 0
        try:
            while written < len(records):
                written += os.write(descriptor, records[written:])
        except OSError:
            self._truncate(descriptor)
            raise
        self._size += written

    def close(self) -> None:
        """Close the file."""
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None

    def _begin(self, time: datetime) -> int:
        self.close()
        self._folder.mkdir(parents=True, exist_ok=True)
        self._prune()
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
        for number in range(1, 1000):
            name = time.strftime(_NAME) + (f"_{number}" if number > 1 else "") + SUFFIX
            with suppress(FileExistsError):
                self._descriptor = descriptor = os.open(self._folder / name, flags, 0o644)
                self._size = 0
                return descriptor
        raise FileExistsError(f"{self._folder} has a thousand files of one second")

    def _prune(self) -> None:
        """Delete the oldest files so that one more fits."""
        paths = sorted(self._folder.glob(f"*{SUFFIX}"), key=_age)
        for path in paths[: max(0, len(paths) - self._files + 1)]:
            with suppress(FileNotFoundError):
                path.unlink()

    def _truncate(self, descriptor: int) -> None:
        """Truncate to the last whole record; if that fails, the next record starts a new file."""
        try:
            os.ftruncate(descriptor, self._size)
        except OSError as error:
            _LOG.warning("a frame log ends with an incomplete record: %s", error.strerror)
            self.close()


def _age(path: Path) -> tuple[int, str]:
    """Sort key: oldest first."""
    try:
        return path.stat().st_mtime_ns, path.name
    except FileNotFoundError:
        return 0, path.name
