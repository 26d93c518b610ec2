"""Flight logs in a folder: `2026-03-01/09_30_00.ulg`, the oldest removed to make room."""

import os
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

FILES_MAX: Final = 50
BYTES_MAX: Final = 512 * 1024 * 1024  # 512 MiB

_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
_NAME = re.compile(r"(\d{2}_\d{2}_\d{2})(?:_(\d+))?\.ulg")


class LogFolder:
    """Implements `uav_firmware.cal.log_store.LogStore`; makes the folder with the first log.

    Only files named as logs are counted or removed; other files stay.
    """

    def __init__(
        self, folder: Path, *, files_max: int = FILES_MAX, bytes_max: int = BYTES_MAX
    ) -> None:
        """`files_max` logs of together `bytes_max` are kept, the one being written included."""
        if files_max < 1 or bytes_max < 1:
            raise ValueError(f"room for {files_max} files of {bytes_max} bytes holds no log")
        self._folder = folder
        self._files_max = files_max
        self._bytes_max = bytes_max
        self._newest: GrowingFile | None = None

    @property
    def folder(self) -> Path:
        """Folder of the logs."""
        return self._folder

    def is_being_written(self, path: Path) -> bool:
        """Whether a log still grows."""
        newest = self._newest
        return newest is not None and not newest.is_closed and newest.path == path

    def free_bytes(self) -> int:
        """Room that is left for this user [bytes], the folder being there or not.

        Raises:
            OSError: if the medium does not report it.
        """
        place = self._folder
        while not place.exists() and place != place.parent:
            place = place.parent
        return shutil.disk_usage(place).free

    def create(self, time_utc_us: int) -> "GrowingFile":
        """Begin a file; a second one of the same second gets a number.

        Raises:
            OSError: if the medium refuses.
        """
        self._make_room()
        time = datetime.fromtimestamp(time_utc_us // 1_000_000, UTC)
        day = self._folder / f"{time:%Y-%m-%d}"
        day.mkdir(parents=True, exist_ok=True)
        stem, number = f"{time:%H_%M_%S}", 1
        while True:
            name = f"{stem}.ulg" if number == 1 else f"{stem}_{number}.ulg"
            try:
                self._newest = GrowingFile(day / name)
            except FileExistsError:
                number += 1
            else:
                return self._newest

    def files(self) -> list[Path]:
        """All logs, oldest first."""
        if not self._folder.is_dir():
            return []
        found = [
            (day.name, match[1], int(match[2] or 1), path)
            for day in self._folder.iterdir()
            if _DATE.fullmatch(day.name) and day.is_dir()
            for path in day.iterdir()
            if (match := _NAME.fullmatch(path.name))
        ]
        return [path for *_, path in sorted(found)]

    def _make_room(self) -> None:
        """Remove the oldest until one more file fits."""
        files = self.files()
        sizes = [path.stat().st_size for path in files]
        while files and (len(files) >= self._files_max or sum(sizes) >= self._bytes_max):
            oldest = files.pop(0)
            sizes.pop(0)
            oldest.unlink()
            if not any(oldest.parent.iterdir()):
                oldest.parent.rmdir()


class GrowingFile:
    """Implements `uav_firmware.cal.log_store.LogFile`: unbuffered by this process."""

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises:
            FileExistsError: if there is one of this name.
            OSError: if the medium refuses.
        """
        self.path = path
        self._file = path.open("xb", buffering=0)

    @property
    def is_closed(self) -> bool:
        """Whether nothing more is written."""
        return self._file.closed

    def write(self, chunk: bytes) -> None:
        """Append.

        Raises:
            OSError: if the medium refuses; the chunk may be there in part.
        """
        rest = memoryview(chunk)
        while rest:
            rest = rest[self._file.write(rest) :]

    def sync(self) -> None:
        """Wait until the medium has it all.

        Raises:
            OSError: if the medium refuses.
        """
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._file.close()
