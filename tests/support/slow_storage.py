"""The vehicle's storage on a medium that takes its time: nothing ends before it is let end."""

import errno
import os

from uav_firmware.cal.storage import Write


class SlowWrite:
    """Implements `uav_firmware.cal.storage.Write`; callers must not wait for it."""

    def __init__(self) -> None:
        self._ended = False
        self._refusal: int | None = None

    def end(self, refusal: int | None = None) -> None:
        """Succeed, or refuse with an errno."""
        self._ended, self._refusal = True, refusal

    def done(self) -> bool:
        """Whether it has ended."""
        return self._ended

    def result(self, timeout: float | None = None) -> None:
        """Its outcome; the control loop that asks too early would stand still."""
        if timeout is not None and not self._ended:
            raise TimeoutError
        assert self._ended, "waited for a medium"
        if self._refusal is not None:
            raise OSError(self._refusal, os.strerror(self._refusal))


class SlowStorage:
    """Implements `uav_firmware.cal.storage.Storage`; `end` lets the oldest write end."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self._writes: list[tuple[SlowWrite, str, bytes | None]] = []

    @property
    def waiting(self) -> int:
        """Writes that have not ended."""
        return len(self._writes)

    def load(self, name: str) -> bytes | None:
        """Contents, or None."""
        return self.files.get(name)

    def save(self, name: str, contents: bytes) -> Write:
        """Begin to replace the contents."""
        return self._begin(name, contents)

    def remove(self, name: str) -> Write:
        """Begin to remove the contents."""
        return self._begin(name, None)

    def end(self, *, full: bool = False) -> None:
        """The oldest write succeeds, or finds no room."""
        write, name, contents = self._writes.pop(0)
        if full:
            write.end(errno.ENOSPC)
            return
        if contents is None:
            self.files.pop(name, None)
        else:
            self.files[name] = contents
        write.end()

    def _begin(self, name: str, contents: bytes | None) -> Write:
        write = SlowWrite()
        self._writes.append((write, name, contents))
        return write
