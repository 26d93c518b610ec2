"""The state of sensors and of readiness to arm, as ground stations receive it."""

import math
from enum import IntEnum
from typing import Final, NamedTuple

from uav_firmware.modules.commander.commands.dispatch import arming_refusal
from uav_firmware.modules.commander.commands.flight_commands import Situation
from uav_firmware.modules.commander.health_checks import (
    GPS_STALE_S,
    IMU_STALE_S,
    SENSOR_STALE_S,
    healthy_in_flight,
)
from uav_firmware.modules.commander.vehicle_view import SensorAges, VehicleView
from uav_firmware.msg.estimate import AidSource
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import FenceBreach, GeofenceStatus
from uav_firmware.msg.sensors import FIX_3D, SensorsStatus
from uav_firmware.msg.status import NavigationState


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


def present_bits(ages: SensorAges) -> int:
    """Sensors that have delivered once, and the controllers, which are always present."""
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
    """Present sensors and controllers in use: all but a disabled geofence."""
    off = view.fence is not None and not view.fence.enabled
    return present & ~SensorBit.GEOFENCE if off else present


def healthy_bits(view: VehicleView, *, ready: bool) -> int:
    """Sensors that deliver, and controllers whose inputs are valid."""
    ages, estimate, stopped = view.ages, view.position, view.stopped
    gps_good = ages.gps < GPS_STALE_S and view.gps is not None and view.gps.fix_type >= FIX_3D
    heading = estimate is not None and estimate.heading_valid
    height = estimate is not None and estimate.altitude_valid
    # The receiver delivers, but the estimate of the position is lost: the fault is in AHRS
    unaided = view.dead_reckoning or not view.position_valid
    lost = gps_good and view.home is not None and unaided
    imu_good = ages.imu < IMU_STALE_S and view.imu_delivers
    gyros, accels, baros, mags = _no_instance_failed(view.sensors)
    # Without an inertial sensor neither motion nor rotor failures are known
    bits = _propulsion_bits(view.failure if imu_good or view.crashed else None)
    for healthy, bit in (
        (imu_good, SensorBit.ANGULAR_RATE_CONTROL),
        (imu_good and accels and not view.accel_broken, SensorBit.ACCEL_3D),
        (imu_good and gyros and not view.gyro_broken, SensorBit.GYRO_3D),
        (
            ages.baro < SENSOR_STALE_S and baros and AidSource.BAROMETER not in stopped,
            SensorBit.ABSOLUTE_PRESSURE,
        ),
        (ages.mag < SENSOR_STALE_S and mags, SensorBit.MAG_3D),
        (gps_good and not stopped & _GPS_SOURCES, SensorBit.GPS),
        (ages.battery < SENSOR_STALE_S, SensorBit.BATTERY),
        (
            ages.range < SENSOR_STALE_S and not (view.terrain and view.terrain.has_failed),
            SensorBit.LASER_POSITION,
        ),
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


def _no_instance_failed(sensors: SensorsStatus | None) -> tuple[bool, bool, bool, bool]:
    """For gyroscopes, accelerometers, barometers, compasses: whether no instance has failed.

    MAVLink has one bit for all instances; the text names the one that has failed.
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
    """One failed rotor clears MOTOR_OUTPUTS; more, all too slow, or a crash clear PROPULSION."""
    bits: int = SensorBit.MOTOR_OUTPUTS | SensorBit.PROPULSION
    if failure is None:
        return bits
    if failure.propulsion_weak or failure.crash or failure.failed_motors.bit_count() > 1:
        return bits & ~SensorBit.PROPULSION
    return bits & ~SensorBit.MOTOR_OUTPUTS if failure.failed_motors else bits


def _inside_fence(fence: GeofenceStatus | None) -> bool:
    """Whether no boundary is crossed; without the bit ground stations report a breach."""
    return fence is None or (fence.breach is FenceBreach.NONE and not fence.margin_m < 0.0)


HEALTH_PERIOD_US: Final = 100_000
"""10 Hz [us], for failsafes and readiness."""


class Health(NamedTuple):
    """Readiness and sensors at the last check."""

    due_us: int  # [us] Of the next check
    mode: NavigationState
    armed: bool
    ready: bool = False  # Arming would be accepted; in flight: all its checks of health pass
    present: int = 0  # [-] MAV_SYS_STATUS_SENSOR bits
    enabled: int = 0  # [-]
    healthy: int = 0  # [-]


def check_health(situation: Situation) -> Health:
    """Run all checks once."""
    view = situation.view
    if situation.armed:
        ready = healthy_in_flight(view, situation.params)
    else:
        ready = arming_refusal(situation) is None
    present = present_bits(view.ages)
    return Health(
        view.now_us + HEALTH_PERIOD_US,
        situation.mode,
        situation.armed,
        ready,
        present,
        enabled_bits(view, present),
        healthy_bits(view, ready=ready),
    )
