"""Message requests to the camera component."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.modules.mavlink.camera.reports import CameraReports
from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.telemetry.requests import Answer, RequestServer, as_index
from uav_firmware.modules.mavlink.telemetry.streams import BUILDERS, stream_key
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT, Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink

IMAGES_AT_ONCE: Final = 64
"""Largest number of pictures in one answer; the rest must be requested again."""

_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = mavlink.MAV_RESULT_DENIED
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED
_FAILED: Final[int] = mavlink.MAV_RESULT_FAILED
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


def is_sent_by_camera(message_id: float) -> bool:
    """Whether the camera sends a message."""
    if message_id == _IMAGE:
        return True
    return stream_key(CAMERA_COMPONENT, int(message_id)) in BUILDERS


class CameraRequests:
    """Serves message requests to component 100."""

    def __init__(self, requests: RequestServer, reports: CameraReports) -> None:
        """`requests` serves the streams of this component, `reports` has the stored pictures."""
        self._requests = requests
        self._reports = reports
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
            return Answer(_DENIED)
        if not is_sent_by_camera(message_id):
            return Answer(_UNSUPPORTED)
        if message_id == _IMAGE:
            return self._images(command)
        is_request = command.number == mavlink.MAV_CMD_REQUEST_MESSAGE
        if is_request and message_id in _NUMBERED and not _exists(command.parameter(2)):
            return Answer(_DENIED)
        answer = self._requests.answer(command, sender, now_us)
        return Answer(_UNSUPPORTED) if answer is None else answer

    def _images(self, command: Command) -> Answer:
        """CAMERA_IMAGE_CAPTURED from index p2 to index p3 if that is set; not a stream."""
        if command.number != mavlink.MAV_CMD_REQUEST_MESSAGE:
            return Answer(_UNSUPPORTED)
        first, last = as_index(command.parameter(2)), as_index(command.parameter(3))
        if first is None:
            return Answer(_DENIED)
        last = last or first
        if last < first:
            return Answer(_DENIED)
        found = self._reports.images(first, min(last, first + IMAGES_AT_ONCE - 1))
        return Answer(_ACCEPTED, tuple(found)) if found else Answer(_FAILED)

    def _deprecated(self, command: Command, sender: Sender, now_us: int) -> Answer:
        return self._one(_DEPRECATED[command.number], command.parameter(1), sender, now_us)

    def _video_stream(self, command: Command, sender: Sender, now_us: int) -> Answer:
        if not _exists(command.parameter(1)):
            return Answer(_DENIED)
        return self._one(_STREAMS[command.number], 1.0, sender, now_us)

    def _storage(self, command: Command, sender: Sender, now_us: int) -> Answer:
        if not _exists(command.parameter(1)):
            return Answer(_DENIED)
        return self._one(_STORAGE, command.parameter(2), sender, now_us)

    def _one(self, message_id: int, requested: float, sender: Sender, now_us: int) -> Answer:
        if requested != 1.0:
            return Answer(_ACCEPTED if requested == 0.0 else _DENIED)
        parameters = (float(message_id), *[0.0] * 6)
        command = Command(mavlink.MAV_CMD_REQUEST_MESSAGE, parameters, 0)  # type: ignore[arg-type]
        return self._shared(command, sender, now_us)


def _exists(number: float) -> bool:
    """Whether a number means all storages or streams, or the only one."""
    return math.isnan(number) or number in {0.0, 1.0}
