"""Storage and flight logs written by a thread: the control loop does not wait for the medium.

A paced vehicle writes in threads. An unpaced one writes in its own loop instead (`FileStorage`,
`LogFolder`): the same flight then has the same results at the same step, and has no deadline.

`MediumTooSlowError(OSError)`: the queue of the thread is full. Any other exception of a write
becomes an OSError with its text, and the thread continues. A blocked medium does not keep the
program running: `close` waits at most `CLOSE_S`, and the threads are daemons.
"""

import errno
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Final, ParamSpec, TypeVar

from uav_firmware.cal.log_store import LogFile, LogStore
from uav_firmware.cal.storage import Storage, Write

LOG_BACKLOG_BYTES: Final = 16 * 1024 * 1024
"""Unwritten bytes at which a log ends: some minutes of it."""
STORAGE_BACKLOG: Final = 64
"""Largest number of pending saves."""
CLOSE_S: Final = 5.0
"""Longest wait for the medium at the end of the program."""

P = ParamSpec("P")
T = TypeVar("T")


class MediumTooSlowError(OSError):
    """The queue of writes is full."""

    def __init__(self) -> None:
        super().__init__(errno.EAGAIN, "the medium is too slow")


class _Worker:
    """A daemon thread that runs tasks in order; the result of each is in its Future.

    The interpreter waits for the threads of a ThreadPoolExecutor without bound when it ends.
    """

    def __init__(self, name: str) -> None:
        self._works: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Queue a task; its exception is stored as an OSError."""
        future: Future[T] = Future()

        def do() -> None:
            try:
                result = work(*args, **kwargs)
            except Exception as error:  # noqa: BLE001  # boundary of one task; stored in its Future
                future.set_exception(_refusal(error))
            else:
                future.set_result(result)

        self._works.put(do)
        return future

    def end(self) -> None:
        """End after the queued tasks."""
        self._works.put(None)

    def is_ended(self, timeout_s: float) -> bool:
        """Wait for the end."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (work := self._works.get()) is not None:
            work()


def _refusal(error: Exception) -> OSError:
    """An exception of a write as the OSError that its caller expects."""
    if isinstance(error, OSError):
        return error
    refusal = OSError(errno.EIO, f"{type(error).__name__}: {error}")
    refusal.__cause__ = error
    return refusal


class BackgroundStorage:
    """Implements `uav_firmware.cal.storage.Storage` over another one."""

    def __init__(self, storage: Storage) -> None:
        """Start the thread."""
        self._storage = storage
        self.thread = _Worker("storage")
        self._waiting: list[Future[None]] = []

    def load(self, name: str) -> bytes | None:
        """Contents stored under `name`, or None; waits for the writes before it."""
        return self.thread.submit(self._storage.load, name).result()

    def save(self, name: str, contents: bytes) -> Write:
        """Begin to replace the contents."""
        return self._begin(lambda: self._storage.save(name, contents).result())

    def remove(self, name: str) -> Write:
        """Begin to remove the contents."""
        return self._begin(lambda: self._storage.remove(name).result())

    def close(self) -> bool:
        """Wait up to `CLOSE_S`; return whether everything is written. Later writes are lost."""
        return close_all([self])

    def _begin(self, work: Callable[[], None]) -> Future[None]:
        self._waiting = [each for each in self._waiting if not each.done()]
        if len(self._waiting) >= STORAGE_BACKLOG:
            raise MediumTooSlowError
        write = self.thread.submit(work)
        self._waiting.append(write)
        return write


class BackgroundLogs:
    """Implements `uav_firmware.cal.log_store.LogStore` over another one."""

    def __init__(self, store: LogStore, *, backlog_bytes: int = LOG_BACKLOG_BYTES) -> None:
        """Start the thread; at most `backlog_bytes` may be pending."""
        self._store = store
        self.thread = _Worker("flight-log")
        self._backlog_bytes = backlog_bytes

    def free_bytes(self) -> int:
        """Free space of the medium [bytes], which the kernel reports without waiting.

        Raises:
            OSError: if the medium does not report it.
        """
        return self._store.free_bytes()

    def create(self, time_utc_us: int) -> LogFile:
        """Begin a file; an error is raised by a later write."""
        return _BackgroundLog(
            self.thread, lambda: self._store.create(time_utc_us), self._backlog_bytes
        )

    def close(self) -> bool:
        """Wait up to `CLOSE_S`; return whether everything is written. Later writes are lost."""
        return close_all([self])


def close_all(background: Sequence[BackgroundStorage | BackgroundLogs]) -> bool:
    """Wait up to `CLOSE_S` for all together; return whether everything is written."""
    deadline = time.monotonic() + CLOSE_S
    for each in background:
        each.thread.end()
    ended = [each.thread.is_ended(max(0.0, deadline - time.monotonic())) for each in background]
    return all(ended)


class _BackgroundLog:
    """Implements `uav_firmware.cal.log_store.LogFile`; after an error nothing more is written."""

    def __init__(self, thread: _Worker, create: Callable[[], LogFile], backlog_bytes: int) -> None:
        self._thread = thread
        self._backlog_bytes = backlog_bytes
        self._waiting_bytes = 0
        self._lock = Lock()
        self._refusal: OSError | None = None
        self._file = thread.submit(self._created, create)

    def write(self, chunk: bytes) -> None:
        """Append.

        Raises:
            OSError: if an earlier write has failed, or the queue is full.
        """
        self._check()
        with self._lock:
            if self._waiting_bytes + len(chunk) > self._backlog_bytes:
                raise MediumTooSlowError
            self._waiting_bytes += len(chunk)
        self._thread.submit(self._write, chunk)

    def sync(self) -> None:
        """Begin to sync the file to the medium.

        Raises:
            OSError: if an earlier write has failed.
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
        except Exception as error:  # noqa: BLE001  # stored: the next write raises it
            self._refusal = _refusal(error)
            return None

    def _write(self, chunk: bytes) -> None:
        try:
            self._run(lambda file: file.write(chunk))
        finally:
            with self._lock:
                self._waiting_bytes -= len(chunk)

    def _run(self, work: Callable[[LogFile], None]) -> None:
        """In the thread: the file has been created by then, since tasks run in order."""
        file = self._file.result()
        if file is None or self._refusal is not None:
            return
        try:
            work(file)
        except Exception as error:  # noqa: BLE001  # stored: the next write raises it
            self._refusal = _refusal(error)

    def _close(self) -> None:
        """In the thread; also after an error, since the file is still open."""
        file = self._file.result()
        if file is None:
            return
        try:
            file.close()
        except Exception as error:  # noqa: BLE001  # stored unless an earlier one is
            self._refusal = self._refusal or _refusal(error)
