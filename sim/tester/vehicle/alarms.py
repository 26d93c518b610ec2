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
"""Sensors that the vehicle reports as present and enabled."""


class Alarm(Enum):
    """An alarm: its label, and the bits of SYS_STATUS that are unhealthy with it.

    The camera's alarm stops the heartbeat of the camera instead, those of the humidity sensor
    change its measurements.
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
