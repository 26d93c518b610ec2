"""Reports of pictures and of the capture status; stores recent pictures for requests."""

from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import Final

from uav_firmware.modules.mavlink.camera.messages import camera_image_captured
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.streams import stream_key
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT, Outgoing
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.peers import PeerTable
from uav_firmware.msg.payload import CameraEvent, ImageCaptured
from uav_firmware.topics import Topics

IMAGES_STORED: Final = 10_000
"""Number of newest pictures that can be requested again."""
_STATUS: Final = stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS)


class CameraReports:
    """Reports each picture to every peer once, and the capture status at the requested rate."""

    def __init__(self, topics: Topics, peers: PeerTable, context: Callable[[int], Context]) -> None:
        self._topics = topics
        self._peers = peers
        self._context = context
        self._images: OrderedDict[int, ImageCaptured] = OrderedDict()
        self._report_interval_us = 0

    def tick(self, now_us: int) -> list[Outgoing]:
        """Report the pictures since the last call."""
        self._follow_report_rate(now_us)
        return self._report(self._topics.camera_event.drain())

    def images(self, first: int, last: int) -> list[Message]:
        """CAMERA_IMAGE_CAPTURED of the stored pictures from `first` to `last`."""
        newest = next(reversed(self._images), -1)
        indices = range(max(first, newest - IMAGES_STORED + 1), min(last, newest) + 1)
        return [self._message(self._images[i]) for i in indices if i in self._images]

    def _report(self, events: Iterable[CameraEvent]) -> list[Outgoing]:
        outgoing: list[Outgoing] = []
        for event in events:
            if not isinstance(event, ImageCaptured):
                self._images.clear()
                continue
            self._images[event.image_index] = event
            if len(self._images) > IMAGES_STORED:
                self._images.popitem(last=False)
            outgoing.append(Outgoing(self._message(event), component=CAMERA_COMPONENT))
        return outgoing

    def _message(self, image: ImageCaptured) -> Message:
        return camera_image_captured(image, self._context(image.time_us).boot_time_utc_us)

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
