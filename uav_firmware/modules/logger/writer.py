"""Chunks in, files out: what came just before the start is kept, a full medium ends a log."""

from collections import deque
from collections.abc import Callable
from typing import Final

from uav_firmware.cal.log_store import LogFile, LogStore
from uav_firmware.modules.logger.states import Logging, LoggingEvent, next_state

CHUNKS_BEFORE: Final = 4
"""Chunks that are kept for the start of a log."""


class LogWriter:
    """The log file, if there is one."""

    def __init__(self, store: LogStore, *, boot_time_utc_us: int) -> None:
        self._store = store
        self._boot_time_utc_us = boot_time_utc_us
        self._before: deque[tuple[int, bytes]] = deque(maxlen=CHUNKS_BEFORE)
        self._file: LogFile | None = None
        self._size = 0
        self.state = Logging.IDLE

    @property
    def writing(self) -> bool:
        """Whether there is a file."""
        return self._file is not None

    def turn(
        self,
        chunk: bytes,
        *,
        began_us: int,
        wanted: bool,
        size_max: int,
        describe: Callable[[int], bytes],
    ) -> str | None:
        """Take the next chunk; gives a sentence when the medium has refused.

        Args:
            chunk: records since the former one.
            began_us: time [us since boot] at which the chunk begins.
            wanted: whether there shall be a log now.
            size_max: size [bytes] at which the log goes on in another file.
            describe: makes the first part of a file from the time at which it begins.
        """
        former = self.state
        event = LoggingEvent.WANTED if wanted else LoggingEvent.UNWANTED
        self.state = next_state(former, event)
        self._before.append((began_us, chunk))
        try:
            if self.state is Logging.RECORDING and (self._file is None or self._size >= size_max):
                self._open(describe)
            self._write_waiting()
            if former is Logging.FINISHING and self.state is Logging.IDLE:
                self._end()
        except OSError as error:
            self.state = next_state(self.state, LoggingEvent.REFUSED)
            self._drop()
            return f"Flight log stopped: {error.strerror or error}"
        return None

    def finish(self, chunk: bytes) -> str | None:
        """Write a last chunk and end the file, if there is one; a sentence as from `turn`."""
        try:
            if self._file is not None:
                self._file.write(chunk)
                self._end()
        except OSError as error:
            self._drop()
            return f"Flight log stopped: {error.strerror or error}"
        return None

    def _open(self, describe: Callable[[int], bytes]) -> None:
        """Begin a file, in place of the former one; that one is not waited for in flight."""
        self._drop()
        began_us = self._before[0][0]
        self._file = self._store.create(self._boot_time_utc_us + began_us)
        self._size = 0
        self._write(describe(began_us))

    def _write_waiting(self) -> None:
        """Write all chunks that wait, if there is a file."""
        if self._file is not None:
            self._write(b"".join(chunk for _, chunk in self._before))
            self._before.clear()

    def _write(self, data: bytes) -> None:
        if self._file is not None:
            self._file.write(data)
            self._size += len(data)

    def _end(self) -> None:
        """End the file for good; the vehicle stands, so the medium may take its time."""
        if self._file is not None:
            self._file.sync()
        self._drop()

    def _drop(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
