"""Dispatches each received message to the server that handles it."""

from collections.abc import Callable, Iterable, Mapping
from itertools import count
from typing import Final, TypeAlias

from uav_firmware.cal.files import Card
from uav_firmware.cal.link import Address
from uav_firmware.cal.storage import Storage
from uav_firmware.modules.mavlink.camera_component import CameraComponent, CommandRouter
from uav_firmware.modules.mavlink.commands.command_server import CommandServer
from uav_firmware.modules.mavlink.commands.parameter_server import ParameterServer
from uav_firmware.modules.mavlink.commands.preflight_commands import (
    PowerAction,
    PowerCommands,
    StorageCommands,
    storage_ack,
)
from uav_firmware.modules.mavlink.commands.setpoints import SetpointInput
from uav_firmware.modules.mavlink.commands.streamed_input import (
    FollowInput,
    GimbalInput,
    ManualInput,
)
from uav_firmware.modules.mavlink.files.log_stream import LogStream
from uav_firmware.modules.mavlink.files.metadata_files import MetadataFiles, MetadataRequest
from uav_firmware.modules.mavlink.files.service import FileService
from uav_firmware.modules.mavlink.missions.mission_server import MissionServer
from uav_firmware.modules.mavlink.missions.mission_store import Plan, PlanStore
from uav_firmware.modules.mavlink.missions.plan_checks import PlanChecker
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.link import answer_ping, answer_timesync
from uav_firmware.modules.mavlink.telemetry.requests import RequestServer
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.peers import PeerTable
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.geofence import Fence, RallyPoints
from uav_firmware.msg.mission import Mission, PlanType
from uav_firmware.msg.status import StatusText
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

Handler: TypeAlias = Callable[[Message, Sender, int], list[Outgoing]]
"""Handle a message, its sender and the time [us]; returns the messages to send."""

_COMMANDING_TYPES: Final = frozenset({mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER})


def _stores(topics: Topics, checker: PlanChecker, storage: Storage | None) -> dict[int, PlanStore]:
    """The plans, by MAV_MISSION_TYPE; the fence first: the others are checked against it."""
    published: Mapping[PlanType, Callable[[Plan], None]] = {
        PlanType.FENCE: lambda plan: topics.fence.publish(Fence(*plan)),
        PlanType.RALLY_POINTS: lambda plan: topics.rally_points.publish(RallyPoints(*plan)),
        PlanType.MISSION: lambda plan: topics.mission.publish(Mission(*plan)),
    }
    return {
        plan_type: PlanStore(
            plan_type, check=checker.check_of(plan_type), publish=publish, storage=storage
        )
        for plan_type, publish in published.items()
    }


class Dispatcher:
    """Owns the servers of the protocols."""

    def __init__(
        self,
        *,
        system_id: int,
        registry: Registry,
        topics: Topics,
        peers: PeerTable,
        checker: PlanChecker,
        storage: Storage | None,
        context: Callable[[int], Context],
        texts: StatusTexts,
        card: Card | None,
        request_power: Callable[[PowerAction], None] | None,
        set_up_signing: Handler,
    ) -> None:
        self._system_id = system_id
        self._topics = topics
        self._texts = texts
        self._checker = checker
        self._missions = MissionServer(
            system_id=system_id,
            stores=_stores(topics, checker, storage),
            current_seq=self._current_seq,
            texts=texts,
        )
        for fault in self._missions.load():
            topics.status_text.publish(StatusText(0, mavlink.MAV_SEVERITY_WARNING, fault))
        router, tokens = CommandRouter(topics), count(1)
        self._parameters = ParameterServer(
            system_id=system_id,
            registry=registry,
            save_request=topics.parameter_save_request,
            request_ids=tokens,
            texts=texts,
        )
        self._storage_commands = StorageCommands(
            registry,
            vehicle_status=topics.vehicle_status,
            save_request=topics.parameter_save_request,
            request_ids=tokens,
        )
        metadata = MetadataFiles(registry)
        self._log_stream = LogStream(
            system_id=system_id,
            request=topics.log_stream_request,
            chunks=topics.log_stream,
            texts=texts,
        )
        self._commands = CommandServer(
            system_id=system_id,
            local_handlers=(
                MetadataRequest(lambda: metadata.general_checksum).answer,
                RequestServer(peers, context).answer,
                self._storage_commands.answer,
                PowerCommands(request_power, topics.vehicle_status).answer,
                self._log_stream.answer,
            ),
            commander=router,
            mission_length=lambda: self._missions.mission_length,
            cancel=router.cancel,
            tokens=tokens,
            texts=texts,
        )
        self._camera = CameraComponent(
            system_id=system_id,
            topics=topics,
            peers=peers,
            context=context,
            sink=router,
            cancel=router.cancel,
            tokens=tokens,
            texts=texts,
        )
        self._files = FileService(
            system_id=system_id,
            registry=registry,
            card=card,
            topics=topics,
            texts=texts,
            parameters=self._parameters,
            metadata=metadata,
        )
        self._manual = ManualInput(system_id, topics)
        setpoints = SetpointInput(system_id, topics, texts)
        gimbal = GimbalInput(system_id, topics.payload_order)
        self._handlers: Mapping[str, Handler] = {
            "HEARTBEAT": self._heartbeat,
            **dict.fromkeys(self._missions.message_types, self._missions.handle),
            **dict.fromkeys(setpoints.message_types, setpoints.handle),
            **dict.fromkeys(self._files.message_types, self._files.handle),
            "LOGGING_ACK": self._log_stream.acknowledged,
            "MANUAL_CONTROL": self._manual.handle,
            **dict.fromkeys(gimbal.message_types, gimbal.handle),
            "FOLLOW_TARGET": FollowInput(topics.follow_target).handle,
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "COMMAND_CANCEL": self._cancel,
            "SET_MODE": self._set_mode,
            "MISSION_SET_CURRENT": self._set_current,
            "SET_GPS_GLOBAL_ORIGIN": self._set_origin,
            "PARAM_REQUEST_LIST": self._parameters.handle,
            "PARAM_REQUEST_READ": self._parameters.handle,
            "PARAM_SET": self._parameters.handle,
            "TIMESYNC": answer_timesync,
            "PING": answer_ping,
            "SETUP_SIGNING": set_up_signing,
        }

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Serve a message; one without a handler is ignored."""
        handler = self._handlers.get(message.get_type())
        return [] if handler is None else handler(message, sender, now_us)

    def resume(self, now_us: int) -> list[Outgoing]:
        """Continue with the plans that the navigator has checked; report the parameters saved."""
        outgoing = self._missions.resume_uploads(now_us) if self._checker.receive() else []
        for result in self._topics.parameter_save_result.drain():
            outgoing += self._parameters.on_save_result(result)
            ack = storage_ack(result, now_us)
            outgoing += self._commands.answers([ack], now_us, reason=result.fault)
        return outgoing

    def tick(self, now_us: int) -> list[Outgoing]:
        """Messages that are due from all servers."""
        acks = self._topics.vehicle_command_ack.drain()
        outgoing = self._commands.answers(acks, now_us)
        outgoing += self._commands.tick(now_us)
        outgoing += self._camera.tick(acks, now_us)
        outgoing += self._missions.tick(now_us)
        outgoing += self._parameters.tick(now_us)
        outgoing += self._files.tick(now_us)
        outgoing += self._log_stream.tick(now_us)
        return outgoing

    def tick_logs(self, now_us: int) -> list[Outgoing]:
        """Pieces of logs that are due."""
        return self._files.tick_logs(now_us)

    def drop_peers(self, addresses: Iterable[Address]) -> None:
        """Drop the state of peers whose channel is closed."""
        for address in addresses:
            self._parameters.drop_peer(address)
            self._log_stream.drop_peer(address)

    def _command(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Pass a command to the component that answers it."""
        orders_mode = message.command == mavlink.MAV_CMD_DO_SET_MODE
        if orders_mode and is_for_us(message, self._system_id):
            self._manual.order_mode(sender, now_us)
        server = self._camera if self._camera.is_for_camera(message) else self._commands
        return server.handle(message, sender, now_us)

    def _set_mode(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        if message.target_system == self._system_id:
            self._manual.order_mode(sender, now_us)
        return self._commands.set_mode(message, sender, now_us)

    def _cancel(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Cancel a command of either component."""
        outgoing = self._commands.cancel(message, sender, now_us)
        return outgoing + self._camera.cancel(message, sender, now_us)

    def _heartbeat(self, message: Message, _sender: Sender, now_us: int) -> list[Outgoing]:
        """Publish the time of a heartbeat of a ground station or an onboard controller."""
        if message.type in _COMMANDING_TYPES:
            self._topics.ground_station_heartbeat.publish(now_us)
        return []

    def _current_seq(self) -> int:
        """Item that the navigator flies; 0 until it has loaded the mission."""
        progress, mission = self._topics.mission_progress.value, self._topics.mission.value
        if progress is None or mission is None or not progress.is_of(mission):
            return 0
        return min(progress.seq_current, len(mission.items) - 1)

    def _set_current(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle MISSION_SET_CURRENT; it has no acknowledgement, so a failure is a STATUSTEXT."""
        if not is_for_us(message, self._system_id):
            return []
        if self._commands.set_current_item(message.seq, sender, now_us):
            return []
        text = f"Mission has no item {message.seq}"
        return self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)

    def _set_origin(self, message: Message, _sender: Sender, _now_us: int) -> list[Outgoing]:
        """Refuse SET_GPS_GLOBAL_ORIGIN by a STATUSTEXT: it has no acknowledgement."""
        if message.target_system != self._system_id:
            return []
        text = "SET_GPS_GLOBAL_ORIGIN is not supported: the first GPS fix sets the origin"
        return self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)
