"""Storage and flight logs written by a thread: the control loop waits for no medium.

A paced vehicle writes this way. One that flies as fast as the machine allows writes in its own
loop instead (`FileStorage`, `LogFolder`): the same flight then has the same outcome at the same
step, and no deadline is missed by waiting.

`MediumTooSlowError(OSError)`: the thread is so far behind that nothing more is taken.
"""

import errno
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import Final

from uav_firmware.cal.log_store import LogFile, LogStore
from uav_firmware.cal.storage import Storage, Write

LOG_BACKLOG_BYTES: Final = 16 * 1024 * 1024
"""A log of which so much waits to be written ends: some minutes of it."""
STORAGE_BACKLOG: Final = 64
"""Saves that may wait."""


class MediumTooSlowError(OSError):
    """More waits to be written than may."""

    def __init__(self) -> None:
        super().__init__(errno.EAGAIN, "the medium is too slow")


class BackgroundStorage:
    """Implements `uav_firmware.cal.storage.Storage` over another one."""

    def __init__(self, storage: Storage) -> None:
        """Begin with nothing to write."""
        self._storage = storage
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="storage")
        self._waiting: list[Future[None]] = []

    def load(self, name: str) -> bytes | None:
        """Contents stored under `name`, or None; waits for the writes before it."""
        return self._thread.submit(self._storage.load, name).result()

    def save(self, name: str, contents: bytes) -> Write:
        """Begin to replace the contents."""
        return self._begin(lambda: self._storage.save(name, contents).result())

    def remove(self, name: str) -> Write:
        """Begin to remove the contents."""
        return self._begin(lambda: self._storage.remove(name).result())

    def close(self) -> None:
        """Wait until everything is written; nothing more is taken then."""
        self._thread.shutdown()

    def _begin(self, work: Callable[[], None]) -> Future[None]:
        self._waiting = [each for each in self._waiting if not each.done()]
        if len(self._waiting) >= STORAGE_BACKLOG:
            raise MediumTooSlowError
        write = self._thread.submit(work)
        self._waiting.append(write)
        return write


class BackgroundLogs:
    """Implements `uav_firmware.cal.log_store.LogStore` over another one."""

    def __init__(self, store: LogStore, *, backlog_bytes: int = LOG_BACKLOG_BYTES) -> None:
        """Begin with nothing to write; at most `backlog_bytes` may wait."""
        self._store = store
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="flight-log")
        self._backlog_bytes = backlog_bytes

    def free_bytes(self) -> int:
        """Room that is left on the medium [bytes]; the kernel knows it without a wait.

        Raises:
            OSError: if the medium does not report it.
        """
        return self._store.free_bytes()

    def create(self, time_utc_us: int) -> LogFile:
        """Begin a file; what the medium refuses is raised by a later write."""
        return _BackgroundLog(
            self._thread, lambda: self._store.create(time_utc_us), self._backlog_bytes
        )

    def close(self) -> None:
        """Wait until everything is written; nothing more is taken then."""
        self._thread.shutdown()


class _BackgroundLog:
    """Implements `uav_firmware.cal.log_store.LogFile`; after a refusal nothing more is written."""

    def __init__(
        self, thread: ThreadPoolExecutor, create: Callable[[], LogFile], backlog_bytes: int
    ) -> None:
        self._thread = thread
        self._backlog_bytes = backlog_bytes
        self._waiting_bytes = 0
        self._lock = Lock()
        self._refusal: OSError | None = None
        self._file = thread.submit(self._created, create)

    def write(self, chunk: bytes) -> None:
        """Append.

        Raises:
            OSError: if the medium has refused something before, or is too slow.
        """
        self._check()
        with self._lock:
            if self._waiting_bytes + len(chunk) > self._backlog_bytes:
                raise MediumTooSlowError
            self._waiting_bytes += len(chunk)
        self._thread.submit(self._write, chunk)

    def sync(self) -> None:
        """Begin to bring it all to the medium.

        Raises:
            OSError: if the medium has refused something before.
        """
        self._check()
        self._thread.submit(self._run, lambda file: file.sync())

    def close(self) -> None:
        """Write no more."""
        self._thread.submit(self._close)

    def _check(self) -> None:
        if self._refusal is not None:
            raise self._refusal

    def _created(self, create: Callable[[], LogFile]) -> LogFile | None:
        try:
            return create()
        except OSError as error:
            self._refusal = error
            return None

    def _write(self, chunk: bytes) -> None:
        self._run(lambda file: file.write(chunk))
        with self._lock:
            self._waiting_bytes -= len(chunk)

    def _run(self, work: Callable[[LogFile], None]) -> None:
        """In the thread: the file has been created by then, since works keep their order."""
        file = self._file.result()
        if file is None or self._refusal is not None:
            return
        try:
            work(file)
        except OSError as error:
            self._refusal = error

    def _close(self) -> None:
        file = self._file.result()
        if file is not None:
            file.close()
