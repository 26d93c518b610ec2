"""Telemetry that is sent at once when something changes, besides its regular rate."""

from collections.abc import Callable, Hashable
from typing import Any, Final, NamedTuple

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.telemetry.streams import stream_key
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.geofence import Fence, RallyPoints
from uav_firmware.msg.mission import Mission, MissionProgress
from uav_firmware.msg.payload import CameraStatus, GimbalStatus
from uav_firmware.msg.status import HomePosition, LandDetected, VehicleStatus


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
    return status[2:8]  # All that CAMERA_CAPTURE_STATUS tells, but for the room that is left


def _camera_mode_key(status: CameraStatus) -> Hashable:
    return status.mode


def _storage_key(status: CameraStatus) -> Hashable:
    return (status.total_mib, status.used_mib)


def _gimbal_control_key(status: GimbalStatus) -> Hashable:
    return (status.primary, status.secondary)


class _Watch(NamedTuple):
    """One topic, what of it counts as a change, and what is sent then (as `stream_key`)."""

    topic: Callable[[MavlinkTopics], Topic[Any]]
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
    _Watch(lambda topics: topics.home, _home_key, (mavlink.MAVLINK_MSG_ID_HOME_POSITION,)),
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
    """Tells which messages are to be sent at once.

    A topic's count is compared first: most steps publish nothing, and then nothing is done.
    """

    def __init__(self, topics: MavlinkTopics) -> None:
        self._watched = [(watch, watch.topic(topics)) for watch in _WATCHES]
        self._counts = [0] * len(self._watched)
        self._keys: list[Hashable] = [None] * len(self._watched)

    def take(self) -> list[int]:
        """Ids of the messages whose contents have changed since the last call, each once."""
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
