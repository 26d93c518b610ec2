"""Receives streamed set-points: one sender at a time, each refusal told once."""

from typing import Final

from uav_firmware.modules.mavlink.input.setpoint_messages import (
    READERS,
    SetpointError,
    Whereabouts,
)
from uav_firmware.modules.mavlink.telemetry.status_text import StatusTexts
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink

KEPT_US: Final = 1_000_000
"""Silence of a stream after which somebody else's may begin."""
_MAX_TOLD: Final = 16
"""Refusals remembered; whoever thinks up more has had words enough."""


class SetpointInput:
    """Serves SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT, SET_ATTITUDE_TARGET.

    A refusal is told in words when it is the first of its kind since a set-point was good.
    """

    message_types = tuple(READERS)

    def __init__(self, system_id: int, topics: MavlinkTopics, texts: StatusTexts) -> None:
        self._system_id = system_id
        self._topics = topics
        self._texts = texts
        self._told: set[str] = set()
        self._holder: tuple[int, int] | None = None
        self._heard_us = 0

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Publish the set-point, or say why it cannot be flown."""
        if not is_for_us(message, self._system_id):
            return []
        if self._holder not in {None, sender.identity} and now_us - self._heard_us <= KEPT_US:
            return []
        estimate = self._topics.local_position.value
        if estimate is None:
            return []
        try:
            where = Whereabouts(estimate, self._topics.home.value)
            setpoint = READERS[message.get_type()](message, where, now_us)
        except SetpointError as error:
            return self._refuse(f"{message.get_type()} ignored: {error}")
        self._told.clear()
        self._holder, self._heard_us = sender.identity, now_us
        self._topics.offboard_setpoint.publish(setpoint)
        return []

    def _refuse(self, text: str) -> list[Outgoing]:
        if text in self._told or len(self._told) >= _MAX_TOLD:
            return []
        self._told.add(text)
        return self._texts.say(mavlink.MAV_SEVERITY_WARNING, text)
