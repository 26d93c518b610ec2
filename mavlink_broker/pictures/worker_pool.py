"""Runs slow jobs on threads: downloads and converts pictures, and has logs and frames sent.

The web servers are those of the vehicles' cameras, in private networks. A download is one file over
http or https, without redirects; it fails when the server is slow or sends too much. Pictures that
fit are not changed; larger ones are shrunk by a separate process, which a hostile picture may
crash.
"""

import base64
import logging
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from itertools import chain
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import requests

from afarcloud.enumerations import ImageFormat
from afarcloud.state import MAXIMUM_FRAME_BYTES
from mavlink_broker.edge.bounded_http import BoundedHttp, TooLargeError
from mavlink_broker.effects import (
    ConvertedPicture,
    ConvertPicture,
    Downloaded,
    FetchUrl,
    Job,
    JobOutcome,
    LogJob,
    SendFrames,
    failed,
)
from mavlink_broker.pictures import shrink
from mavlink_broker.supervision import SupervisedThread, reason_of

CONNECT_TIMEOUT_S: Final = 5.0
READ_TIMEOUT_S: Final = 10.0
TOTAL_TIMEOUT_S: Final = 120.0
SHRINK_TIMEOUT_S: Final = 60.0
THREADS: Final[Mapping[type[Job], int]] = {
    FetchUrl: 8,
    ConvertPicture: 2,
    LogJob: 1,
    SendFrames: 1,
}
"""Downloads wait for web servers, at most one per vehicle; conversions use the processor; logs are
sent to the edge server one part at a time, and frames beside them."""

_SHRINK_PROGRAM: Final = Path(shrink.__file__)
_LOG = logging.getLogger(__name__)


class JobError(Exception):
    """A job has failed; the text says why."""


class Finished(NamedTuple):
    """The outcome of a job, and the system id of its vehicle."""

    system: int
    outcome: JobOutcome


def format_of(data: bytes) -> ImageFormat | None:
    """Format of a picture by its first bytes; None for one that AFarCloud does not know."""
    if data.startswith(b"\xff\xd8\xff"):
        return ImageFormat.JPEG
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return ImageFormat.PNG
    if data.startswith((b"II*\x00", b"MM\x00*")):
        return ImageFormat.TIFF
    is_webp = data.startswith(b"RIFF") and data[8:12] == b"WEBP"
    return ImageFormat.WEBP if is_webp else None


def convert(job: ConvertPicture) -> ConvertedPicture:
    """Convert a picture to a format and size that AFarCloud accepts.

    Raises:
        JobError: if it is not a readable picture, or cannot be made small enough.
    """
    data, kind = job.data, format_of(job.data)
    if kind is None or len(data) > MAXIMUM_FRAME_BYTES:
        data, kind = _shrink(data), ImageFormat.JPEG
    return ConvertedPicture(job.number, kind, base64.b64encode(data).decode("ascii"), len(data))


def _shrink(data: bytes) -> bytes:
    command = [sys.executable, "-I", str(_SHRINK_PROGRAM), str(MAXIMUM_FRAME_BYTES)]
    try:
        done = subprocess.run(  # noqa: S603  # our own program, and no shell
            command, input=data, capture_output=True, timeout=SHRINK_TIMEOUT_S, check=False
        )
    except (subprocess.TimeoutExpired, OSError) as error:
        raise JobError(f"it cannot be made smaller: {error}") from error
    if done.returncode != 0 or not 0 < len(done.stdout) <= MAXIMUM_FRAME_BYTES:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        reason = lines[-1][:200] if lines else f"status {done.returncode}"
        raise JobError(f"it cannot be converted: {reason}")
    return done.stdout


def download(job: FetchUrl) -> Downloaded:
    """Download a file of a web server.

    Raises:
        JobError: if it is not received completely, or is too large.
    """
    try:
        with BoundedHttp() as http:
            answer = http.exchange(
                "GET",
                job.url,
                within_s=TOTAL_TIMEOUT_S,
                timeouts_s=(CONNECT_TIMEOUT_S, READ_TIMEOUT_S),
                max_bytes=job.limit_bytes,
            )
    except TooLargeError as error:
        raise JobError(str(error)) from error
    except requests.RequestException as error:
        raise JobError(f"the download failed: {error}") from error
    if answer.status_code != HTTPStatus.OK:
        raise JobError(f"the web server answers HTTP {answer.status_code}")
    if not answer.body:
        raise JobError("it is empty")
    return Downloaded(job.number, answer.body)


Handler: TypeAlias = Callable[..., JobOutcome]
_HANDLERS: Final[Mapping[type[Job], Handler]] = {FetchUrl: download, ConvertPicture: convert}


class WorkerPool:
    """Runs jobs on threads; `wake` is called after each outcome."""

    def __init__(
        self, wake: Callable[[], None], uploaders: Mapping[type[Job], Handler] | None = None
    ) -> None:
        """`uploaders` carry out the jobs that need the edge server, each on one thread.

        Without them such jobs fail.
        """
        self._wake = wake
        self._handlers = {**_HANDLERS, **(uploaders or {})}
        self._jobs: dict[type[Job], queue.SimpleQueue[tuple[int, Job] | None]] = {
            kind: queue.SimpleQueue() for kind in THREADS
        }
        self._finished: queue.SimpleQueue[Finished] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._threads = {
            kind: [
                SupervisedThread(
                    f"{kind.__name__}-{number}", partial(self._work, kind), self._stopping
                )
                for number in range(count)
            ]
            for kind, count in THREADS.items()
        }

    def start(self) -> None:
        """Start the threads."""
        for thread in chain.from_iterable(self._threads.values()):
            thread.start()

    def stop(self) -> None:
        """Start no more jobs; daemon threads do not delay the end of the program."""
        self._stopping.set()
        for kind, threads in self._threads.items():
            for _ in threads:
                self._jobs[kind].put(None)

    def put(self, system: int, job: Job) -> None:
        """Queue a job of a vehicle."""
        self._jobs[type(job)].put((system, job))

    def take_finished(self) -> list[Finished]:
        """Return the outcomes since the last call."""
        finished = []
        while not self._finished.empty():
            finished.append(self._finished.get_nowait())
        return finished

    def _work(self, kind: type[Job]) -> None:
        while (task := self._jobs[kind].get()) is not None:
            system, job = task
            self._finished.put(Finished(system, run_job(job, self._handlers)))
            self._wake()


def run_job(job: Job, handlers: Mapping[type[Job], Handler] = _HANDLERS) -> JobOutcome:
    """Run one job; a failure is an outcome too."""
    try:
        handler = handlers.get(type(job))
        return failed(job, "this program sends no logs") if handler is None else handler(job)
    except JobError as error:
        _LOG.info("picture %d: %s", job.number, error)
        return failed(job, str(error))
    except Exception as error:  # noqa: BLE001  # the boundary of one job, logged
        _LOG.exception("%s %d", type(job).__name__, job.number)
        return failed(job, reason_of(error))
