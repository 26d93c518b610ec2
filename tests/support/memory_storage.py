"""The vehicle's storage as a dictionary that can refuse."""

import errno
import os

from uav_firmware.cal.storage import WRITTEN, Write


class MemoryStorage:
    """Implements `uav_firmware.cal.storage.Storage`."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.refusal: int | None = None  # errno of every write, or None

    def load(self, name: str) -> bytes | None:
        """Contents, or None."""
        return self.files.get(name)

    def save(self, name: str, contents: bytes) -> Write:
        """Replace the contents."""
        self._may_refuse()
        self.files[name] = contents
        return WRITTEN

    def remove(self, name: str) -> Write:
        """Forget the contents; a full medium still can."""
        if self.refusal != errno.ENOSPC:
            self._may_refuse()
        self.files.pop(name, None)
        return WRITTEN

    def _may_refuse(self) -> None:
        if self.refusal is not None:
            raise OSError(self.refusal, os.strerror(self.refusal))
