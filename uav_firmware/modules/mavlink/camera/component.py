"""The camera component (100): commands, answers and reports of pictures.

Its messages have component id 100 and their own sequence numbers. The camera answers a command to
all components (0) that only it supports; the autopilot answers one that both support, so that each
command has one answer.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from uav_firmware.modules.mavlink.camera.reports import CameraReports
from uav_firmware.modules.mavlink.camera.requests import (
    OWN,
    SHARED,
    CameraRequests,
    is_sent_by_camera,
)
from uav_firmware.modules.mavlink.commands.command_server import CommandServer, CommandSink
from uav_firmware.modules.mavlink.commands.commands import FOR_GIMBAL, FOR_PAYLOAD
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.requests import RequestServer
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT, Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message
from uav_firmware.modules.mavlink.wire.peers import PeerTable
from uav_firmware.msg.payload import CancelOrder
from uav_firmware.msg.status import VehicleCommand, VehicleCommandAck
from uav_firmware.topics import Topics

KNOWN: Final = (FOR_PAYLOAD - FOR_GIMBAL) | OWN | SHARED
"""Commands that the camera supports."""


class CommandRouter:
    """Forwards a command to payload or commander."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics

    def publish(self, item: VehicleCommand) -> None:
        """Forward a command."""
        if item.command in FOR_PAYLOAD:
            self._topics.payload_order.publish(item)
        else:
            self._topics.vehicle_command.publish(item)

    def cancel(self, token: int) -> None:
        """Request cancellation of a command; ignored when it has ended."""
        self._topics.payload_order.publish(CancelOrder(0, token))


class CameraComponent:
    """Serves COMMAND_LONG, COMMAND_INT and COMMAND_CANCEL for the camera."""

    def __init__(
        self,
        *,
        system_id: int,
        topics: Topics,
        peers: PeerTable,
        context: Callable[[int], Context],
        sink: CommandSink,
        cancel: Callable[[int], None],
        tokens: Iterator[int],
    ) -> None:
        self._system_id = system_id
        self._reports = CameraReports(topics, peers, context)
        requests = RequestServer(peers, context, CAMERA_COMPONENT)
        self._commands = CommandServer(
            system_id=system_id,
            local_handlers=(CameraRequests(requests, self._reports).answer,),
            commander=sink,
            mission_length=lambda: 0,
            cancel=cancel,
            component=CAMERA_COMPONENT,
            known=KNOWN,
            tokens=tokens,
        )

    def is_for_camera(self, message: Message) -> bool:
        """Whether the camera answers a command."""
        if message.target_component == CAMERA_COMPONENT:
            return True
        if message.target_component != 0 or message.target_system not in {0, self._system_id}:
            return False
        number = message.command
        if number in SHARED:
            message_id = message.param1
            # Both components have a HEARTBEAT; the request means the autopilot's
            return 0.0 < message_id <= 0xFFFFFF and is_sent_by_camera(message_id)
        return number in OWN

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle a command."""
        return _as_camera(self._commands.handle(message, sender, now_us))

    def cancel(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle COMMAND_CANCEL."""
        return _as_camera(self._commands.cancel(message, sender, now_us))

    def tick(self, acks: Iterable[VehicleCommandAck], now_us: int) -> list[Outgoing]:
        """Send answers of payload, timeouts of commands, and reports of pictures."""
        outgoing = self._commands.answers(acks, now_us)
        outgoing += self._commands.tick(now_us)
        return _as_camera(outgoing) + self._reports.tick(now_us)


def _as_camera(outgoing: list[Outgoing]) -> list[Outgoing]:
    return [each._replace(component=CAMERA_COMPONENT) for each in outgoing]
