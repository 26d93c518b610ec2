"""Named files in one folder, replaced atomically; the caller waits for each write."""

import os
import re
import tempfile
from pathlib import Path

from uav_firmware.cal.storage import WRITTEN, Write

_UNFINISHED = ".unfinished"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


class FileStorage:
    """Implements `uav_firmware.cal.storage.Storage` in a folder that it creates."""

    def __init__(self, folder: Path) -> None:
        """Make the folder, and remove the temporary files of interrupted writes.

        Raises:
            OSError: if it cannot be created.
        """
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        for unfinished in folder.glob(f".*{_UNFINISHED}"):
            unfinished.unlink(missing_ok=True)

    def load(self, name: str) -> bytes | None:
        """Contents stored under `name`, or None.

        Raises:
            ValueError: if the name is not a plain file name.
            OSError: if the file is there but cannot be read.
        """
        try:
            return self._path(name).read_bytes()
        except FileNotFoundError:
            return None

    def save(self, name: str, contents: bytes) -> Write:
        """Replace the contents: the new file is complete on the medium before it is renamed.

        Raises:
            ValueError: if the name is not a plain file name.
            OSError: if the write fails; the previous contents stay.
        """
        path = self._path(name)
        descriptor, temporary = tempfile.mkstemp(
            prefix=f".{name}.", suffix=_UNFINISHED, dir=self._folder
        )
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(contents)
                file.flush()
                os.fsync(file.fileno())
            Path(temporary).replace(path)
        except OSError:
            Path(temporary).unlink(missing_ok=True)
            raise
        self._sync_folder()
        return WRITTEN

    def remove(self, name: str) -> Write:
        """Remove a file; a missing one is no error.

        Raises:
            ValueError: if the name is not a plain file name.
            OSError: if the removal fails; the contents stay.
        """
        self._path(name).unlink(missing_ok=True)
        self._sync_folder()
        return WRITTEN

    def _sync_folder(self) -> None:
        """Write the folder's directory entries to the medium."""
        descriptor = os.open(self._folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _path(self, name: str) -> Path:
        if not _NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not a plain file name")
        return self._folder / name
