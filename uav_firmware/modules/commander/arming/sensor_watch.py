"""How long ago each sensor was heard, and the MAVLink bits that tell of it."""

import math
from enum import IntEnum

from uav_firmware.bus import Topic
from uav_firmware.modules.commander.arming.health_checks import (
    GPS_STALE_S,
    IMU_STALE_S,
    SENSOR_STALE_S,
)
from uav_firmware.modules.commander.vehicle_view import SensorAges, VehicleView
from uav_firmware.msg.estimate import AidSource
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import FenceBreach, GeofenceStatus
from uav_firmware.msg.sensors import SensorsStatus


class SensorBit(IntEnum):
    """MAVLink's MAV_SYS_STATUS_SENSOR; a set of them is a plain int, made 50 times a second."""

    GYRO_3D = 0x1
    ACCEL_3D = 0x2
    MAG_3D = 0x4
    ABSOLUTE_PRESSURE = 0x8
    GPS = 0x20
    LASER_POSITION = 0x100
    ANGULAR_RATE_CONTROL = 0x400
    ATTITUDE_STABILIZATION = 0x800
    YAW_POSITION = 0x1000
    Z_ALTITUDE_CONTROL = 0x2000
    XY_POSITION_CONTROL = 0x4000
    MOTOR_OUTPUTS = 0x8000
    GEOFENCE = 0x100000
    AHRS = 0x200000
    BATTERY = 0x2000000
    PREARM_CHECK = 0x10000000
    PROPULSION = 0x40000000


_IMU = SensorBit.GYRO_3D | SensorBit.ACCEL_3D
_CONTROL = (
    SensorBit.ANGULAR_RATE_CONTROL
    | SensorBit.ATTITUDE_STABILIZATION
    | SensorBit.YAW_POSITION
    | SensorBit.Z_ALTITUDE_CONTROL
    | SensorBit.XY_POSITION_CONTROL
    | SensorBit.MOTOR_OUTPUTS
    | SensorBit.GEOFENCE
    | SensorBit.AHRS
    | SensorBit.PREARM_CHECK
    | SensorBit.PROPULSION
)


_GPS_SOURCES = AidSource.GPS_POSITION | AidSource.GPS_VELOCITY | AidSource.GPS_HEIGHT


class Freshness:
    """Age of a topic's newest value, by when it was seen."""

    __slots__ = ("_count", "_seen_us", "_topic")

    def __init__(self, topic: Topic[object]) -> None:
        self._topic = topic
        self._count = 0
        self._seen_us: int | None = None

    def age(self, now_us: int) -> float:
        """Time since the last new value [s]; infinite when there was none."""
        if self._topic.count != self._count:
            self._count = self._topic.count
            self._seen_us = now_us
        return math.inf if self._seen_us is None else (now_us - self._seen_us) * 1e-6


def present_bits(ages: SensorAges) -> int:
    """Sensors that have ever been heard, and the controllers, which are always there."""
    bits: int = _CONTROL
    for age, bit in (
        (ages.imu, _IMU),
        (ages.baro, SensorBit.ABSOLUTE_PRESSURE),
        (ages.mag, SensorBit.MAG_3D),
        (ages.gps, SensorBit.GPS),
        (ages.battery, SensorBit.BATTERY),
        (ages.range, SensorBit.LASER_POSITION),
    ):
        if age < math.inf:
            bits |= bit
    return bits


def enabled_bits(view: VehicleView, present: int) -> int:
    """What of the things present is in use: all but a geofence that is switched off."""
    off = view.fence is not None and not view.fence.enabled
    return present & ~SensorBit.GEOFENCE if off else present


def healthy_bits(view: VehicleView, *, ready: bool) -> int:
    """Sensors that deliver and controllers that have what they need."""
    ages, estimate, stopped = view.ages, view.position, view.stopped
    gps_good = ages.gps < GPS_STALE_S and view.gps is not None and view.gps.fix_type >= 3
    heading = estimate is not None and estimate.heading_valid
    height = estimate is not None and estimate.altitude_valid
    # A receiver that delivers and an estimate that was there and is not: the fault is between
    unaided = view.dead_reckoning or not view.position_valid
    lost = gps_good and view.home is not None and unaided
    imu_good = ages.imu < IMU_STALE_S and view.imu_delivers
    gyros, accels, baros, mags = _whole(view.sensors)
    # Without it nobody can tell how the vehicle moves, nor what its rotors do to it
    bits = _propulsion_bits(view.failure if imu_good or view.crashed else None)
    for healthy, bit in (
        (imu_good, SensorBit.ANGULAR_RATE_CONTROL),
        (imu_good and accels and not view.accel_broken, SensorBit.ACCEL_3D),
        (imu_good and gyros and not view.gyro_broken, SensorBit.GYRO_3D),
        (
            ages.baro < SENSOR_STALE_S and baros and not stopped & AidSource.BAROMETER,
            SensorBit.ABSOLUTE_PRESSURE,
        ),
        (ages.mag < SENSOR_STALE_S and mags, SensorBit.MAG_3D),
        (gps_good and not stopped & _GPS_SOURCES, SensorBit.GPS),
        (ages.battery < SENSOR_STALE_S, SensorBit.BATTERY),
        (ages.range < SENSOR_STALE_S, SensorBit.LASER_POSITION),
        ((view.aligned and not lost) or not imu_good, SensorBit.AHRS),
        (view.aligned, SensorBit.ATTITUDE_STABILIZATION),
        (heading, SensorBit.YAW_POSITION),
        (height, SensorBit.Z_ALTITUDE_CONTROL),
        (view.position_valid, SensorBit.XY_POSITION_CONTROL),
        (_inside_fence(view.fence), SensorBit.GEOFENCE),
        (ready, SensorBit.PREARM_CHECK),
    ):
        if healthy:
            bits |= bit
    return bits


def _whole(sensors: SensorsStatus | None) -> tuple[bool, bool, bool, bool]:
    """Of which sensors no instance has failed: gyroscopes, accelerometers, barometers, compasses.

    MAVLink has one bit for all instances: it says that something has failed, the text what.
    """
    if sensors is None:
        return True, True, True, True
    return (
        not sensors.failed_gyros,
        not sensors.failed_accels,
        not sensors.failed_baros,
        not sensors.failed_mags,
    )


def _propulsion_bits(failure: FailureDetectorStatus | None) -> int:
    """One rotor that has failed is a part; more, all too slow, or a crash is the function."""
    bits: int = SensorBit.MOTOR_OUTPUTS | SensorBit.PROPULSION
    if failure is None:
        return bits
    if failure.propulsion_weak or failure.crash or failure.failed_motors.bit_count() > 1:
        return bits & ~SensorBit.PROPULSION
    return bits & ~SensorBit.MOTOR_OUTPUTS if failure.failed_motors else bits


def _inside_fence(fence: GeofenceStatus | None) -> bool:
    """Whether no boundary is crossed; without the bit ground stations tell of a breach."""
    return fence is None or (fence.breach is FenceBreach.NONE and not fence.margin_m < 0.0)
