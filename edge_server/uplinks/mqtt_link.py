"""The thread that keeps the connection to the broker, for all workers of the relay.

LinkEndedError  the thread has ended; the relay should start again
"""

import logging
import os
import select
import ssl
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Final, NamedTuple

from edge_server.outbox import wakeup
from edge_server.outbox.answers import Reply, Unreachable
from edge_server.outbox.uplink import UplinkEndedError
from edge_server.uplinks.mqtt_connection import BrokerSettings, Connection
from edge_server.uplinks.mqtt_login import LoginError
from edge_server.uplinks.mqtt_messages import (
    Action,
    Announce,
    Cut,
    Event,
    Lost,
    Open,
    Publish,
    RecordPacket,
    Refused,
    Subscribe,
    Subscribed,
)
from edge_server.uplinks.mqtt_reasons import BAD_LOGIN, SUCCESS
from edge_server.uplinks.mqtt_session import Session
from edge_server.uplinks.mqtt_states import LinkState

LOG = logging.getLogger(__name__)
LONGEST_STEP_S: Final = 1.0  # Keep-alive is looked after this often
STOP_WAIT_S: Final = 2.0


class LinkEndedError(UplinkEndedError):
    """The thread that keeps the connection has ended."""


class _Order(NamedTuple):
    """A record that a worker wants to be sent, and where it waits for the reply."""

    packet: RecordPacket
    reply: "Future[Reply]"


class Link:
    """Keeps one connection, even when there is nothing to send, until it is closed."""

    def __init__(self, settings: BrokerSettings, session: Session) -> None:
        self._settings = settings
        self._session = session
        self._connection: Connection | None = None
        self._replies: dict[str, Future[Reply]] = {}
        self._told = session.trouble
        self._lock = threading.Lock()  # Of the orders and of whether we take any
        self._orders: deque[_Order] = deque()
        self._stopping = False
        self._ended = False
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)
        self._thread.start()

    def deliver(self, packets: Sequence[RecordPacket]) -> list[Reply]:
        """Send packets and wait for what the cloud, or the broker, says to each.

        Raises:
            LinkEndedError: if the thread has died.
        """
        orders = [_Order(packet, Future()) for packet in packets]
        with self._lock:
            if self._stopping:
                return [Unreachable("the relay stops")] * len(orders)
            if self._ended:
                raise LinkEndedError("the thread of the MQTT connection has ended")
            self._orders.extend(orders)
            self._wake()
        return [order.reply.result() for order in orders]

    def close(self) -> None:
        """Leave the broker in order, if that is quick; what is under way gets a reason."""
        with self._lock:
            if self._stopping:
                return
            self._stopping = True
            self._wake()
        self._thread.join(STOP_WAIT_S)
        if not self._thread.is_alive():
            os.close(self._wake_read)
            os.close(self._wake_write)

    def _wake(self) -> None:
        with suppress(BlockingIOError):  # So many wake-ups are there already
            os.write(self._wake_write, b"\n")

    def _run(self) -> None:
        """Keep the connection until `close`; whoever waits is told when we cannot go on."""
        try:
            while not self._stopping:
                self._turn(time.monotonic())
            self._leave()
        finally:
            with self._lock:
                self._ended = True
                waiting = [*self._replies.values(), *(order.reply for order in self._orders)]
            for reply in waiting:
                reply.set_exception(LinkEndedError("the thread of the MQTT connection has ended"))

    def _turn(self, now: float) -> None:
        self._take_orders(now)
        self._act(self._session.turn(now))
        self._hand_back()
        self._step(min(max(self._session.wake_at(now) - time.monotonic(), 0.0), LONGEST_STEP_S))
        self._take_events(time.monotonic())
        self._hand_back()
        self._tell()

    def _take_orders(self, now: float) -> None:
        with self._lock:
            orders, self._orders = self._orders, deque()
        for order in orders:
            self._replies[order.packet.key] = order.reply
            self._session.offer(order.packet, now)

    def _act(self, actions: Sequence[Action]) -> None:
        for action in actions:
            match action:
                case Open():
                    self._open()
                case Cut():
                    self._drop()
                case _ if self._connection is not None:
                    self._speak(self._connection, action)

    def _speak(self, connection: Connection, action: Action) -> None:
        match action:
            case Subscribe() if self._settings.hears_answers:
                connection.subscribe()
            case Subscribe():
                connection.events.append(Subscribed(SUCCESS, "nothing to hear"))
            case Announce():
                self._session.announced(connection.announce())
            case Publish(packet):
                self._session.sent(packet.key, connection.publish(packet), time.monotonic())

    def _open(self) -> None:
        """Connect; what prevents it is an event like any other."""
        self._connection = connection = Connection(self._settings)
        try:
            connection.open()
        except LoginError as error:
            connection.events.append(Refused(BAD_LOGIN, str(error)))
        except ssl.SSLError:
            connection.events.append(Lost("the broker's certificate, or ours, is not accepted"))
        except (OSError, ValueError) as error:  # A host's name may be none
            connection.events.append(Lost(f"no connection to the broker ({type(error).__name__})"))
        else:
            self._session.opened(time.monotonic())

    def _drop(self) -> None:
        if self._connection is not None:
            self._connection.cut()
        self._connection = None

    def _step(self, timeout_s: float) -> None:
        """Let the network move, or just wait."""
        if self._connection is None:
            select.select([self._wake_read], [], [], timeout_s)
        elif not self._connection.events:
            self._connection.step(self._wake_read, timeout_s)
        wakeup.drain(self._wake_read)

    def _take_events(self, now: float) -> None:
        connection = self._connection
        while connection is not None and connection.events:
            events: list[Event] = list(connection.events)
            connection.events.clear()
            for event in events:
                self._act(self._session.handle(event, now))
        if self._session.state is LinkState.DOWN:
            self._drop()

    def _hand_back(self) -> None:
        for key, reply in self._session.settled():
            self._replies.pop(key).set_result(reply)

    def _tell(self) -> None:
        """Log what an operator should know: once per change."""
        trouble = self._session.trouble
        if trouble == self._told:
            return
        if trouble:
            LOG.warning("MQTT: %s", trouble)
        else:
            LOG.info("MQTT: connected as %s", self._settings.client_id)
        self._told = trouble

    def _leave(self) -> None:
        self._take_orders(time.monotonic())
        if self._connection is not None:
            self._connection.leave()
        self._session.close(time.monotonic())
        self._hand_back()
        self._drop()
