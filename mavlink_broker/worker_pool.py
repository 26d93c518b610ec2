"""Does what takes long on a thread of its own: pictures from web servers, pictures made to fit.

Web servers are those of the vehicles' cameras, in private networks. They are asked for one file,
over http or https, never follow up elsewhere, and are given up when they are slow or send too
much. Pictures that fit are passed on as they are; larger ones are shrunk by a program of its own,
which may die of a hostile one.
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
from typing import Final, NamedTuple

import requests

from afarcloud.enumerations import ImageFormat
from afarcloud.state import MAXIMUM_FRAME_BYTES
from mavlink_broker.edge.bounded_http import BoundedHttp, TooLargeError
from mavlink_broker.internal_errors import reason_of
from mavlink_broker.jobs import Develop, Developed, Downloaded, FetchUrl, Job, JobFailed, JobOutcome
from mavlink_broker.pictures import shrink
from mavlink_broker.supervision import SupervisedThread

CONNECT_S: Final = 5.0
SILENCE_S: Final = 10.0
WHOLE_S: Final = 120.0
SHRINK_S: Final = 60.0
THREADS: Final[Mapping[type[Job], int]] = {FetchUrl: 8, Develop: 2}
"""Web servers keep a thread waiting, each vehicle's at most one; pictures keep a processor busy."""

_SHRINK: Final = Path(shrink.__file__)
_LOG = logging.getLogger(__name__)


class WorkshopError(Exception):
    """A job that could not be done; its text says why."""


class Finished(NamedTuple):
    """What became of a job, and for whom it was."""

    system: int
    outcome: JobOutcome


def format_of(data: bytes) -> ImageFormat | None:
    """Tell a picture's format by its first bytes; None for one that AFarCloud does not know."""
    if data.startswith(b"\xff\xd8\xff"):
        return ImageFormat.JPEG
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return ImageFormat.PNG
    if data.startswith((b"II*\x00", b"MM\x00*")):
        return ImageFormat.TIFF
    is_webp = data.startswith(b"RIFF") and data[8:12] == b"WEBP"
    return ImageFormat.WEBP if is_webp else None


def develop(job: Develop) -> Developed:
    """Make what AFarCloud takes of a picture.

    Raises:
        WorkshopError: if it cannot be read, or does not become small enough.
    """
    data, kind = job.data, format_of(job.data)
    if kind is None or len(data) > MAXIMUM_FRAME_BYTES:
        data, kind = _shrunk(data), ImageFormat.JPEG
    return Developed(job.number, kind, base64.b64encode(data).decode("ascii"), len(data))


def _shrunk(data: bytes) -> bytes:
    command = [sys.executable, "-I", str(_SHRINK), str(MAXIMUM_FRAME_BYTES)]
    try:
        done = subprocess.run(  # noqa: S603  # our own program, and no shell
            command, input=data, capture_output=True, timeout=SHRINK_S, check=False
        )
    except (subprocess.TimeoutExpired, OSError) as error:
        raise WorkshopError(f"it cannot be made smaller: {error}") from error
    if done.returncode != 0 or not 0 < len(done.stdout) <= MAXIMUM_FRAME_BYTES:
        words = done.stderr.decode("utf-8", "replace").strip().splitlines()
        reason = words[-1][:200] if words else f"status {done.returncode}"
        raise WorkshopError(f"it is no picture that can be made smaller: {reason}")
    return done.stdout


def download(job: FetchUrl) -> Downloaded:
    """Get a file of a web server.

    Raises:
        WorkshopError: if it does not come, or is too large.
    """
    try:
        answer = BoundedHttp().exchange(
            "GET",
            job.url,
            within_s=WHOLE_S,
            timeouts_s=(CONNECT_S, SILENCE_S),
            most_bytes=job.limit_bytes,
        )
    except TooLargeError as error:
        raise WorkshopError(str(error)) from error
    except requests.RequestException as error:
        raise WorkshopError(f"the web server does not give it: {error}") from error
    if answer.status_code != HTTPStatus.OK:
        raise WorkshopError(f"the web server answers HTTP {answer.status_code}")
    if not answer.body:
        raise WorkshopError("it is empty")
    return Downloaded(job.number, answer.body)


class Workshop:
    """Takes jobs and gives outcomes; `wake` is called when one is there."""

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
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
        """Begin to work."""
        for thread in chain.from_iterable(self._threads.values()):
            thread.start()

    def stop(self) -> None:
        """Begin no more jobs; daemon threads do not hold the program up."""
        self._stopping.set()
        for kind, threads in self._threads.items():
            for _ in threads:
                self._jobs[kind].put(None)

    def put(self, system: int, job: Job) -> None:
        """Have a job done for a vehicle."""
        self._jobs[type(job)].put((system, job))

    def take_finished(self) -> list[Finished]:
        """Give what has been done."""
        finished = []
        while not self._finished.empty():
            finished.append(self._finished.get_nowait())
        return finished

    def _work(self, kind: type[Job]) -> None:
        while (task := self._jobs[kind].get()) is not None:
            system, job = task
            self._finished.put(Finished(system, do(job)))
            self._wake()


_HANDLERS: Final[Mapping[type[Job], Callable[..., JobOutcome]]] = {
    FetchUrl: download,
    Develop: develop,
}


def do(job: Job) -> JobOutcome:
    """Do one job; what goes wrong is an outcome too, for somebody waits for it."""
    try:
        return _HANDLERS[type(job)](job)
    except WorkshopError as error:
        _LOG.info("picture %d: %s", job.number, error)
        return JobFailed(job.number, str(error))
    except Exception as error:  # noqa: BLE001  # the boundary of one job, logged
        _LOG.exception("picture %d", job.number)
        return JobFailed(job.number, reason_of(error))
