"""The thread that keeps the connection to the broker, for all sending threads of the relay.

LinkEndedError  the thread has ended; the relay should start again
"""

import logging
import ssl
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from typing import Final, NamedTuple

from edge_server.outbox import wakeup
from edge_server.outbox.answers import Reply, Unreachable
from edge_server.outbox.uplink import UplinkEndedError
from edge_server.uplinks import tls_failures
from edge_server.uplinks.mqtt_connection import BrokerSettings, Connection, LoginError
from edge_server.uplinks.mqtt_protocol import BAD_LOGIN, SUCCESS, RecordPacket
from edge_server.uplinks.mqtt_session import (
    Action,
    Announce,
    Cut,
    Event,
    LinkState,
    Lost,
    Open,
    Publish,
    Refused,
    Session,
    Subscribe,
    Subscribed,
)

LOG = logging.getLogger(__name__)
LONGEST_STEP_S: Final = 1.0  # paho's keep-alive is served this often
STOP_WAIT_S: Final = 2.0


class LinkEndedError(UplinkEndedError):
    """The thread that keeps the connection has ended."""


class _Submitted(NamedTuple):
    """A record that a thread has submitted, and the future in which it waits for the reply."""

    packet: RecordPacket
    reply: "Future[Reply]"


class Link:
    """Keeps one connection, even when there is nothing to send, until it is closed."""

    def __init__(self, settings: BrokerSettings, session: Session) -> None:
        self._settings = settings
        self._session = session
        self._connection: Connection | None = None
        self._replies: dict[str, Future[Reply]] = {}
        self._last_fault = session.fault
        self._lock = threading.Lock()  # Guards the next three
        self._submitted: deque[_Submitted] = deque()
        self._stopping = False
        self._ended = False
        self._wake_read, self._wake_write = wakeup.open_pair()
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)
        self._thread.start()

    def deliver(self, packets: Sequence[RecordPacket]) -> list[Reply]:
        """Send packets and wait for the reply of the cloud, or of the broker, to each.

        Raises:
            LinkEndedError: if the thread has died.
        """
        submitted = [_Submitted(packet, Future()) for packet in packets]
        with self._lock:
            if self._stopping:
                return [Unreachable("the relay stops")] * len(submitted)
            if self._ended:
                raise LinkEndedError("the thread of the MQTT connection has ended")
            self._submitted.extend(submitted)
            wakeup.write(self._wake_write, changed=False)
        return [one.reply.result() for one in submitted]

    def close(self) -> None:
        """Disconnect in order if that is quick; every record in flight gets a reason."""
        with self._lock:
            if self._stopping:
                return
            self._stopping = True
            wakeup.write(self._wake_write, changed=False)
        self._thread.join(STOP_WAIT_S)
        if not self._thread.is_alive():
            wakeup.close(self._wake_read)
            wakeup.close(self._wake_write)

    def _run(self) -> None:
        """Keep the connection until `close`; when the thread fails, every waiting caller raises."""
        try:
            while not self._stopping:
                self._cycle(time.monotonic())
            self._leave()
        finally:
            with self._lock:
                self._ended = True
                waiting = [*self._replies.values(), *(one.reply for one in self._submitted)]
            for reply in waiting:
                reply.set_exception(LinkEndedError("the thread of the MQTT connection has ended"))

    def _cycle(self, now: float) -> None:
        self._take_submitted(now)
        self._act(self._session.step(now))
        self._resolve()
        self._step(
            min(max(self._session.next_step_at(now) - time.monotonic(), 0.0), LONGEST_STEP_S)
        )
        self._take_events(time.monotonic())
        self._resolve()
        self._log_fault()

    def _take_submitted(self, now: float) -> None:
        with self._lock:
            submitted, self._submitted = self._submitted, deque()
        for one in submitted:
            self._replies[one.packet.key] = one.reply
            self._session.submit(one.packet, now)

    def _act(self, actions: Sequence[Action]) -> None:
        for action in actions:
            match action:
                case Open():
                    self._open()
                case Cut():
                    self._drop()
                case _ if self._connection is not None:
                    self._send(self._connection, action)

    def _send(self, connection: Connection, action: Action) -> None:
        match action:
            case Subscribe() if self._settings.reads_answers:
                connection.subscribe()
            case Subscribe():
                connection.events.append(Subscribed(SUCCESS, "nothing to subscribe to"))
            case Announce():
                self._session.announced(connection.announce())
            case Publish(packet):
                self._session.sent(packet.key, connection.publish(packet), time.monotonic())

    def _open(self) -> None:
        """Connect; a failure becomes an event."""
        self._connection = connection = Connection(self._settings)
        try:
            connection.open()
        except LoginError as error:
            connection.events.append(Refused(BAD_LOGIN, str(error)))
        except ssl.SSLError as error:
            connection.events.append(Lost(tls_failures.describe("the broker", error)))
        except (OSError, ValueError) as error:  # The host name may be invalid
            connection.events.append(Lost(f"no connection to the broker ({type(error).__name__})"))
        else:
            self._session.opened(time.monotonic())

    def _drop(self) -> None:
        if self._connection is not None:
            self._connection.cut()
        self._connection = None

    def _step(self, timeout_s: float) -> None:
        """Serve the connection, or wait while there is none."""
        if self._connection is None:
            wakeup.wait([self._wake_read], timeout_s)
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

    def _resolve(self) -> None:
        for key, reply in self._session.take_settled():
            self._replies.pop(key).set_result(reply)

    def _log_fault(self) -> None:
        """Log the state of the connection: once per change."""
        fault = self._session.fault
        if fault == self._last_fault:
            return
        if fault:
            LOG.warning("MQTT: %s", fault)
        else:
            LOG.info("MQTT: connected as %s", self._settings.client_id)
        self._last_fault = fault

    def _leave(self) -> None:
        self._take_submitted(time.monotonic())
        if self._connection is not None:
            self._connection.leave()
        self._session.close(time.monotonic())
        self._resolve()
        self._drop()
