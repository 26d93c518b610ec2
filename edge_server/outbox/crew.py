"""The relay's threads that talk to the cloud: shipments in, verdicts out, a byte for each answer.

WorkerDiedError  a thread has failed; the relay should start again
"""

import logging
import os
import queue as threads_queue
import threading
from typing import NamedTuple

from edge_server.outbox import wakeup
from edge_server.outbox.answers import Verdict, judge
from edge_server.outbox.schedule import Shipment
from edge_server.outbox.uplink import Uplink

LOG = logging.getLogger(__name__)


class WorkerDiedError(Exception):
    """A thread that talks to the cloud has failed; its error is in the log."""


class Answered(NamedTuple):
    """A shipment and a verdict for each of its records."""

    shipment: Shipment
    verdicts: list[Verdict]


class Crew:
    """So many threads over one uplink."""

    def __init__(self, uplink: Uplink, workers: int) -> None:
        self._uplink = uplink
        self._orders: threads_queue.SimpleQueue[Shipment | None] = threads_queue.SimpleQueue()
        self._answers: threads_queue.SimpleQueue[Answered] = threads_queue.SimpleQueue()
        self._bell_read, self._bell_write = os.pipe()
        os.set_blocking(self._bell_read, False)
        self._one_left = threading.Event()
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(workers)]

    @property
    def bell(self) -> int:
        """A descriptor that can be read when there is something new."""
        return self._bell_read

    def start(self) -> None:
        """Begin to work."""
        for thread in self._threads:
            thread.start()

    def ring(self) -> None:
        """Make the bell's descriptor readable; may be called from a signal handler."""
        os.write(self._bell_write, b"\n")

    def send(self, shipment: Shipment) -> None:
        """Have a shipment sent."""
        self._orders.put(shipment)

    def answers(self) -> list[Answered]:
        """Take what has been answered; raises WorkerDiedError."""
        wakeup.drain(self._bell_read)
        if self._one_left.is_set():
            raise WorkerDiedError("a thread of the relay ended; see the error above")
        found = []
        while not self._answers.empty():
            found.append(self._answers.get())
        return found

    def dismiss(self) -> None:
        """Let the threads end, and cut what is still under way."""
        for _ in self._threads:
            self._orders.put(None)
        self._uplink.close()

    def _work(self) -> None:
        """One thread: take a shipment, send it, hand the verdicts back."""
        try:
            while (shipment := self._orders.get()) is not None:
                replies = self._uplink.send(shipment.parcels)
                self._answers.put(Answered(shipment, [judge(reply) for reply in replies]))
                self.ring()
        except Exception:  # Whatever it was, the relay has to end: `answers` raises for it
            LOG.exception("a thread that talks to the cloud has failed")
            self._one_left.set()
            self.ring()
