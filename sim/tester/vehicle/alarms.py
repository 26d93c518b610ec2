"""The alarms that a person can set, and how each shows on MAVLink."""

from enum import Enum
from typing import Final

# MAV_SYS_STATUS_SENSOR, https://mavlink.io/en/messages/common.html#MAV_SYS_STATUS_SENSOR
_GYROSCOPE: Final = 1 << 0
_ACCELEROMETER: Final = 1 << 1
_GPS: Final = 1 << 5
_LASER_POSITION: Final = 1 << 8
_MOTOR_OUTPUTS: Final = 1 << 15
_GEOFENCE: Final = 1 << 20
_AHRS: Final = 1 << 21
_PREARM_CHECK: Final = 1 << 28
_PROPULSION: Final = 1 << 30

PRESENT: Final = (
    _GYROSCOPE
    | _ACCELEROMETER
    | _GPS
    | _LASER_POSITION
    | _MOTOR_OUTPUTS
    | _GEOFENCE
    | _AHRS
    | _PREARM_CHECK
    | _PROPULSION
)
"""What the vehicle says that it has, and has switched on."""


class Alarm(Enum):
    """An alarm: the seed's words for it, and the bits of SYS_STATUS that are ill with it.

    The camera's shows by the silence of the camera's heartbeat instead, the humidity sensor's two
    by the silence of its measurements.
    """

    SONAR = "Equipment sonar", _LASER_POSITION
    PROPELLERS = "Equipment propellers", _MOTOR_OUTPUTS
    IMU = "Equipment IMU", _GYROSCOPE | _ACCELEROMETER
    CAMERA = "Equipment camera", 0
    GPS = "Equipment GPS", _GPS
    HUMIDITY_SENSOR = "Equipment humidity sensor", 0
    LOCALIZATION = "Function localization", _AHRS
    PROPULSION = "Function propulsion", _PROPULSION
    NAVIGATION = "Function navigation", _GEOFENCE
    HUMIDITY_SENSING = "Function humidity sensing", 0

    def __init__(self, label: str, ill: int) -> None:
        self.label = label
        self.ill = ill
