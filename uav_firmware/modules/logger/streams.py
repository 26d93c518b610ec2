"""Table of the logged topics and their rates."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from uav_firmware.bus import Topic
from uav_firmware.modules.logger import flight_messages as flight
from uav_firmware.modules.logger import measured_messages as measured
from uav_firmware.modules.logger.ulog import LoggedMessage
from uav_firmware.topics import Topics

HIGH_RATE_BIT: Final = 16
"""Of SDLOG_PROFILE."""


class Stream(NamedTuple):
    """One logged message, written when it is new and at most at this rate."""

    message: LoggedMessage
    topic: Callable[[Topics], Topic[Any]]
    rate_hz: int
    high_rate_hz: int  # In the high-rate profile
    repeated: bool = False  # Written twice a second even if unchanged


STREAMS: Final = (
    Stream(measured.VEHICLE_ATTITUDE, lambda t: t.vehicle_attitude, 50, 250),
    Stream(measured.VEHICLE_ANGULAR_VELOCITY, lambda t: t.vehicle_attitude, 25, 250),
    Stream(measured.VEHICLE_LOCAL_POSITION, lambda t: t.vehicle_local_position, 10, 50),
    Stream(measured.VEHICLE_GLOBAL_POSITION, lambda t: t.vehicle_global_position, 10, 10),
    Stream(measured.ESTIMATOR_STATUS, lambda t: t.estimator_status, 5, 5),
    Stream(measured.ESTIMATOR_SENSOR_BIAS, lambda t: t.estimator_status, 1, 1),
    Stream(measured.SENSOR_COMBINED, lambda t: t.sensor_imu, 25, 250),
    Stream(measured.VEHICLE_AIR_DATA, lambda t: t.sensor_baro, 5, 50),
    Stream(measured.VEHICLE_MAGNETOMETER, lambda t: t.sensor_mag, 5, 50),
    Stream(measured.VEHICLE_GPS_POSITION, lambda t: t.sensor_gps, 5, 10),
    Stream(measured.BATTERY_STATUS, lambda t: t.battery_status, 5, 5),
    Stream(flight.VEHICLE_LOCAL_POSITION_SETPOINT, lambda t: t.trajectory_setpoint, 10, 50),
    Stream(flight.TRAJECTORY_SETPOINT, lambda t: t.trajectory_setpoint, 5, 50),
    Stream(flight.VEHICLE_ATTITUDE_SETPOINT, lambda t: t.vehicle_attitude_setpoint, 25, 50),
    Stream(flight.VEHICLE_RATES_SETPOINT, lambda t: t.vehicle_rates_setpoint, 25, 250),
    Stream(
        flight.VEHICLE_TORQUE_SETPOINT,
        lambda t: t.vehicle_torque_thrust_setpoint,
        10,
        250,
    ),
    Stream(
        flight.VEHICLE_THRUST_SETPOINT,
        lambda t: t.vehicle_torque_thrust_setpoint,
        10,
        250,
    ),
    Stream(flight.CONTROL_ALLOCATOR_STATUS, lambda t: t.control_allocator_status, 5, 50),
    Stream(flight.ACTUATOR_MOTORS, lambda t: t.actuator_motors, 25, 250),
    Stream(flight.VEHICLE_STATUS, lambda t: t.vehicle_status, 50, 50),  # Each change
    Stream(flight.VEHICLE_LAND_DETECTED, lambda t: t.land_detected, 10, 10),
    Stream(flight.HOME_POSITION, lambda t: t.home_position, 5, 5, repeated=True),
    Stream(flight.MISSION_RESULT, lambda t: t.mission_progress, 10, 10, repeated=True),
)
