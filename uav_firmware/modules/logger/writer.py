"""Writes chunks to log files, with the last chunks before the start; an I/O error ends a log."""

from collections import deque
from collections.abc import Callable
from typing import Final

from uav_firmware.cal.log_store import LogFile, LogStore
from uav_firmware.modules.logger.states import Logging, LoggingEvent, next_state

CHUNKS_BEFORE: Final = 4
"""Chunks before the start that a log includes."""


class LogWriter:
    """Opens, writes and closes log files."""

    def __init__(self, store: LogStore, *, boot_time_utc_us: int) -> None:
        self._store = store
        self._boot_time_utc_us = boot_time_utc_us
        self._pending: deque[tuple[int, bytes]] = deque(maxlen=CHUNKS_BEFORE)
        self._file: LogFile | None = None
        self._size = 0
        self.state = Logging.IDLE

    @property
    def writing(self) -> bool:
        """Whether a file is open."""
        return self._file is not None

    def write_chunk(
        self,
        chunk: bytes,
        *,
        began_us: int,
        wanted: bool,
        size_max: int,
        describe: Callable[[int], bytes],
    ) -> str | None:
        """Write the next chunk; return an error text when the storage fails, else None.

        Args:
            chunk: records since the previous one.
            began_us: time [us since boot] at which the chunk begins.
            wanted: whether SDLOG_MODE asks for a log now.
            size_max: size [bytes] at which the log continues in a new file.
            describe: encodes the definitions of a file that begins at a time [us since boot].
        """
        previous = self.state
        event = LoggingEvent.WANTED if wanted else LoggingEvent.UNWANTED
        self.state = next_state(previous, event)
        self._pending.append((began_us, chunk))
        try:
            if self.state is Logging.RECORDING and (self._file is None or self._size >= size_max):
                self._open(describe)
            self._write_pending()
            if previous is Logging.FINISHING and self.state is Logging.IDLE:
                self._end()
        except OSError as error:
            self.state = next_state(self.state, LoggingEvent.STORAGE_ERROR)
            self._drop()
            return f"Flight log stopped: {error.strerror or error}"
        return None

    def finish(self, chunk: bytes) -> str | None:
        """Write a last chunk and close the file if one is open; return an error text or None."""
        try:
            if self._file is not None:
                self._file.write(chunk)
                self._end()
        except OSError as error:
            self._drop()
            return f"Flight log stopped: {error.strerror or error}"
        return None

    def _open(self, describe: Callable[[int], bytes]) -> None:
        """Open a new file; close the previous one without a sync, which could block in flight."""
        self._drop()
        began_us = self._pending[0][0]
        self._file = self._store.create(self._boot_time_utc_us + began_us)
        self._size = 0
        self._write(describe(began_us))

    def _write_pending(self) -> None:
        """Write all pending chunks if a file is open."""
        if self._file is not None:
            self._write(b"".join(chunk for _, chunk in self._pending))
            self._pending.clear()

    def _write(self, data: bytes) -> None:
        if self._file is not None:
            self._file.write(data)
            self._size += len(data)

    def _end(self) -> None:
        """Sync and close the file; the vehicle is disarmed, so this may block."""
        if self._file is not None:
            self._file.sync()
        self._drop()

    def _drop(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
