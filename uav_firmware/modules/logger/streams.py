"""What is logged how often: one table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from uav_firmware.bus import Topic
from uav_firmware.modules.logger import flight_messages as flight
from uav_firmware.modules.logger import measured_messages as measured
from uav_firmware.modules.logger.logged_message import LoggedMessage
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
)
from uav_firmware.msg.mission import MissionProgress
from uav_firmware.msg.sensors import SensorBaro, SensorGps, SensorImu, SensorMag
from uav_firmware.msg.setpoints import (
    ControlAllocatorStatus,
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
    VehicleTorqueThrustSetpoint,
)
from uav_firmware.msg.status import HomePosition, LandDetected, VehicleStatus

HIGH_RATE_BIT: Final = 16
"""Of SDLOG_PROFILE."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggerTopics:
    """What the logger reads."""

    attitude: Topic[VehicleAttitude]
    local_position: Topic[VehicleLocalPosition]
    global_position: Topic[VehicleGlobalPosition]
    estimator_status: Topic[EstimatorStatus]
    imu: Topic[SensorImu]
    baro: Topic[SensorBaro]
    mag: Topic[SensorMag]
    gps: Topic[SensorGps]
    battery: Topic[BatteryStatus]
    trajectory_setpoint: Topic[TrajectorySetpoint]
    attitude_setpoint: Topic[VehicleAttitudeSetpoint]
    rates_setpoint: Topic[VehicleRatesSetpoint]
    torque_thrust: Topic[VehicleTorqueThrustSetpoint]
    allocator_status: Topic[ControlAllocatorStatus]
    motors: Topic[ActuatorMotors]
    vehicle_status: Topic[VehicleStatus]
    land_detected: Topic[LandDetected]
    home: Topic[HomePosition]
    mission_progress: Topic[MissionProgress]


class Stream(NamedTuple):
    """One logged message; it is written at most this often, and only when it is new."""

    message: LoggedMessage
    topic: Callable[[LoggerTopics], Topic[Any]]
    rate_hz: int
    high_rate_hz: int  # in the high-rate profile
    repeated: bool = False  # written twice a second, new or not: what seldom changes


STREAMS: Final = (
    Stream(measured.VEHICLE_ATTITUDE, lambda t: t.attitude, 50, 250),
    Stream(measured.VEHICLE_ANGULAR_VELOCITY, lambda t: t.attitude, 25, 250),
    Stream(measured.VEHICLE_LOCAL_POSITION, lambda t: t.local_position, 10, 50),
    Stream(measured.VEHICLE_GLOBAL_POSITION, lambda t: t.global_position, 10, 10),
    Stream(measured.ESTIMATOR_STATUS, lambda t: t.estimator_status, 5, 5),
    Stream(measured.ESTIMATOR_SENSOR_BIAS, lambda t: t.estimator_status, 1, 1),
    Stream(measured.SENSOR_COMBINED, lambda t: t.imu, 25, 250),
    Stream(measured.VEHICLE_AIR_DATA, lambda t: t.baro, 5, 50),
    Stream(measured.VEHICLE_MAGNETOMETER, lambda t: t.mag, 5, 50),
    Stream(measured.VEHICLE_GPS_POSITION, lambda t: t.gps, 5, 10),
    Stream(measured.BATTERY_STATUS, lambda t: t.battery, 5, 5),
    Stream(flight.VEHICLE_LOCAL_POSITION_SETPOINT, lambda t: t.trajectory_setpoint, 10, 50),
    Stream(flight.TRAJECTORY_SETPOINT, lambda t: t.trajectory_setpoint, 5, 50),
    Stream(flight.VEHICLE_ATTITUDE_SETPOINT, lambda t: t.attitude_setpoint, 25, 50),
    Stream(flight.VEHICLE_RATES_SETPOINT, lambda t: t.rates_setpoint, 25, 250),
    Stream(flight.VEHICLE_TORQUE_SETPOINT, lambda t: t.torque_thrust, 10, 250),
    Stream(flight.VEHICLE_THRUST_SETPOINT, lambda t: t.torque_thrust, 10, 250),
    Stream(flight.CONTROL_ALLOCATOR_STATUS, lambda t: t.allocator_status, 5, 50),
    Stream(flight.ACTUATOR_MOTORS, lambda t: t.motors, 25, 250),
    Stream(flight.VEHICLE_STATUS, lambda t: t.vehicle_status, 50, 50),  # Each change
    Stream(flight.VEHICLE_LAND_DETECTED, lambda t: t.land_detected, 10, 10),
    Stream(flight.HOME_POSITION, lambda t: t.home, 5, 5, repeated=True),
    Stream(flight.MISSION_RESULT, lambda t: t.mission_progress, 10, 10, repeated=True),
)
