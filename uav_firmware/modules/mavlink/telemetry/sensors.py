"""Builders of messages about sensors, and of the simulator's ground truth.

MAVLink has a message for the hygrometer only; other farm sensors use NAMED_VALUE_FLOAT.
"""

import math
from typing import Final

from uav_firmware.lib.atmosphere import altitude_from_pressure
from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.mavlink.telemetry.context import (
    NAN,
    UINT8_MAX,
    UINT16_MAX,
    Context,
    boot_ms,
    compass_centidegrees,
    degrees_e7,
    int16,
    millimetres,
    saturated,
    uint16,
    uint32,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.msg.sensors import SensorBaro, SensorImu, SensorMag
from uav_firmware.msg.vectors import Vector3

_ACCEL_AND_GYRO: Final = 0b111_111
_MAG: Final = 0b111 << 6
_PRESSURE_HEIGHT_TEMPERATURE: Final = 1 << 9 | 1 << 11 | 1 << 12
_NO_BARO: Final = SensorBaro(time_us=0, pressure_pa=NAN, temperature_c=NAN)
_NO_MAG: Final = SensorMag(time_us=0, field_frd=(NAN, NAN, NAN))
SAMPLE_TIMEOUT_US: Final = 3_000_000
"""Older samples are not sent."""
SAMPLE_US: Final = 40_000
_DECAY: Final = 0.96
"""Weight of the previous mean per sample: a time constant of one second at 25 Hz."""


def _pressure_altitude_m(pressure_pa: float) -> float:
    """Altitude in the standard atmosphere [m]; NaN without a pressure."""
    return altitude_from_pressure(pressure_pa) if pressure_pa > 0.0 else NAN


def gps_raw_int(context: Context) -> Message | None:
    """GPS_RAW_INT; alt_ellipsoid is 0 when the receiver does not report it."""
    gps = context.topics.sensor_gps.value
    if gps is None:
        return None
    north, east, _ = gps.velocity_ned
    ellipsoid_m = gps.altitude_ellipsoid_m if math.isfinite(gps.altitude_ellipsoid_m) else 0.0
    return mavlink.MAVLink_gps_raw_int_message(
        time_usec=gps.time_us,
        fix_type=gps.fix_type,
        lat=degrees_e7(gps.latitude_deg),
        lon=degrees_e7(gps.longitude_deg),
        alt=millimetres(gps.altitude_amsl_m),
        alt_ellipsoid=millimetres(ellipsoid_m),
        eph=uint16(gps.hdop * 1e2),
        epv=uint16(gps.vdop * 1e2),
        vel=uint16(math.hypot(north, east) * 1e2),
        cog=compass_centidegrees(math.atan2(east, north)),
        satellites_visible=saturated(gps.satellites_used, 0, UINT8_MAX),
        h_acc=uint32(gps.horizontal_accuracy_m * 1e3),
        v_acc=uint32(gps.vertical_accuracy_m * 1e3),
        vel_acc=uint32(gps.speed_accuracy_m_s * 1e3),
    )


def scaled_pressure(context: Context) -> Message | None:
    """SCALED_PRESSURE: static pressure [hPa] and the sensor's temperature."""
    baro = context.topics.sensor_baro.value
    if baro is None:
        return None
    return mavlink.MAVLink_scaled_pressure_message(
        time_boot_ms=boot_ms(baro.time_us),
        press_abs=baro.pressure_pa / 1e2,
        press_diff=0.0,
        temperature=int16(baro.temperature_c * 1e2),
    )


def distance_sensor(context: Context) -> Message | None:
    """DISTANCE_SENSOR of the range finder; out of range is reported as maximum plus 1 cm."""
    sample = context.topics.sensor_range.value
    if sample is None:
        return None
    maximum_cm = round(sample.maximum_m * 1e2)
    in_range = math.isfinite(sample.distance_m)
    return mavlink.MAVLink_distance_sensor_message(
        time_boot_ms=boot_ms(sample.time_us),
        min_distance=round(sample.minimum_m * 1e2),
        max_distance=maximum_cm,
        current_distance=uint16(sample.distance_m * 1e2) if in_range else maximum_cm + 1,
        type=mavlink.MAV_DISTANCE_SENSOR_LASER,
        id=0,
        orientation=mavlink.MAV_SENSOR_ROTATION_PITCH_270,
        covariance=UINT8_MAX,
        signal_quality=100 if in_range else 1,
    )


def highres_imu(context: Context) -> Message | None:
    """HIGHRES_IMU: the newest value of each sensor; `fields_updated` marks the valid ones."""
    topics = context.topics
    imu, mag, baro = topics.sensor_imu.value, topics.sensor_mag.value, topics.sensor_baro.value
    if imu is None:
        return None
    pressure, field = baro or _NO_BARO, (mag or _NO_MAG).field_frd
    return mavlink.MAVLink_highres_imu_message(
        time_usec=imu.time_us,
        xacc=imu.specific_force_frd[0],
        yacc=imu.specific_force_frd[1],
        zacc=imu.specific_force_frd[2],
        xgyro=imu.rate_frd[0],
        ygyro=imu.rate_frd[1],
        zgyro=imu.rate_frd[2],
        xmag=field[0],
        ymag=field[1],
        zmag=field[2],
        abs_pressure=pressure.pressure_pa / 1e2,
        diff_pressure=NAN,
        pressure_alt=_pressure_altitude_m(pressure.pressure_pa),
        temperature=pressure.temperature_c,
        fields_updated=_ACCEL_AND_GYRO
        | (_MAG if mag else 0)
        | (_PRESSURE_HEIGHT_TEMPERATURE if baro else 0),
    )


def scaled_imu(context: Context) -> Message | None:
    """SCALED_IMU: specific force [mG], rate [mrad/s], field [mgauss]; 0 if not measured."""
    imu, mag = context.topics.sensor_imu.value, context.topics.sensor_mag.value
    if imu is None:
        return None
    force = [int16(axis * 1e3 / STANDARD_GRAVITY_M_S2) for axis in imu.specific_force_frd]
    rate = [int16(axis * 1e3) for axis in imu.rate_frd]
    field = [int16(axis * 1e3) for axis in (mag or _NO_MAG).field_frd]
    return mavlink.MAVLink_scaled_imu_message(boot_ms(imu.time_us), *force, *rate, *field)


def vibration(context: Context) -> Message | None:
    """VIBRATION: mean change between accelerometer samples; clipping is not counted."""
    if context.topics.sensor_imu.value is None:
        return None
    x, y, z = context.vibration_frd
    return mavlink.MAVLink_vibration_message(
        time_usec=context.now_us,
        vibration_x=x,
        vibration_y=y,
        vibration_z=z,
        clipping_0=0,
        clipping_1=0,
        clipping_2=0,
    )


def hil_state_quaternion(context: Context) -> Message | None:
    """HIL_STATE_QUATERNION: ground truth of a simulated vehicle."""
    truth = context.topics.sensor_truth.value
    if truth is None:
        return None
    velocity, force = truth.velocity_ned, truth.acceleration_frd
    airspeed = uint16(truth.airspeed_m_s * 1e2)
    milli_g = 1e3 / STANDARD_GRAVITY_M_S2
    return mavlink.MAVLink_hil_state_quaternion_message(
        time_usec=truth.time_us,
        attitude_quaternion=list(truth.q_ned_frd),
        rollspeed=truth.rate_frd[0],
        pitchspeed=truth.rate_frd[1],
        yawspeed=truth.rate_frd[2],
        lat=degrees_e7(truth.latitude_deg),
        lon=degrees_e7(truth.longitude_deg),
        alt=millimetres(truth.altitude_amsl_m),
        vx=int16(velocity[0] * 1e2),
        vy=int16(velocity[1] * 1e2),
        vz=int16(velocity[2] * 1e2),
        ind_airspeed=airspeed,
        true_airspeed=airspeed,
        xacc=int16(force[0] * milli_g),
        yacc=int16(force[1] * milli_g),
        zacc=int16(force[2] * milli_g),
    )


def hygrometer_sensor(context: Context) -> Message | None:
    """HYGROMETER_SENSOR: hundredths of a degree and of a percent; UINT16_MAX without humidity."""
    sample = context.topics.sensor_hygrometer.value
    if sample is None or context.now_us - sample.time_us > SAMPLE_TIMEOUT_US:
        return None
    humidity = sample.relative_humidity_percent
    return mavlink.MAVLink_hygrometer_sensor_message(
        id=0,
        temperature=int16(sample.air_temperature_c * 1e2),
        humidity=uint16(humidity * 1e2) if math.isfinite(humidity) else UINT16_MAX,
    )


def named_values(context: Context) -> tuple[Message, ...] | None:
    """NAMED_VALUE_FLOAT of soil and light; soil moisture in percent by volume."""
    sample = context.topics.sensor_ground.value
    if sample is None or context.now_us - sample.time_us > SAMPLE_TIMEOUT_US:
        return None
    values = (
        ("soil_moist", sample.soil_moisture * 1e2),
        ("temp_soil", sample.soil_temperature_c),
        ("light", sample.illuminance_lx),
    )
    return tuple(
        mavlink.MAVLink_named_value_float_message(boot_ms(sample.time_us), name.encode(), value)
        for name, value in values
    )


class VibrationMeter:
    """Exponential mean of the change of specific force between samples, per body axis [m/s^2].

    Uses 25 samples a second to save processor time.
    """

    def __init__(self) -> None:
        self.level_frd: Vector3 = (0.0, 0.0, 0.0)
        self._last: Vector3 | None = None
        self._due_us = 0

    def update(self, imu: SensorImu | None, now_us: int) -> None:
        """Add the newest inertial sample."""
        if now_us < self._due_us or imu is None:
            return
        self._due_us = now_us + SAMPLE_US
        force, last = imu.specific_force_frd, self._last or imu.specific_force_frd
        x, y, z = (
            _DECAY * level + (1.0 - _DECAY) * abs(new - old)
            for level, new, old in zip(self.level_frd, force, last, strict=True)
        )
        self.level_frd = (x, y, z)
        self._last = force
