"""Packs messages, frames them per peer and sends them on the link."""

import struct
from collections.abc import Iterable
from typing import Final

from uav_firmware.cal.link import Link
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.streams import BUILDERS, build, component_of, message_of
from uav_firmware.modules.mavlink.wire.addressing import Outgoing
from uav_firmware.modules.mavlink.wire.dialect import Payload, frame, mavlink, pack
from uav_firmware.modules.mavlink.wire.peers import Channel, PeerTable

_HEARTBEAT: Final = mavlink.MAVLINK_MSG_ID_HEARTBEAT


class Transmitter:
    """Sends messages to peers; a message is packed once for all of them.

    A datagram has one frame, as with PX4, because some readers ignore further ones.
    """

    def __init__(self, link: Link, system_id: int, peers: PeerTable) -> None:
        self._link = link
        self._system_id = system_id
        self._peers = peers
        self.unpackable: int = 0

    def send(self, messages: Iterable[Outgoing]) -> None:
        """Send each message to its address, or to every peer."""
        for message, address, component in messages:
            payload = pack(message)
            for channel in self._peers if address is None else self._peers.only(address):
                self._frame(payload, channel, component)

    def stream(self, context: Context) -> None:
        """Send every peer the streams that are due; an unreachable peer gets HEARTBEAT only."""
        packed: dict[int, tuple[Payload, ...]] = {}
        for channel in self._peers:
            if channel.schedule.next_due_us > context.now_us:
                continue
            keys = channel.schedule.take_due(context.now_us)
            if channel.is_unreachable(context.now_us):
                keys = [key for key in keys if message_of(key) == _HEARTBEAT]
            for key in keys:
                if key not in packed:
                    packed[key] = self._build(key, context)
                for payload in packed[key]:
                    self._frame(payload, channel, component_of(key))

    def broadcast(self, keys: Iterable[int], context: Context) -> None:
        """Send streams to every peer now."""
        for key in keys:
            for payload in self._build(key, context):
                for channel in self._peers:
                    self._frame(payload, channel, component_of(key))

    def _build(self, key: int, context: Context) -> tuple[Payload, ...]:
        """Payloads of a stream; none while its contents are unknown.

        A message with a value that does not fit its field (a diverged estimate) is dropped.
        """
        try:
            return tuple([pack(message) for message in build(BUILDERS[key], context)])
        except (struct.error, OverflowError, ValueError):
            self.unpackable += 1
            return ()

    def _frame(self, payload: Payload, channel: Channel, component: int) -> None:
        signer = channel.signer
        datagram = frame(
            payload,
            channel.next_sequence(component),
            self._system_id,
            component,
            signed=signer is not None,
        )
        if signer is not None:
            datagram = signer.sign(datagram, channel.link_id)
        self._link.send(datagram, channel.address)
