"""Set-points as the vehicle flies them: POSITION_TARGET_*, ATTITUDE_TARGET; and the wind."""

import math
from typing import Final

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.conversion import NAN, boot_ms, degrees_e7
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink

_ATTITUDE_IGNORED: Final = 128


def _unset_bits(values: tuple[float, ...], first_bit: int) -> int:
    """POSITION_TARGET_TYPEMASK bits of the values that are not set."""
    return sum(1 << first_bit + i for i, value in enumerate(values) if math.isnan(value))


def _zero_if_unset(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def position_target_local_ned(context: Context) -> Message | None:
    """POSITION_TARGET_LOCAL_NED: the navigator's set-point; the mask names what is not set."""
    target = context.topics.trajectory_setpoint.value
    if target is None:
        return None
    numbers = (*target.position_ned, *target.velocity_ned, *target.acceleration_ned)
    mask = _unset_bits(numbers, 0) | _unset_bits((target.yaw, target.yaw_rate), 10)
    x, y, z, vx, vy, vz, afx, afy, afz = (_zero_if_unset(number) for number in numbers)
    return mavlink.MAVLink_position_target_local_ned_message(
        time_boot_ms=boot_ms(target.time_us),
        coordinate_frame=mavlink.MAV_FRAME_LOCAL_NED,
        type_mask=mask,
        x=x,
        y=y,
        z=z,
        vx=vx,
        vy=vy,
        vz=vz,
        afx=afx,
        afy=afy,
        afz=afz,
        yaw=_zero_if_unset(target.yaw),
        yaw_rate=_zero_if_unset(target.yaw_rate),
    )


def position_target_global_int(context: Context) -> Message | None:
    """POSITION_TARGET_GLOBAL_INT: the same set-point about the earth."""
    target, local = context.topics.trajectory_setpoint.value, context.topics.local_position.value
    if target is None or local is None:
        return None
    origin = (
        local.origin_latitude_deg,
        local.origin_longitude_deg,
        local.origin_altitude_amsl_m,
    )
    if not all(map(math.isfinite, origin)):
        return None
    numbers = (*target.position_ned, *target.velocity_ned, *target.acceleration_ned)
    mask = _unset_bits(numbers, 0) | _unset_bits((target.yaw, target.yaw_rate), 10)
    north, east, down, vx, vy, vz, afx, afy, afz = map(_zero_if_unset, numbers)
    latitude, longitude, altitude = LocalFrame(*origin).to_geodetic((north, east, down))
    return mavlink.MAVLink_position_target_global_int_message(
        time_boot_ms=boot_ms(target.time_us),
        coordinate_frame=mavlink.MAV_FRAME_GLOBAL_INT,
        type_mask=mask,
        lat_int=degrees_e7(latitude),
        lon_int=degrees_e7(longitude),
        alt=altitude,
        vx=vx,
        vy=vy,
        vz=vz,
        afx=afx,
        afy=afy,
        afz=afz,
        yaw=_zero_if_unset(target.yaw),
        yaw_rate=_zero_if_unset(target.yaw_rate),
    )


def attitude_target(context: Context) -> Message | None:
    """ATTITUDE_TARGET: the newest attitude set-point and the rates asked for.

    In acro mode and with streamed rates the attitude is what was last wanted, and masked out.
    """
    attitude, rates = context.topics.attitude_setpoint.value, context.topics.rates_setpoint.value
    if rates is None:
        return None
    lead = attitude is not None and rates.time_us - attitude.time_us < 1_000_000
    roll, pitch, yaw = rates.rate_frd
    return mavlink.MAVLink_attitude_target_message(
        time_boot_ms=boot_ms(rates.time_us),
        type_mask=0 if lead else _ATTITUDE_IGNORED,
        q=list(attitude.q_ned_frd) if attitude is not None else [1.0, 0.0, 0.0, 0.0],
        body_roll_rate=roll,
        body_pitch_rate=pitch,
        body_yaw_rate=yaw,
        thrust=rates.thrust,
    )


def wind_cov(context: Context) -> Message | None:
    """WIND_COV: the wind that the tilt tells of; and how well it can."""
    wind, local = context.topics.wind.value, context.topics.local_position.value
    if wind is None:
        return None
    north, east = wind.velocity_north_m_s, wind.velocity_east_m_s
    return mavlink.MAVLink_wind_cov_message(
        time_usec=wind.time_us,
        wind_x=north,
        wind_y=east,
        wind_z=0.0,
        var_horiz=wind.accuracy_m_s**2,
        var_vert=NAN,
        wind_alt=NAN if local is None else local.origin_altitude_amsl_m - local.position_ned[2],
        horiz_accuracy=wind.accuracy_m_s,
        vert_accuracy=NAN,
    )
