"""Files of a bounded folder that grow by whole records, begun anew by size, pruned by number."""

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
    """The newest file grows; the oldest goes when there are too many."""

    def __init__(self, folder: Path, *, file_bytes: int, files: int) -> None:
        self._folder = folder
        self._file_bytes = file_bytes
        self._files = files
        self._descriptor: int | None = None
        self._size = 0

    def append(self, records: bytes, time: datetime) -> None:
        """Write whole records; all of them, or nothing.

        Raises:
            OSError: if the disk refuses; the file then ends as before.
        """
        descriptor = self._descriptor
        if descriptor is None or self._size >= self._file_bytes:
            descriptor = self._begin(time)
        written = 0
        try:
            while written < len(records):
                written += os.write(descriptor, records[written:])
        except OSError:
            self._cut_back(descriptor)
            raise
        self._size += written

    def close(self) -> None:
        """End the file."""
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
        """Leave room for one more."""
        paths = sorted(self._folder.glob(f"*{SUFFIX}"), key=_age)
        for path in paths[: max(0, len(paths) - self._files + 1)]:
            with suppress(FileNotFoundError):
                path.unlink()

    def _cut_back(self, descriptor: int) -> None:
        """End at the last whole record; a file that cannot be cut is left for a new one."""
        try:
            os.ftruncate(descriptor, self._size)
        except OSError as error:
            _LOG.warning("a frame log ends in half a record: %s", error.strerror)
            self.close()


def _age(path: Path) -> tuple[int, str]:
    """What oldest comes first by."""
    try:
        return path.stat().st_mtime_ns, path.name
    except FileNotFoundError:
        return 0, path.name
