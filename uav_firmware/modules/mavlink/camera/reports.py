"""What the camera component says without being asked, and the pictures it can tell of again."""

from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import Final

from uav_firmware.modules.mavlink.camera.messages import camera_image_captured
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.streams import stream_key
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT, Outgoing
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.peers import PeerTable
from uav_firmware.msg.payload import CameraEvent, ImageCaptured

IMAGES_KEPT: Final = 10_000
"""The newest pictures that can be asked for again."""
_STATUS: Final = stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS)


class CameraReports:
    """Tells every peer of each picture once, and of the recording as often as was asked for."""

    def __init__(
        self, topics: MavlinkTopics, peers: PeerTable, context: Callable[[int], Context]
    ) -> None:
        self._topics = topics
        self._peers = peers
        self._context = context
        self._images: OrderedDict[int, ImageCaptured] = OrderedDict()
        self._report_interval_us = 0

    def tick(self, now_us: int) -> list[Outgoing]:
        """Tell of the pictures taken since the last call."""
        self._follow_report_rate(now_us)
        return self._tell(self._topics.camera_event.drain())

    def images(self, first: int, last: int) -> list[Message]:
        """CAMERA_IMAGE_CAPTURED of those pictures from `first` to `last` that are known."""
        newest = next(reversed(self._images), -1)
        wanted = range(max(first, newest - IMAGES_KEPT + 1), min(last, newest) + 1)
        return [self._message(self._images[i]) for i in wanted if i in self._images]

    def _tell(self, events: Iterable[CameraEvent]) -> list[Outgoing]:
        outgoing: list[Outgoing] = []
        for event in events:
            if not isinstance(event, ImageCaptured):
                self._images.clear()
                continue
            self._images[event.image_index] = event
            if len(self._images) > IMAGES_KEPT:
                self._images.popitem(last=False)
            outgoing.append(Outgoing(self._message(event), component=CAMERA_COMPONENT))
        return outgoing

    def _message(self, image: ImageCaptured) -> Message:
        return camera_image_captured(image, self._context(image.time_us).boot_time_utc_us)

    def _follow_report_rate(self, now_us: int) -> None:
        """Stream the status while VIDEO_START_CAPTURE's rate holds; keep what a peer has chosen."""
        status = self._topics.camera_status.value
        wanted = 0 if status is None else status.report_interval_us
        if wanted == self._report_interval_us:
            return
        former, self._report_interval_us = self._report_interval_us, wanted
        for channel in self._peers:
            schedule = channel.schedule
            if schedule.interval_us(_STATUS) in {former, schedule.default_interval_us(_STATUS)}:
                interval = wanted or schedule.default_interval_us(_STATUS)
                schedule.set_interval(_STATUS, interval, now_us)
