"""MAVFTP server: distributes requests to clients and limits their work.

Clients are served in turn; a token bucket limits work and data, which protects the control loop.
Two stations have the same ids where neither has been given its own, so a client is its ids and its
address.
"""

from typing import Final

from uav_firmware.cal.files import FileStore
from uav_firmware.modules.mavlink.files.client import FileClient
from uav_firmware.modules.mavlink.files.codec import Opcode, Reply, read_request
from uav_firmware.modules.mavlink.files.sessions import IDLE_LIMIT_US
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.token_bucket import TokenBucket

MAX_CLIENTS: Final = 8
_CLIENT_TIMEOUT_US: Final = 10_000_000
_REPLIES: Final = frozenset({Opcode.ACK, Opcode.NAK})
_HOUSEKEEPING_US: Final = 1_000_000


class FileServer:
    """Serves FILE_TRANSFER_PROTOCOL."""

    def __init__(self, *, system_id: int, store: FileStore, bucket: TokenBucket) -> None:
        """`store` is the tree of files, `bucket` limits the rate."""
        self._system_id = system_id
        self._store = store
        self._bucket = bucket
        self._clients: dict[Sender, FileClient] = {}
        self._housekeeping_us = 0

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle a request; return the messages to send at once."""
        if not is_for_us(message, self._system_id):
            return []
        request = read_request(bytes(message.payload))
        if request.opcode in _REPLIES:
            return []  # Answering replies could loop
        client = self._client(sender, now_us)
        if client is None:
            return []
        client.add_request(request, now_us)
        return self._work(now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Continue transfers."""
        if not self._clients:
            return []
        if now_us >= self._housekeeping_us:
            self._housekeeping_us = now_us + _HOUSEKEEPING_US
            for client in self._clients.values():
                client.close_idle(now_us - IDLE_LIMIT_US)
        return self._work(now_us)

    def _client(self, sender: Sender, now_us: int) -> FileClient | None:
        """The client that a sender is; None when there are too many."""
        client = self._clients.get(sender)
        if client is not None:
            return client
        if len(self._clients) >= MAX_CLIENTS and not self._drop_idle_client(now_us):
            return None
        client = self._clients[sender] = FileClient(self._store, now_us)
        return client

    def _drop_idle_client(self, now_us: int) -> bool:
        """Drop the client with the oldest request if it is idle or has timed out."""
        sender, client = min(self._clients.items(), key=lambda item: item[1].received_us)
        if not client.is_idle and now_us - client.received_us < _CLIENT_TIMEOUT_US:
            return False
        client.close()
        del self._clients[sender]
        return True

    def _work(self, now_us: int) -> list[Outgoing]:
        """Serve the clients in turn while there are tokens and work."""
        self._bucket.refill(now_us)
        outgoing: list[Outgoing] = []
        busy = [(sender, client) for sender, client in self._clients.items() if client.has_work]
        while busy:
            for sender, client in busy:
                if not self._bucket.ready:
                    return outgoing
                reply, cost = client.step(now_us)
                self._bucket.spend(cost)
                if reply is not None:
                    outgoing.append(_message(reply, sender))
            busy = [(sender, client) for sender, client in busy if client.has_work]
        return outgoing


def _message(reply: Reply, sender: Sender) -> Outgoing:
    message = mavlink.MAVLink_file_transfer_protocol_message(
        target_network=0,
        target_system=sender.system,
        target_component=sender.component,
        payload=reply.pack(),
    )
    return Outgoing(message, sender.address)
