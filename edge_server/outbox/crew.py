"""The relay's threads that talk to the cloud: shipments in, verdicts out, a byte for each answer.

WorkerDiedError  the uplink has ended; the relay should start again
"""

import logging
import os
import queue as threads_queue
import threading
from typing import NamedTuple

from edge_server.outbox import wakeup
from edge_server.outbox.answers import Failed, Verdict, judge
from edge_server.outbox.schedule import Shipment
from edge_server.outbox.uplink import Uplink, UplinkEndedError

LOG = logging.getLogger(__name__)


class WorkerDiedError(Exception):
    """The uplink has ended; its error is in the log."""


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
            raise WorkerDiedError("the uplink has ended; see the error above")
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
        while (shipment := self._orders.get()) is not None:
            try:
                verdicts = self._verdicts(shipment)
            except UplinkEndedError:
                LOG.exception("the uplink has ended")
                self._one_left.set()
            else:
                self._answers.put(Answered(shipment, verdicts))
            self.ring()

    def _verdicts(self, shipment: Shipment) -> list[Verdict]:
        """Send a shipment; an error that nobody has foreseen puts off its streams and no others.

        It is logged with its traceback each time. The thread goes on, since whatever one record
        does must not keep the others, alarms among them, from the cloud.
        """
        try:
            return [judge(reply) for reply in self._uplink.send(shipment.parcels)]
        except UplinkEndedError:
            raise
        except Exception as error:
            LOG.exception("%d records could not be sent", len(shipment.parcels))
            reason = f"an error in the edge server ({type(error).__name__})"
            return [judge(Failed(reason))] * len(shipment.parcels)
