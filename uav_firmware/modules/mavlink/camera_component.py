"""The camera components (100, 101): commands, answers and reports of pictures.

The messages of each have its component id and their own sequence numbers. The camera (100) answers
a command to all components (0) that only it supports; the autopilot answers one that both support,
so that each command has one answer.

The second camera (101) is there while a second picture, of near infrared or the vegetation index,
is stored with each picture. It has no shutter of its own: it answers requests for messages alone.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final

from uav_firmware.modules.mavlink.commands.command_server import CommandServer, CommandSink
from uav_firmware.modules.mavlink.commands.commands import (
    FOR_GIMBAL,
    FOR_PAYLOAD,
    Answer,
    Command,
    as_index,
    denied,
    failed,
)
from uav_firmware.modules.mavlink.telemetry.camera import (
    camera_image_captured,
    second_image_captured,
)
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.requests import RequestServer, interval_query
from uav_firmware.modules.mavlink.telemetry.streams import BUILDERS, stream_key
from uav_firmware.modules.mavlink.wire.addressing import (
    CAMERA_COMPONENT,
    SECOND_CAMERA_COMPONENT,
    Outgoing,
    Sender,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.peers import PeerTable
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.payload import CameraEvent, CancelOrder, ImageCaptured
from uav_firmware.msg.status import VehicleCommand, VehicleCommandAck
from uav_firmware.topics import Topics

IMAGES_STORED: Final = 10_000
"""Number of newest pictures that can be requested again."""
_STATUS: Final = stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS)
IMAGES_AT_ONCE: Final = 64
"""Largest number of pictures in one answer; the rest must be requested again."""

_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED
_IMAGE: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
_STORAGE: Final[int] = mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION

_DEPRECATED: Final[Mapping[int, int]] = {
    mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION: mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION,
    mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS: mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS,
    mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS,
}
"""Deprecated commands, each for one message if parameter 1 is 1."""
_STREAMS: Final[Mapping[int, int]] = {
    mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: (
        mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
    ),
    mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS: mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS,
}
"""Deprecated commands, each for one message of the stream of parameter 1; 0 is all."""

_NUMBERED: Final = frozenset({_STORAGE, *_STREAMS.values()})
"""Messages with a number, which is parameter 2 of the request."""

OWN: Final = frozenset({*_DEPRECATED, *_STREAMS, mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION})
"""Requests that only the camera supports."""
SHARED: Final = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
    }
)
"""Requests that every component supports."""

KNOWN: Final = (FOR_PAYLOAD - FOR_GIMBAL) | OWN | SHARED
"""Commands that the camera supports."""


def is_sent_by_camera(message_id: float, component: int = CAMERA_COMPONENT) -> bool:
    """Whether a camera sends a message."""
    if message_id == _IMAGE:
        return True
    return stream_key(component, int(message_id)) in BUILDERS


class CameraReports:
    """Reports each picture to every peer once, and the capture status at the requested rate."""

    def __init__(self, topics: Topics, peers: PeerTable, context: Callable[[int], Context]) -> None:
        self._topics = topics
        self._peers = peers
        self._context = context
        self._images: dict[int, OrderedDict[int, ImageCaptured]] = {
            CAMERA_COMPONENT: OrderedDict(),
            SECOND_CAMERA_COMPONENT: OrderedDict(),
        }
        self._report_interval_us = 0

    def tick(self, now_us: int) -> list[Outgoing]:
        """Report the pictures since the last call."""
        self._follow_report_rate(now_us)
        return self._report(self._topics.camera_event.drain())

    def images(self, component: int, first: int, last: int) -> list[Message]:
        """CAMERA_IMAGE_CAPTURED of the stored pictures of a camera from `first` to `last`."""
        images = self._images[component]
        newest = next(reversed(images), -1)
        indices = range(max(first, newest - IMAGES_STORED + 1), min(last, newest) + 1)
        return [self._message(component, images[i]) for i in indices if i in images]

    def _report(self, events: Iterable[CameraEvent]) -> list[Outgoing]:
        outgoing: list[Outgoing] = []
        for event in events:
            if not isinstance(event, ImageCaptured):
                for images in self._images.values():
                    images.clear()
                continue
            outgoing.append(self._store(CAMERA_COMPONENT, event.image_index, event))
            if event.second_index >= 0:
                outgoing.append(self._store(SECOND_CAMERA_COMPONENT, event.second_index, event))
        return outgoing

    def _store(self, component: int, index: int, image: ImageCaptured) -> Outgoing:
        images = self._images[component]
        images[index] = image
        if len(images) > IMAGES_STORED:
            images.popitem(last=False)
        return Outgoing(self._message(component, image), component=component)

    def _message(self, component: int, image: ImageCaptured) -> Message:
        boot_time_utc_us = self._context(image.time_us).boot_time_utc_us
        if component == CAMERA_COMPONENT:
            return camera_image_captured(image, boot_time_utc_us)
        return second_image_captured(image, boot_time_utc_us)

    def _follow_report_rate(self, now_us: int) -> None:
        """Apply the status rate of VIDEO_START_CAPTURE, except where a peer has set its own."""
        status = self._topics.camera_status.value
        interval_us = 0 if status is None else status.report_interval_us
        if interval_us == self._report_interval_us:
            return
        previous, self._report_interval_us = self._report_interval_us, interval_us
        for channel in self._peers:
            schedule = channel.schedule
            if schedule.interval_us(_STATUS) in {previous, schedule.default_interval_us(_STATUS)}:
                interval = interval_us or schedule.default_interval_us(_STATUS)
                schedule.set_interval(_STATUS, interval, now_us)


class CameraRequests:
    """Serves message requests to a camera component."""

    def __init__(
        self, requests: RequestServer, reports: CameraReports, component: int = CAMERA_COMPONENT
    ) -> None:
        """`requests` serves the streams of this component, `reports` has the stored pictures."""
        self._requests = requests
        self._reports = reports
        self._component = component
        self._answers: dict[int, Callable[[Command, Sender, int], Answer]] = {
            **dict.fromkeys(_DEPRECATED, self._deprecated),
            **dict.fromkeys(_STREAMS, self._video_stream),
            mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION: self._storage,
            **dict.fromkeys(SHARED, self._shared),
        }

    def answer(self, command: Command, sender: Sender, now_us: int) -> Answer | None:
        """Answer a request; None for any other command."""
        handler = self._answers.get(command.number)
        return None if handler is None else handler(command, sender, now_us)

    def _shared(self, command: Command, sender: Sender, now_us: int) -> Answer:
        message_id = as_index(command.parameter(1))
        if message_id is None:
            return denied(f"there is no message {command.parameter(1):g}")
        is_request = command.number == mavlink.MAV_CMD_REQUEST_MESSAGE
        if is_request and message_id == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            return self._shared(interval_query(command), sender, now_us)
        if not is_sent_by_camera(message_id, self._component):
            return Answer(_UNSUPPORTED)
        if message_id == _IMAGE:
            return self._images(command)
        if is_request and message_id in _NUMBERED and not _exists(command.parameter(2)):
            return denied(f"parameter 2: the camera has no number {command.parameter(2):g}")
        answer = self._requests.answer(command, sender, now_us)
        return Answer(_UNSUPPORTED) if answer is None else answer

    def _images(self, command: Command) -> Answer:
        """CAMERA_IMAGE_CAPTURED from index p2 to index p3 if that is set; not a stream."""
        if command.number != mavlink.MAV_CMD_REQUEST_MESSAGE:
            return Answer(_UNSUPPORTED)
        first, last = as_index(command.parameter(2)), as_index(command.parameter(3))
        if first is None:
            return denied(f"parameter 2: there is no picture {command.parameter(2):g}")
        last = last or first
        if last < first:
            return denied(f"parameter 3: the last picture, {last}, is before the first, {first}")
        last = min(last, first + IMAGES_AT_ONCE - 1)
        found = self._reports.images(self._component, first, last)
        if not found:
            return failed(f"the camera has no record of picture {first}")
        return Answer(_ACCEPTED, tuple(found))

    def _deprecated(self, command: Command, sender: Sender, now_us: int) -> Answer:
        return self._one(_DEPRECATED[command.number], command.parameter(1), sender, now_us)

    def _video_stream(self, command: Command, sender: Sender, now_us: int) -> Answer:
        if not _exists(command.parameter(1)):
            return denied(f"parameter 1: the camera has no stream {command.parameter(1):g}")
        return self._one(_STREAMS[command.number], 1.0, sender, now_us)

    def _storage(self, command: Command, sender: Sender, now_us: int) -> Answer:
        if not _exists(command.parameter(1)):
            return denied(f"parameter 1: the camera has no storage {command.parameter(1):g}")
        return self._one(_STORAGE, command.parameter(2), sender, now_us)

    def _one(self, message_id: int, requested: float, sender: Sender, now_us: int) -> Answer:
        if requested == 0.0:
            return Answer(_ACCEPTED)
        if requested != 1.0:
            return denied(f"{requested:g} is not 1, a request")
        parameters = (float(message_id), *[0.0] * 6)
        command = Command(mavlink.MAV_CMD_REQUEST_MESSAGE, parameters, 0)  # type: ignore[arg-type]
        return self._shared(command, sender, now_us)


def _exists(number: float) -> bool:
    """Whether a number means all storages or streams, or the only one."""
    return math.isnan(number) or number in {0.0, 1.0}


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
    """Serves COMMAND_LONG, COMMAND_INT and COMMAND_CANCEL for both cameras."""

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
        texts: StatusTexts,
    ) -> None:
        self._system_id = system_id
        self._topics = topics
        self._reports = CameraReports(topics, peers, context)
        self._servers = {
            component: CommandServer(
                system_id=system_id,
                local_handlers=(
                    CameraRequests(
                        RequestServer(peers, context, component), self._reports, component
                    ).answer,
                ),
                commander=sink,
                mission_length=lambda: 0,
                cancel=cancel,
                component=component,
                known=known,
                tokens=tokens,
                texts=texts,
            )
            for component, known in ((CAMERA_COMPONENT, KNOWN), (SECOND_CAMERA_COMPONENT, SHARED))
        }

    def is_for_camera(self, message: Message) -> bool:
        """Whether a camera answers a command."""
        if message.target_component == SECOND_CAMERA_COMPONENT:
            status = self._topics.camera_status.value
            return status is not None and status.has_second
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
        component = message.target_component or CAMERA_COMPONENT
        return _sent_by(component, self._servers[component].handle(message, sender, now_us))

    def cancel(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle COMMAND_CANCEL; the second camera has nothing to cancel."""
        server = self._servers[CAMERA_COMPONENT]
        return _sent_by(CAMERA_COMPONENT, server.cancel(message, sender, now_us))

    def tick(self, acks: Iterable[VehicleCommandAck], now_us: int) -> list[Outgoing]:
        """Send answers of payload, timeouts of commands, and reports of pictures."""
        outgoing: list[Outgoing] = []
        for component, server in self._servers.items():
            answers = server.answers(acks, now_us) + server.tick(now_us)
            outgoing += _sent_by(component, answers)
        return outgoing + self._reports.tick(now_us)


def _sent_by(component: int, outgoing: list[Outgoing]) -> list[Outgoing]:
    return [each._replace(component=component) for each in outgoing]
