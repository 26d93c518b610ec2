"""Requests to the camera component: its messages now, again, or every so often."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.modules.mavlink.camera.reports import CameraReports
from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.telemetry.requests import Answer, RequestServer, whole
from uav_firmware.modules.mavlink.telemetry.streams import BUILDERS, stream_key
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT, Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink

IMAGES_AT_ONCE: Final = 64
"""Of a longer range, the first pictures are told; the rest is asked for again."""

_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = mavlink.MAV_RESULT_DENIED
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED
_FAILED: Final[int] = mavlink.MAV_RESULT_FAILED
_IMAGE: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
_STORAGE: Final[int] = mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION

_OLDER: Final[Mapping[int, int]] = {
    mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION: mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION,
    mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS: mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS,
    mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS,
}
"""Older commands, each for one message if its parameter 1 is 1."""
_STREAMS: Final[Mapping[int, int]] = {
    mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: (
        mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
    ),
    mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS: mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS,
}
"""Older commands, each for one message of the stream of parameter 1; 0 is all."""

_NUMBERED: Final = frozenset({_STORAGE, *_STREAMS.values()})
"""Messages of one of several, whose number is parameter 2 of the request."""

OWN: Final = frozenset({*_OLDER, *_STREAMS, mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION})
"""Requests that only a camera knows."""
SHARED: Final = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
    }
)
"""Requests that every component knows."""


def speaks(message_id: float) -> bool:
    """Whether a message is the camera's to send."""
    if message_id == _IMAGE:
        return True
    return stream_key(CAMERA_COMPONENT, int(message_id)) in BUILDERS


class CameraRequests:
    """As `RequestServer`, for component 100."""

    def __init__(self, requests: RequestServer, reports: CameraReports) -> None:
        """Take the general requests of this component, and the pictures that can be told again."""
        self._requests = requests
        self._reports = reports
        self._answers: dict[int, Callable[[Command, Sender, int], Answer]] = {
            **dict.fromkeys(_OLDER, self._older),
            **dict.fromkeys(_STREAMS, self._video_stream),
            mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION: self._storage,
            **dict.fromkeys(SHARED, self._shared),
        }

    def answer(self, command: Command, sender: Sender, now_us: int) -> Answer | None:
        """Answer a request; None when the command is none."""
        handler = self._answers.get(command.number)
        return None if handler is None else handler(command, sender, now_us)

    def _shared(self, command: Command, sender: Sender, now_us: int) -> Answer:
        message_id = whole(command.parameter(1))
        if message_id is None:
            return Answer(_DENIED)
        if not speaks(message_id):
            return Answer(_UNSUPPORTED)
        if message_id == _IMAGE:
            return self._images(command)
        asks = command.number == mavlink.MAV_CMD_REQUEST_MESSAGE
        if asks and message_id in _NUMBERED and not _is_there(command.parameter(2)):
            return Answer(_DENIED)
        answer = self._requests.answer(command, sender, now_us)
        return Answer(_UNSUPPORTED) if answer is None else answer

    def _images(self, command: Command) -> Answer:
        """CAMERA_IMAGE_CAPTURED from index p2, to index p3 if that is set; no stream."""
        if command.number != mavlink.MAV_CMD_REQUEST_MESSAGE:
            return Answer(_UNSUPPORTED)
        first, last = whole(command.parameter(2)), whole(command.parameter(3))
        if first is None:
            return Answer(_DENIED)
        last = last or first
        if last < first:
            return Answer(_DENIED)
        found = self._reports.images(first, min(last, first + IMAGES_AT_ONCE - 1))
        return Answer(_ACCEPTED, tuple(found)) if found else Answer(_FAILED)

    def _older(self, command: Command, sender: Sender, now_us: int) -> Answer:
        return self._one(_OLDER[command.number], command.parameter(1), sender, now_us)

    def _video_stream(self, command: Command, sender: Sender, now_us: int) -> Answer:
        if not _is_there(command.parameter(1)):
            return Answer(_DENIED)
        return self._one(_STREAMS[command.number], 1.0, sender, now_us)

    def _storage(self, command: Command, sender: Sender, now_us: int) -> Answer:
        if not _is_there(command.parameter(1)):
            return Answer(_DENIED)
        return self._one(_STORAGE, command.parameter(2), sender, now_us)

    def _one(self, message_id: int, wanted: float, sender: Sender, now_us: int) -> Answer:
        if wanted != 1.0:
            return Answer(_ACCEPTED if wanted == 0.0 else _DENIED)
        asked = (float(message_id), *[0.0] * 6)
        command = Command(mavlink.MAV_CMD_REQUEST_MESSAGE, asked, 0)  # type: ignore[arg-type]
        return self._shared(command, sender, now_us)


def _is_there(number: float) -> bool:
    """All storages or video streams, or the one there is."""
    return math.isnan(number) or number in {0.0, 1.0}
