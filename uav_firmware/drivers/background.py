"""Storage and flight logs written by a thread: the control loop waits for no medium.

A paced vehicle writes this way. One that flies as fast as the machine allows writes in its own
loop instead (`FileStorage`, `LogFolder`): the same flight then has the same outcome at the same
step, and no deadline is missed by waiting.

`MediumTooSlowError(OSError)`: the thread is so far behind that nothing more is taken. Whatever
else a write raises is its refusal, as an OSError with the text; it ends no thread. A medium that
hangs does not keep the program from its end: `close` waits for `CLOSE_S`, the threads are daemons.
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
"""A log of which so much waits to be written ends: some minutes of it."""
STORAGE_BACKLOG: Final = 64
"""Saves that may wait."""
CLOSE_S: Final = 5.0
"""How long the end of the program waits for a medium."""

P = ParamSpec("P")
T = TypeVar("T")


class MediumTooSlowError(OSError):
    """More waits to be written than may."""

    def __init__(self) -> None:
        super().__init__(errno.EAGAIN, "the medium is too slow")


class _Worker:
    """A daemon thread that does works in their order; the outcome of each is in its Future.

    The interpreter waits for the threads of a ThreadPoolExecutor without bound when it ends.
    """

    def __init__(self, name: str) -> None:
        self._works: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Do a work behind the others; what it raises is kept as an OSError."""
        future: Future[T] = Future()

        def do() -> None:
            try:
                result = work(*args, **kwargs)
            except Exception as error:  # noqa: BLE001  # the boundary of one work; kept for its owner
                future.set_exception(_refusal(error))
            else:
                future.set_result(result)

        self._works.put(do)
        return future

    def end(self) -> None:
        """End behind the works that wait."""
        self._works.put(None)

    def is_ended(self, timeout_s: float) -> bool:
        """Wait for the end."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (work := self._works.get()) is not None:
            work()


def _refusal(error: Exception) -> OSError:
    """An error of a medium's driver as the owner of the write expects it."""
    if isinstance(error, OSError):
        return error
    refusal = OSError(errno.EIO, f"{type(error).__name__}: {error}")
    refusal.__cause__ = error
    return refusal


class BackgroundStorage:
    """Implements `uav_firmware.cal.storage.Storage` over another one."""

    def __init__(self, storage: Storage) -> None:
        """Begin with nothing to write."""
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
        """Wait up to `CLOSE_S`; gives whether everything is written. Nothing more is taken."""
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
        """Begin with nothing to write; at most `backlog_bytes` may wait."""
        self._store = store
        self.thread = _Worker("flight-log")
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
            self.thread, lambda: self._store.create(time_utc_us), self._backlog_bytes
        )

    def close(self) -> bool:
        """Wait up to `CLOSE_S`; gives whether everything is written. Nothing more is taken."""
        return close_all([self])


def close_all(background: Sequence[BackgroundStorage | BackgroundLogs]) -> bool:
    """Wait up to `CLOSE_S` for all together; gives whether everything is written."""
    deadline = time.monotonic() + CLOSE_S
    for each in background:
        each.thread.end()
    ended = [each.thread.is_ended(max(0.0, deadline - time.monotonic())) for each in background]
    return all(ended)


class _BackgroundLog:
    """Implements `uav_firmware.cal.log_store.LogFile`; after a refusal nothing more is written."""

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
        except Exception as error:  # noqa: BLE001  # kept: the next write raises it
            self._refusal = _refusal(error)
            return None

    def _write(self, chunk: bytes) -> None:
        try:
            self._run(lambda file: file.write(chunk))
        finally:
            with self._lock:
                self._waiting_bytes -= len(chunk)

    def _run(self, work: Callable[[LogFile], None]) -> None:
        """In the thread: the file has been created by then, since works keep their order."""
        file = self._file.result()
        if file is None or self._refusal is not None:
            return
        try:
            work(file)
        except Exception as error:  # noqa: BLE001  # kept: the next write raises it
            self._refusal = _refusal(error)

    def _close(self) -> None:
        """In the thread; also after a refusal, since the file is open still."""
        file = self._file.result()
        if file is None:
            return
        try:
            file.close()
        except Exception as error:  # noqa: BLE001  # kept, unless an earlier one says more
            self._refusal = self._refusal or _refusal(error)
