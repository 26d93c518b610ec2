"""Telemetry that is also sent at once on a change, and MISSION_ITEM_REACHED."""

from collections.abc import Callable, Hashable
from typing import Any, Final, NamedTuple

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.telemetry.streams import stream_key
from uav_firmware.modules.mavlink.wire.addressing import (
    CAMERA_COMPONENT,
    SECOND_CAMERA_COMPONENT,
    Outgoing,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.geofence import Fence, RallyPoints
from uav_firmware.msg.mission import Mission, MissionProgress
from uav_firmware.msg.payload import CameraStatus, GimbalStatus
from uav_firmware.msg.status import HomePosition, LandDetected, VehicleStatus
from uav_firmware.topics import Topics

REPETITIONS: Final = 3
REPETITION_US: Final = 500_000


def _status_key(status: VehicleStatus) -> Hashable:
    return (status.navigation_state, status.armed, status.failsafe)


def _landed_key(landed: LandDetected) -> Hashable:
    return landed.landed_state


def _home_key(home: HomePosition) -> Hashable:
    return (home.latitude_deg, home.longitude_deg, home.altitude_amsl_m)


def _plan_key(plan: Mission | Fence | RallyPoints) -> Hashable:
    return plan[:2]  # Time of acceptance and id


def _progress_key(progress: MissionProgress) -> Hashable:
    mission = (progress.mission_id, progress.mission_time_us)
    return (mission, progress.seq_current, progress.state, progress.selection_count)


def _capture_key(status: CameraStatus) -> Hashable:
    return status[2:8]  # Fields of CAMERA_CAPTURE_STATUS other than the free space


def _second_capture_key(status: CameraStatus) -> Hashable:
    is_there = status.has_second
    return (status.image_status, status.image_interval_s, status.second_count) if is_there else None


def _camera_mode_key(status: CameraStatus) -> Hashable:
    return status.mode


def _storage_key(status: CameraStatus) -> Hashable:
    return (status.total_mib, status.used_mib)


def _gimbal_control_key(status: GimbalStatus) -> Hashable:
    return (status.primary, status.secondary)


class _Watch(NamedTuple):
    """A topic, the part that is compared, and the messages sent on a change (stream keys)."""

    topic: Callable[[Topics], Topic[Any]]
    key: Callable[[Any], Hashable]
    message_ids: tuple[int, ...]


_WATCHES: Final = (
    _Watch(
        lambda topics: topics.vehicle_status,
        _status_key,
        (mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_CURRENT_MODE),
    ),
    _Watch(
        lambda topics: topics.land_detected,
        _landed_key,
        (mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE),
    ),
    _Watch(lambda topics: topics.home_position, _home_key, (mavlink.MAVLINK_MSG_ID_HOME_POSITION,)),
    _Watch(lambda topics: topics.mission, _plan_key, (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,)),
    _Watch(lambda topics: topics.fence, _plan_key, (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,)),
    _Watch(
        lambda topics: topics.rally_points,
        _plan_key,
        (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,),
    ),
    _Watch(
        lambda topics: topics.mission_progress,
        _progress_key,
        (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,),
    ),
    _Watch(
        lambda topics: topics.camera_status,
        _capture_key,
        (stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS),),
    ),
    _Watch(
        lambda topics: topics.camera_status,
        _second_capture_key,
        (stream_key(SECOND_CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS),),
    ),
    _Watch(
        lambda topics: topics.camera_status,
        _camera_mode_key,
        (stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS),),
    ),
    _Watch(
        lambda topics: topics.camera_status,
        _storage_key,
        (stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION),),
    ),
    _Watch(
        lambda topics: topics.gimbal_status,
        _gimbal_control_key,
        (mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS,),
    ),
)


class ChangeDetector:
    """Detects which messages must be sent at once.

    The count of a topic is compared first, because it is unchanged in most steps.
    """

    def __init__(self, topics: Topics) -> None:
        self._watched = [(watch, watch.topic(topics)) for watch in _WATCHES]
        self._counts = [0] * len(self._watched)
        self._keys: list[Hashable] = [None] * len(self._watched)

    def take(self) -> list[int]:
        """Keys of the messages whose contents have changed since the last call."""
        changed: dict[int, None] = {}
        for i, (watch, topic) in enumerate(self._watched):
            if topic.count == self._counts[i]:
                continue
            self._counts[i] = topic.count
            key = watch.key(topic.value)
            if key != self._keys[i]:
                self._keys[i] = key
                changed.update(dict.fromkeys(watch.message_ids))
        return list(changed)


class ReachedReporter:
    """Sends MISSION_ITEM_REACHED to every peer, repeated because it is not acknowledged."""

    def __init__(self) -> None:
        self._reached_count = 0
        self._mission = (0, 0)  # Id and time of acceptance
        self._seq = 0
        self._left = 0
        self._due_us = 0

    def tick(self, progress: MissionProgress | None, now_us: int) -> list[Outgoing]:
        """Messages due now; a newer item or another mission ends the repetitions."""
        if progress is None:
            return []
        mission = (progress.mission_id, progress.mission_time_us)
        if progress.reached_count != self._reached_count:
            new = progress.latest_reached[self._reached_count - progress.reached_count :]
            self._reached_count, self._mission = progress.reached_count, mission
            self._left, self._due_us = REPETITIONS, now_us + REPETITION_US
            self._seq = progress.seq_reached
            return [_reached_message(seq) for seq in new]
        if mission != self._mission:
            self._mission, self._left = mission, 0
        if self._left == 0 or now_us < self._due_us:
            return []
        self._left -= 1
        self._due_us = now_us + REPETITION_US
        return [_reached_message(self._seq)]


def _reached_message(seq: int) -> Outgoing:
    return Outgoing(mavlink.MAVLink_mission_item_reached_message(seq=seq))
