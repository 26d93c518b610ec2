"""Sensors and estimates as PX4's messages."""

import math
from typing import Final

from uav_firmware.lib.atmosphere import air_density, altitude_from_pressure
from uav_firmware.modules.logger.ulog import Values, declare
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.estimate import (
    AidSource,
    EstimatorStatus,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
)
from uav_firmware.msg.sensors import SensorBaro, SensorGps, SensorImu, SensorMag

_CAPACITY_MAX_MAH: Final = 65_535  # the field has two bytes


def _vehicle_attitude(attitude: VehicleAttitude) -> Values:
    return (attitude.time_us, *attitude.q_ned_frd)


def _angular_velocity(attitude: VehicleAttitude) -> Values:
    return (attitude.time_us, *attitude.rate_frd)


def _local_position(position: VehicleLocalPosition) -> Values:
    resets = position.resets
    return (
        position.time_us,
        position.origin_latitude_deg,
        position.origin_longitude_deg,
        position.origin_altitude_amsl_m,
        *position.position_ned,
        *position.velocity_ned,
        *position.acceleration_ned,
        position.heading,
        position.horizontal_accuracy_m,
        position.vertical_accuracy_m,
        position.position_valid,
        position.altitude_valid,
        position.velocity_valid,
        position.velocity_valid,
        position.heading_valid,
        position.position_valid,
        position.altitude_valid,
        *resets.position_delta_ned[:2],
        resets.position_delta_ned[2],
        *resets.velocity_delta_ned[:2],
        resets.velocity_delta_ned[2],
        resets.heading_delta,
        resets.xy_count % 256,
        resets.z_count % 256,
        resets.velocity_xy_count % 256,
        resets.velocity_z_count % 256,
        resets.heading_count % 256,
    )


def _global_position(position: VehicleGlobalPosition) -> Values:
    return (*position,)


def _sensor_combined(imu: SensorImu) -> Values:
    return (imu.time_us, *imu.rate_frd, *imu.specific_force_frd)


def _air_data(baro: SensorBaro) -> Values:
    return (
        baro.time_us,
        altitude_from_pressure(baro.pressure_pa),
        baro.pressure_pa,
        baro.temperature_c,
        air_density(baro.pressure_pa, baro.temperature_c),
    )


def _magnetometer(mag: SensorMag) -> Values:
    return (mag.time_us, *mag.field_frd)


def _gps(gps: SensorGps) -> Values:
    north, east, down = gps.velocity_ned
    speed = math.hypot(north, east)
    return (
        gps.time_us,
        gps.time_utc_us,
        gps.latitude_deg,
        gps.longitude_deg,
        gps.altitude_amsl_m,
        round(gps.latitude_deg * 1e7),
        round(gps.longitude_deg * 1e7),
        round(gps.altitude_amsl_m * 1e3),
        gps.speed_accuracy_m_s,
        gps.horizontal_accuracy_m,
        gps.vertical_accuracy_m,
        gps.hdop,
        gps.vdop,
        speed,
        north,
        east,
        down,
        math.atan2(east, north),
        gps.fix_type,
        True,
        gps.satellites_used,
    )


def _battery(battery: BatteryStatus) -> Values:
    return (
        battery.time_us,
        True,
        battery.voltage_v,
        battery.current_a,
        battery.consumed_ah * 1e3,
        battery.remaining,
        min(round(battery.capacity_ah * 1e3), _CAPACITY_MAX_MAH),
    )


def _estimator_status(status: EstimatorStatus) -> Values:
    return (
        status.time_us,
        status.horizontal_accuracy_m,
        status.vertical_accuracy_m,
        status.velocity_ratio,
        status.horizontal_position_ratio,
        status.vertical_position_ratio,
        status.mag_ratio,
        status.flags,
        *(
            source in status.stopped
            for source in (
                AidSource.GPS_POSITION,
                AidSource.GPS_VELOCITY,
                AidSource.GPS_HEIGHT,
                AidSource.BAROMETER,
            )
        ),
    )


def _sensor_bias(status: EstimatorStatus) -> Values:
    return (status.time_us, *status.gyro_bias_frd)


VEHICLE_ATTITUDE: Final = declare("vehicle_attitude", "float[4] q", _vehicle_attitude)
VEHICLE_ANGULAR_VELOCITY: Final = declare(
    "vehicle_angular_velocity", "float[3] xyz", _angular_velocity
)
VEHICLE_LOCAL_POSITION: Final = declare(
    "vehicle_local_position",
    "double ref_lat; double ref_lon; float ref_alt; float x; float y; float z; "
    "float vx; float vy; float vz; float ax; float ay; float az; float heading; "
    "float eph; float epv; bool xy_valid; bool z_valid; bool v_xy_valid; bool v_z_valid; "
    "bool heading_good_for_control; bool xy_global; bool z_global; "
    "float[2] delta_xy; float delta_z; float[2] delta_vxy; float delta_vz; float delta_heading; "
    "uint8_t xy_reset_counter; uint8_t z_reset_counter; uint8_t vxy_reset_counter; "
    "uint8_t vz_reset_counter; uint8_t heading_reset_counter",
    _local_position,
)
VEHICLE_GLOBAL_POSITION: Final = declare(
    "vehicle_global_position",
    "double lat; double lon; float alt; float eph; float epv",
    _global_position,
)
SENSOR_COMBINED: Final = declare(
    "sensor_combined", "float[3] gyro_rad; float[3] accelerometer_m_s2", _sensor_combined
)
VEHICLE_AIR_DATA: Final = declare(
    "vehicle_air_data",
    "float baro_alt_meter; float baro_pressure_pa; float ambient_temperature; float rho",
    _air_data,
)
VEHICLE_MAGNETOMETER: Final = declare(
    "vehicle_magnetometer", "float[3] magnetometer_ga", _magnetometer
)
VEHICLE_GPS_POSITION: Final = declare(
    "vehicle_gps_position",
    "uint64_t time_utc_usec; double latitude_deg; double longitude_deg; double altitude_msl_m; "
    "int32_t lat; int32_t lon; int32_t alt; float s_variance_m_s; float eph; float epv; "
    "float hdop; float vdop; float vel_m_s; float vel_n_m_s; float vel_e_m_s; float vel_d_m_s; "
    "float cog_rad; uint8_t fix_type; bool vel_ned_valid; uint8_t satellites_used",
    _gps,
)
BATTERY_STATUS: Final = declare(
    "battery_status",
    "bool connected; float voltage_v; float current_a; float discharged_mah; float remaining; "
    "uint16_t capacity",
    _battery,
)
ESTIMATOR_STATUS: Final = declare(
    "estimator_status",
    "float pos_horiz_accuracy; float pos_vert_accuracy; float vel_test_ratio; "
    "float pos_test_ratio; float hgt_test_ratio; float mag_test_ratio; "
    "uint16_t solution_status_flags; bool gps_position_stopped; bool gps_velocity_stopped; "
    "bool gps_height_stopped; bool barometer_stopped",
    _estimator_status,
)
ESTIMATOR_SENSOR_BIAS: Final = declare("estimator_sensor_bias", "float[3] gyro_bias", _sensor_bias)
