"""What a vehicle says of its own health, as AFarCloud's alarms; one table.

Something has failed when it was healthy, is present and enabled, and has been unhealthy for two
seconds. It is told once, and again only after it was healthy in between.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from afarcloud.enumerations import AlarmCode, AlarmType
from mavlink_broker.dialect import Message, mavlink

DEBOUNCE_S: Final = 2.0
CAMERA_SILENT_S: Final = 5.0


class Failure(NamedTuple):
    """One of AFarCloud's alarms."""

    code: AlarmCode
    text: str

    @property
    def type(self) -> AlarmType:
        """Codes from 50 on are functions."""
        if self.code >= AlarmCode.FUNCTION_LOCALISATION:
            return AlarmType.FUNCTION_UNAVAILABLE
        return AlarmType.EQUIPMENT_FAILURE


class _Row(NamedTuple):
    bits: int  # MAV_SYS_STATUS_SENSOR, any of them
    failure: Failure


_TABLE: Final = (
    _Row(
        mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION | mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY,
        Failure(AlarmCode.EQUIPMENT_SONAR, "range finder failed"),
    ),
    _Row(
        mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS,
        Failure(AlarmCode.EQUIPMENT_PROPELLERS, "motor failed"),
    ),
    _Row(
        mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL,
        Failure(AlarmCode.EQUIPMENT_IMU, "inertial sensors failed"),
    ),
    _Row(mavlink.MAV_SYS_STATUS_SENSOR_GPS, Failure(AlarmCode.EQUIPMENT_GPS, "GPS lost")),
    _Row(
        mavlink.MAV_SYS_STATUS_AHRS,
        Failure(AlarmCode.FUNCTION_LOCALISATION, "the vehicle does not know where it is"),
    ),
    _Row(
        mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION,
        Failure(AlarmCode.FUNCTION_PROPULSION, "propulsion failed"),
    ),
    _Row(
        mavlink.MAV_SYS_STATUS_GEOFENCE,
        Failure(AlarmCode.FUNCTION_NAVIGATION, "geofence breached"),
    ),
)
_CAMERA: Final = Failure(AlarmCode.EQUIPMENT_CAMERA, "the camera is silent")


@dataclass(slots=True)
class AlarmWatch:
    """Watches one vehicle."""

    _well: set[AlarmCode] = field(default_factory=set)  # Was healthy, not yet told otherwise
    _ill_since: dict[AlarmCode, float] = field(default_factory=dict)
    _camera_at: float | None = None

    def receive(self, message: Message, now: float) -> list[Failure]:
        """Take SYS_STATUS; gives what has failed."""
        if message.get_type() != "SYS_STATUS":
            return []
        watched = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
        failed = watched & ~message.onboard_control_sensors_health
        return [
            row.failure
            for row in _TABLE
            if watched & row.bits and self._has_failed(row.failure, failed & row.bits != 0, now)
        ]

    def camera_heard(self, now: float) -> None:
        """Take a heartbeat of the vehicle's camera."""
        self._camera_at = now

    def tick(self, now: float, *, is_connected: bool) -> Iterable[Failure]:
        """Notice a camera that was there and is not, while the vehicle itself is heard."""
        if self._camera_at is not None and not is_connected:
            self._camera_at = now
        if self._camera_at is not None and now - self._camera_at >= CAMERA_SILENT_S:
            self._camera_at = None
            yield _CAMERA

    def forget(self) -> None:
        """Begin anew: the vehicle was restarted, or its link was lost."""
        self._well.clear()
        self._ill_since.clear()
        self._camera_at = None

    def _has_failed(self, failure: Failure, is_ill: bool, now: float) -> bool:  # noqa: FBT001  # private
        code = failure.code
        if not is_ill:
            self._well.add(code)
            self._ill_since.pop(code, None)
            return False
        since = self._ill_since.setdefault(code, now)
        if code not in self._well or now - since < DEBOUNCE_S:
            return False
        self._well.discard(code)
        return True
