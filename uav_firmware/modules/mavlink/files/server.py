"""The file server: whose request it is, and when there is time for it.

Every client (system and component) is served for itself, in turn with the others; the pace
bounds what is done and sent, so that no number of requests takes the control loop's time.
"""

from typing import Final

from uav_firmware.cal.files import FileStore
from uav_firmware.modules.mavlink.files.client import FileClient
from uav_firmware.modules.mavlink.files.codec import Opcode, Reply, read_request
from uav_firmware.modules.mavlink.files.sessions import IDLE_LIMIT_US
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.pace import Pace

MAX_CLIENTS: Final = 8
_SILENT_US: Final = 10_000_000
_REPLIES: Final = frozenset({Opcode.ACK, Opcode.NAK})
_HOUSEKEEPING_US: Final = 1_000_000


class _Seat:
    """A client and where it is reached."""

    __slots__ = ("client", "sender")

    def __init__(self, client: FileClient, sender: Sender) -> None:
        self.client = client
        self.sender = sender


class FileServer:
    """Serves FILE_TRANSFER_PROTOCOL."""

    def __init__(self, *, system_id: int, store: FileStore, pace: Pace) -> None:
        """Take the tree of files that clients see, and the pace of bulk data."""
        self._system_id = system_id
        self._store = store
        self._pace = pace
        self._seats: dict[tuple[int, int], _Seat] = {}
        self._housekeeping_us = 0

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take a request; gives what can be sent at once."""
        if not is_for_us(message, self._system_id):
            return []
        request = read_request(bytes(message.payload))
        if request.opcode in _REPLIES:
            return []  # To answer an answer would never end
        seat = self._seat(sender, now_us)
        if seat is None:
            return []
        seat.sender = sender
        seat.client.ask(request, now_us)
        return self._work(now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Go on with what is under way."""
        if not self._seats:
            return []
        if now_us >= self._housekeeping_us:
            self._housekeeping_us = now_us + _HOUSEKEEPING_US
            for seat in self._seats.values():
                seat.client.close_idle(now_us - IDLE_LIMIT_US)
        return self._work(now_us)

    def _seat(self, sender: Sender, now_us: int) -> _Seat | None:
        """The client that a sender is; None when as many are served as can be."""
        seat = self._seats.get(sender.identity)
        if seat is not None:
            return seat
        if len(self._seats) >= MAX_CLIENTS and not self._free_a_seat(now_us):
            return None
        seat = _Seat(FileClient(self._store, now_us), sender)
        self._seats[sender.identity] = seat
        return seat

    def _free_a_seat(self, now_us: int) -> bool:
        """Let the client go that has been silent longest, if it can be missed."""
        identity, seat = min(self._seats.items(), key=lambda item: item[1].client.heard_us)
        if not seat.client.is_idle and now_us - seat.client.heard_us < _SILENT_US:
            return False
        seat.client.leave()
        del self._seats[identity]
        return True

    def _work(self, now_us: int) -> list[Outgoing]:
        """Serve the clients in turn while there is time and something to do."""
        self._pace.refill(now_us)
        outgoing: list[Outgoing] = []
        busy = [seat for seat in self._seats.values() if seat.client.has_work]
        while busy:
            for seat in busy:
                if not self._pace.ready:
                    return outgoing
                reply, cost = seat.client.step(now_us)
                self._pace.spend(cost)
                if reply is not None:
                    outgoing.append(_message(reply, seat.sender))
            busy = [seat for seat in busy if seat.client.has_work]
        return outgoing


def _message(reply: Reply, sender: Sender) -> Outgoing:
    message = mavlink.MAVLink_file_transfer_protocol_message(
        target_network=0,
        target_system=sender.system,
        target_component=sender.component,
        payload=reply.pack(),
    )
    return Outgoing(message, sender.address)
