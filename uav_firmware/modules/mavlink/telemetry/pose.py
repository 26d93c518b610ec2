"""Builders of messages about estimated position, velocity and attitude."""

import math
from typing import Final

from uav_firmware.lib.rotation import rotate_inverse, to_euler
from uav_firmware.modules.mavlink.telemetry.context import (
    NAN,
    UINT16_MAX,
    Context,
    boot_ms,
    compass_centidegrees,
    degrees_e7,
    int16,
    millimetres,
    saturated,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink


def attitude(context: Context) -> Message | None:
    """ATTITUDE: Euler angles and body rates."""
    value = context.topics.vehicle_attitude.value
    if value is None:
        return None
    roll, pitch, yaw = to_euler(value.q_ned_frd)
    rate = value.rate_frd
    return mavlink.MAVLink_attitude_message(
        time_boot_ms=boot_ms(value.time_us),
        roll=roll,
        pitch=pitch,
        yaw=yaw,
        rollspeed=rate[0],
        pitchspeed=rate[1],
        yawspeed=rate[2],
    )


def attitude_quaternion(context: Context) -> Message | None:
    """ATTITUDE_QUATERNION: scalar first, NED to body by MAVLink's convention of zero rotation."""
    value = context.topics.vehicle_attitude.value
    if value is None:
        return None
    q, rate = value.q_ned_frd, value.rate_frd
    return mavlink.MAVLink_attitude_quaternion_message(
        time_boot_ms=boot_ms(value.time_us),
        q1=q[0],
        q2=q[1],
        q3=q[2],
        q4=q[3],
        rollspeed=rate[0],
        pitchspeed=rate[1],
        yawspeed=rate[2],
    )


def local_position_ned(context: Context) -> Message | None:
    """LOCAL_POSITION_NED about the estimator's origin; None without a valid position."""
    value = context.topics.vehicle_local_position.value
    if value is None or not (value.position_valid and value.altitude_valid):
        return None
    position, velocity = value.position_ned, value.velocity_ned
    return mavlink.MAVLink_local_position_ned_message(
        time_boot_ms=boot_ms(value.time_us),
        x=position[0],
        y=position[1],
        z=position[2],
        vx=velocity[0],
        vy=velocity[1],
        vz=velocity[2],
    )


def odometry(context: Context) -> Message | None:
    """ODOMETRY: position and attitude in NED, velocity and rates in the body frame.

    Only the variances of the position are known; other covariances are NaN.
    """
    local, attitude = (
        context.topics.vehicle_local_position.value,
        context.topics.vehicle_attitude.value,
    )
    if local is None or attitude is None or not (local.position_valid and local.altitude_valid):
        return None
    x, y, z = local.position_ned
    vx, vy, vz = rotate_inverse(attitude.q_ned_frd, local.velocity_ned)
    roll_rate, pitch_rate, yaw_rate = attitude.rate_frd
    variance_xy = local.horizontal_accuracy_m**2
    variance_z = local.vertical_accuracy_m**2
    return mavlink.MAVLink_odometry_message(
        time_usec=local.time_us,
        frame_id=mavlink.MAV_FRAME_LOCAL_NED,
        child_frame_id=mavlink.MAV_FRAME_BODY_FRD,
        x=x,
        y=y,
        z=z,
        q=list(attitude.q_ned_frd),
        vx=vx,
        vy=vy,
        vz=vz,
        rollspeed=roll_rate,
        pitchspeed=pitch_rate,
        yawspeed=yaw_rate,
        pose_covariance=_upper_triangle((variance_xy, variance_xy, variance_z, NAN, NAN, NAN)),
        velocity_covariance=_UNKNOWN_COVARIANCE,
        reset_counter=local.resets.number % 256,
        estimator_type=mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        quality=0,
    )


def _upper_triangle(diagonal: tuple[float, ...]) -> list[float]:
    """Rows of the upper right triangle of a matrix, NaN off the diagonal."""
    return [
        diagonal[row] if row == column else NAN
        for row in range(len(diagonal))
        for column in range(row, len(diagonal))
    ]


_UNKNOWN_COVARIANCE: Final = [NAN] * 21


def _relative_altitude_m(context: Context, altitude_amsl_m: float) -> float:
    """Height above home, above the local origin before home is known, else 0 [m]."""
    home, local = context.topics.home_position.value, context.topics.vehicle_local_position.value
    if home is not None:
        return altitude_amsl_m - home.altitude_amsl_m
    return -local.position_ned[2] if local is not None else 0.0


def global_position_int(context: Context) -> Message | None:
    """GLOBAL_POSITION_INT; None before the position is known."""
    value = context.topics.vehicle_global_position.value
    if value is None:
        return None
    local = context.topics.vehicle_local_position.value
    velocity = local.velocity_ned if local is not None else (0.0, 0.0, 0.0)
    known_heading = local is not None and local.heading_valid
    return mavlink.MAVLink_global_position_int_message(
        time_boot_ms=boot_ms(value.time_us),
        lat=degrees_e7(value.latitude_deg),
        lon=degrees_e7(value.longitude_deg),
        alt=millimetres(value.altitude_amsl_m),
        relative_alt=millimetres(_relative_altitude_m(context, value.altitude_amsl_m)),
        vx=int16(velocity[0] * 1e2),
        vy=int16(velocity[1] * 1e2),
        vz=int16(velocity[2] * 1e2),
        hdg=compass_centidegrees(local.heading) if local and known_heading else UINT16_MAX,
    )


def gps_global_origin(context: Context) -> Message | None:
    """GPS_GLOBAL_ORIGIN: the position of the local origin."""
    value = context.topics.vehicle_local_position.value
    if value is None or not (value.position_valid and value.altitude_valid):
        return None
    return mavlink.MAVLink_gps_global_origin_message(
        latitude=degrees_e7(value.origin_latitude_deg),
        longitude=degrees_e7(value.origin_longitude_deg),
        altitude=millimetres(value.origin_altitude_amsl_m),
        time_usec=value.time_us,
    )


def home_position(context: Context) -> Message | None:
    """HOME_POSITION with the heading when home was set; no approach vector."""
    home = context.topics.home_position.value
    if home is None:
        return None
    x, y, z = home.position_ned
    return mavlink.MAVLink_home_position_message(
        latitude=degrees_e7(home.latitude_deg),
        longitude=degrees_e7(home.longitude_deg),
        altitude=millimetres(home.altitude_amsl_m),
        x=x,
        y=y,
        z=z,
        q=[math.cos(home.yaw / 2.0), 0.0, 0.0, math.sin(home.yaw / 2.0)],
        approach_x=0.0,
        approach_y=0.0,
        approach_z=0.0,
        time_usec=home.time_us,
    )


def vfr_hud(context: Context) -> Message | None:
    """VFR_HUD once the altitude is known, because MAVProxy crashes on a NaN here.

    Airspeed is 0, as there is no sensor; an unknown velocity is 0 too.
    """
    local = context.topics.vehicle_local_position.value
    if local is None or not local.altitude_valid:
        return None
    motors = context.topics.actuator_motors.value
    throttle = 25.0 * sum(motors.control) if motors is not None else 0.0
    known = all(map(math.isfinite, local.velocity_ned))
    north, east, down = local.velocity_ned if known else (0.0, 0.0, 0.0)
    return mavlink.MAVLink_vfr_hud_message(
        airspeed=0.0,
        groundspeed=math.hypot(north, east),
        heading=compass_centidegrees(local.heading) // 100 if math.isfinite(local.heading) else 0,
        throttle=saturated(throttle, 0, 100),
        alt=local.origin_altitude_amsl_m - local.position_ned[2],
        climb=-down,
    )


def altitude(context: Context) -> Message | None:
    """ALTITUDE; terrain and clearance are not measured (NaN)."""
    local = context.topics.vehicle_local_position.value
    if local is None or not local.altitude_valid:
        return None
    amsl_m = local.origin_altitude_amsl_m - local.position_ned[2]
    return mavlink.MAVLink_altitude_message(
        time_usec=local.time_us,
        altitude_monotonic=amsl_m,
        altitude_amsl=amsl_m,
        altitude_local=-local.position_ned[2],
        altitude_relative=_relative_altitude_m(context, amsl_m),
        altitude_terrain=NAN,
        bottom_clearance=NAN,
    )
