"""The relay's sending threads: batches in, results out, a byte in a socket for each result.

SenderEndedError  the uplink has ended; the relay should start again
"""

import contextlib
import logging
import queue as thread_queue
import socket
import threading
from typing import NamedTuple

from edge_server.outbox import wakeup
from edge_server.outbox.answers import Failed, Result, classify
from edge_server.outbox.schedule import Batch
from edge_server.outbox.uplink import Uplink, UplinkEndedError

LOG = logging.getLogger(__name__)


class SenderEndedError(Exception):
    """The uplink has ended; its error is in the log."""


class SentBatch(NamedTuple):
    """A batch and a result for each of its records."""

    batch: Batch
    results: list[Result]


class SenderPool:
    """A number of threads that send over one uplink; with none of them the caller sends."""

    def __init__(self, uplink: Uplink, threads: int) -> None:
        self._uplink = uplink
        self._to_send: thread_queue.SimpleQueue[Batch | None] = thread_queue.SimpleQueue()
        self._sent: thread_queue.SimpleQueue[SentBatch] = thread_queue.SimpleQueue()
        # Sockets and no pipe: one that is closed has no number that another file may get
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.settimeout(0.0)
        self._wake_write.settimeout(0.0)
        self._has_ended = threading.Event()
        self._threads = [threading.Thread(target=self._run, daemon=True) for _ in range(threads)]

    @property
    def descriptor(self) -> int:
        """A file descriptor that is readable when `take_sent` has something new."""
        return self._wake_read.fileno()

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """Make `descriptor` readable; may be called from a signal handler, also after `close`."""
        with contextlib.suppress(OSError):  # It is readable already, or closed
            self._wake_write.send(b"\n")

    def send(self, batch: Batch) -> None:
        """Have a batch sent by the next free thread; without threads, send it and wait."""
        if self._threads:
            self._to_send.put(batch)
        else:
            self._serve(batch)

    def take_sent(self) -> list[SentBatch]:
        """Return the batches that have been answered since the last call.

        Raises:
            SenderEndedError: if the uplink has ended.
        """
        wakeup.drain(self.descriptor)
        if self._has_ended.is_set():
            raise SenderEndedError("the uplink has ended; see the error above")
        found = []
        while not self._sent.empty():
            found.append(self._sent.get())
        return found

    def close(self) -> None:
        """Let the threads end, and cut off what is in flight; its results are lost."""
        for _ in self._threads:
            self._to_send.put(None)
        self._uplink.close()
        self._wake_read.close()
        self._wake_write.close()

    def _run(self) -> None:
        """One thread: take a batch, send it, return its results."""
        while (batch := self._to_send.get()) is not None:
            self._serve(batch)

    def _serve(self, batch: Batch) -> None:
        try:
            results = self._results(batch)
        except UplinkEndedError:
            LOG.exception("the uplink has ended")
            self._has_ended.set()
        else:
            self._sent.put(SentBatch(batch, results))
        self.wake()

    def _results(self, batch: Batch) -> list[Result]:
        """Send a batch; an unexpected error puts off the streams of the batch and no others.

        It is logged with its traceback each time. The thread continues, because no record may keep
        the others, alarms among them, from the cloud.
        """
        try:
            return [classify(reply) for reply in self._uplink.send(batch.records)]
        except UplinkEndedError:
            raise
        except Exception as error:
            LOG.exception("%d records could not be sent", len(batch.records))
            reason = f"an error in the edge server ({type(error).__name__})"
            return [classify(Failed(reason))] * len(batch.records)
