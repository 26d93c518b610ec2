"""The camera component (100): its commands, its pictures, its answers.

Everything it says is sent as component 100, with that component's own sequence numbers. A
command to all components (0) that only the camera can answer is the camera's; one that both
could carry out is the autopilot's, so that each command has one answer.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from uav_firmware.modules.mavlink.camera.reports import CameraReports
from uav_firmware.modules.mavlink.camera.requests import OWN, SHARED, CameraRequests, speaks
from uav_firmware.modules.mavlink.commands.command_server import CommandServer, CommandSink
from uav_firmware.modules.mavlink.commands.commands import FOR_GIMBAL, FOR_PAYLOAD
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.requests import RequestServer
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT, Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message
from uav_firmware.modules.mavlink.wire.peers import PeerTable
from uav_firmware.msg.payload import CancelOrder
from uav_firmware.msg.status import VehicleCommand, VehicleCommandAck

KNOWN: Final = (FOR_PAYLOAD - FOR_GIMBAL) | OWN | SHARED
"""Commands that the camera does not refuse at once."""


class CommandRouter:
    """Hands a command to whoever carries it out: payload or commander."""

    def __init__(self, topics: MavlinkTopics) -> None:
        self._topics = topics

    def publish(self, item: VehicleCommand) -> None:
        """Hand a command on."""
        if item.command in FOR_PAYLOAD:
            self._topics.payload_order.publish(item)
        else:
            self._topics.vehicle_command.publish(item)

    def cancel(self, token: int) -> None:
        """Ask for the end of a command; what nobody carries out any more is ignored."""
        self._topics.payload_order.publish(CancelOrder(0, token))


class CameraComponent:
    """Serves COMMAND_LONG, COMMAND_INT and COMMAND_CANCEL for the camera."""

    def __init__(
        self,
        *,
        system_id: int,
        topics: MavlinkTopics,
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
            answerers=(CameraRequests(requests, self._reports).answer,),
            commander=sink,
            mission_length=lambda: 0,
            cancel=cancel,
            component=CAMERA_COMPONENT,
            known=KNOWN,
            tokens=tokens,
        )

    def is_meant(self, message: Message) -> bool:
        """Whether a command is the camera's to answer."""
        if message.target_component == CAMERA_COMPONENT:
            return True
        if message.target_component != 0 or message.target_system not in {0, self._system_id}:
            return False
        number = message.command
        if number in SHARED:
            asked = message.param1
            # A heartbeat is each component's; the autopilot's is the one that is meant.
            return 0.0 < asked <= 0xFFFFFF and speaks(asked)
        return number in OWN

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take a command."""
        return _as_camera(self._commands.handle(message, sender, now_us))

    def cancel(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take COMMAND_CANCEL."""
        return _as_camera(self._commands.cancel(message, sender, now_us))

    def tick(self, acks: Iterable[VehicleCommandAck], now_us: int) -> list[Outgoing]:
        """Answers of payload, pictures taken, and commands that nobody has answered."""
        outgoing = self._commands.answers(acks, now_us)
        outgoing += self._commands.tick(now_us)
        return _as_camera(outgoing) + self._reports.tick(now_us)


def _as_camera(outgoing: list[Outgoing]) -> list[Outgoing]:
    return [each._replace(component=CAMERA_COMPONENT) for each in outgoing]
